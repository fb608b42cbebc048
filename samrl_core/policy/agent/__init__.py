"""Algorithm 1: update the model, look where it helps, act; pure, and the same lines that the nodes call.

`Updating` is lines 3 and 8, `Looking` lines 5 to 15, `Acting` lines 4, 9 and 18. The cell's nodes hold one
part each, `Agent` all of them. What the paper learns, the view and the nominal action, can be had from the
model alone too: a view by expected information, an action by a trajectory optimised with sub-goals.
"""
