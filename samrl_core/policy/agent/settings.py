"""What the agent is asked to be, and the networks that it needs for that."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from samrl_core.cell.control.cartesian import LONGEST_DISPLACEMENT
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.common.errors import InputError
from samrl_core.policy.agent.policies import ACTOR_IMAGES, DEFAULT_POLICY, POLICIES, STRATEGIES, STRATEGY_OF
from samrl_core.policy.networks.networks import ResidualActor, SensingQ, SimActor
from samrl_core.policy.networks.weights import load_weights, sha256_of, weights_file
from samrl_core.policy.planning.trajectory import TrajectorySettings
from samrl_core.policy.view.sensing_value import Networks
from samrl_core.policy.view.view_ascent import ViewAscentSettings
from samrl_core.policy.view.view_planning import ViewPlanningSettings

Log = Callable[[str], None]  # receives messages about what went wrong


def no_log(text: str) -> None:
    """Drop the message."""


@dataclass(frozen=True)
class AgentSettings:
    """What the agent does in each of its parts.

    Raises:
        InputError: a policy, strategy or actor's image that there is not, a real one without an actor, a
            tip's offset without plans, touch without a tip's offset, or a limit of updates below one.
    """

    policy: str = DEFAULT_POLICY  # of `samrl_core.policy.agent.policies.POLICIES`
    strategy: str = STRATEGY_OF[DEFAULT_POLICY]  # of `samrl_core.policy.agent.policies.STRATEGIES`
    update: bool = True  # Real2Sim; off for ablations
    tip_offset: bool = False  # where the camera sees the held part corrects the encoders' tip, for plans
    # A peg is led by what it touches, without the planned action or a residual, and a cell's errors are
    # remembered from episode to episode; a spatula feels for its plate, if that is of unknown height.
    touch: bool = False
    doubt: float = 1.0  # times the usual errors of calibration and images that a touched peg is searched with
    sees_tip: bool = True  # whether images correct the tip's offset; off for ablations
    most_updates: int | None = None  # of the model in an episode, None for all; for ablations
    sees_colours: bool = True  # whether a touched peg and its hole are told by colours; off for ablations
    actor_image: str = "rendered"  # of `ACTOR_IMAGES`; "real" for actors of randomised models, not updated
    seed: int = 0  # of strategy "random" and of exploration
    exploration: float = 0.0  # standard deviation of what is added to the residual while it is trained [m]
    exploration_memory: float = 0.98  # correlation of what is added to an action and to the next one
    exploration_limit: float = 0.003  # of what is tried before there is a residual, which has its own [m]
    longest: float = LONGEST_DISPLACEMENT  # action, its residual included [m]
    plan: TrajectorySettings = TrajectorySettings(max_sub_goals=3, max_iterations=3, spare_actions=1)
    information: ViewPlanningSettings = field(default_factory=ViewPlanningSettings)
    ascent: ViewAscentSettings = ViewAscentSettings()

    def __post_init__(self) -> None:
        if self.policy not in POLICIES:
            raise InputError(f"no policy is named {self.policy!r}; there are: {', '.join(POLICIES)}")
        if self.strategy not in STRATEGIES:
            raise InputError(
                f"no view strategy is named {self.strategy!r}; there are: {', '.join(STRATEGIES)}"
            )
        if self.actor_image not in ACTOR_IMAGES:
            raise InputError(
                f"no actor reads the image {self.actor_image!r}; there are: {', '.join(ACTOR_IMAGES)}"
            )
        if self.tip_offset and self.policy != "optimised":
            raise InputError(
                f"tip_offset corrects the tip that plans start from, policy {self.policy!r} makes none; take "
                f"policy 'optimised'"
            )
        if self.touch and not self.tip_offset:
            raise InputError("touch starts from where the camera sees the held peg; set tip_offset as well")
        if self.most_updates is not None and self.most_updates < 1:
            raise InputError(
                f"most_updates is {self.most_updates}, must be at least 1; for no update at all "
                f"set update to False"
            )
        if not 1.0 <= self.doubt <= 10.0:
            raise InputError(f"doubt is {self.doubt}, must be within 1..10 times the errors of a usual cell")
        if self.actor_image == "real" and self.policy != "learned":
            raise InputError(
                f"policy {self.policy!r} has no actor to read a real image; take policy 'learned'"
            )

    def allows_update(self, made: int) -> bool:
        """Whether an image updates the model, after so many that did in this episode."""
        return self.update and (self.most_updates is None or made < self.most_updates)

    @property
    def needs_networks(self) -> bool:
        """Whether anything here is learned."""
        return self.policy == "learned" or self.strategy == "q"


def trained_networks(task: str, cell: CellSpec, folder: Path | None = None) -> Networks:
    """Actor and Q of a task: `<task>_<kind>.safetensors` in a folder, or those of the package.

    A variant of a task without networks of its own has those of the plain task.

    Raises:
        InputError: a file is missing or does not fit; see `load_weights`.
    """
    actor, _ = load_weights(weights_file(task, "sim_actor", folder), "sim_actor", task, cell)
    q, _ = load_weights(weights_file(task, "sensing_q", folder), "sensing_q", task, cell)
    assert isinstance(actor, SimActor) and isinstance(q, SensingQ)
    return Networks(actor.requires_grad_(False), q.requires_grad_(False))


def announced_residual(file: Path, sha256: str, task: str, cell: CellSpec) -> ResidualActor:
    """The residual of a file whose content was announced by its hash.

    Raises:
        InputError: the file has another content, or does not fit; see `load_weights`.
    """
    if not file.is_file():
        raise InputError(f"no residual weights at {file}; the trainer and this node must share a disk")
    found = sha256_of(file)
    if found != sha256:
        raise InputError(f"{file} has sha256 {found}, announced was {sha256}; nothing of it is used")
    module, _ = load_weights(file, "residual_actor", task, cell)
    assert isinstance(module, ResidualActor)
    return module.requires_grad_(False)


def required(networks: Networks | None, who: str) -> Networks:
    """The networks.

    Raises:
        InputError: there are none.
    """
    if networks is None:
        raise InputError(f"{who} needs trained networks; hand in `trained_networks(task, cell)`")
    return networks
