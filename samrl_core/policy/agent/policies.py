"""Names of policies and view strategies, and the defaults; imports nothing."""

POLICIES = ("learned", "optimised")  # nominal action: of the trained actor, or of a plan through the model
# View: ascent of the learned Q, expected information, none, any.
STRATEGIES = ("q", "best", "fixed", "random")

ACTOR_IMAGES = ("rendered", "real")  # what the actor reads: the updated model's image, or the camera's own

# The strategy that goes with a policy unless another one is asked for.
STRATEGY_OF = {"learned": "q", "optimised": "best", "touch": "best"}

DEFAULT_POLICY = "learned"  # with the networks of the package

# What a run may be asked for: policy "optimised" led by touch (`AgentSettings.touch`) has a name of its own.
TOUCH = "touch"
RUN_POLICIES = (*POLICIES, TOUCH)
