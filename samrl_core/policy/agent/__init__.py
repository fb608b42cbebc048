"""Algorithm 1: update the model, plan a view where it helps, act.

`Agent` has the three as verbs; the cell's nodes `model_updater`, `view_planner` and `policy` use one each,
and `run_episode` all of them. What the paper learns, the view and the nominal action, can be had from the
model alone too: a view by expected information, an action by a trajectory optimised with sub-goals.
"""
