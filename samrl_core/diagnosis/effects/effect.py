"""What an effect is: a family of the catalogue in words, where it may act, and the forms in which it does."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Generic

from typing_extensions import TypeVar

from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.signals.signal_noise import FAST_HZ
from samrl_core.diagnosis.residuals.trial import Trial

T = TypeVar("T", bound=Observed, default=Trial)  # what kind of recording shows it; an arm's unless stated


@dataclass(frozen=True)
class Parameter:
    """A physical parameter as reported."""

    name: str
    unit: str
    low: float  # plausible range for an arm of the size of a Panda
    high: float
    meaning: str
    bounded: bool = True  # an angle that may be anything has no plausible range


class Effect(ABC, Generic[T]):
    """A family of the contract: all that the diagnosis, the report and the terminal know about it."""

    family: ClassVar[str]
    number: ClassVar[int]
    title: ClassVar[str]  # starts a sentence
    proper_name: ClassVar[bool] = False  # its title keeps its capital within a sentence
    meaning: ClassVar[str]  # what it physically is, in one sentence, for whoever stands beside the machine
    remedy: ClassVar[str]  # what to do about it, in one or two sentences
    formula: ClassVar[str]
    source: ClassVar[str]
    acts_on: ClassVar[str]  # command, dynamics or reading
    excitation: ClassVar[str]  # the motion that shows it, in words
    experiment: ClassVar[str] = "slow"  # the excitation trajectory of the catalogue that shows it best
    curve_over: ClassVar[str] = "effort"  # what the report plots it against: a key of `curves.AXES`
    confounded_with: ClassVar[tuple[str, ...]] = ()
    contains: ClassVar[tuple[str, ...]] = ()  # families that are this one with a term less
    parameters: ClassVar[tuple[Parameter, ...]]
    renamed_shapes: ClassVar[tuple[str, ...]] = ()  # shapes that are reported under another name
    place_kind: ClassVar[str] = "joint"  # joint, link, arm, sensor, body or cell
    prior_cost: ClassVar[float] = 0.0  # [nat] less likely before any data than other families
    at_every_joint: ClassVar[bool] = False  # may also act at all joints of an arm, each with its own size
    simulated: ClassVar[bool] = True  # some form has a simulation in closed loop
    limits_motion: ClassVar[bool] = False  # fits any torque a little, so motion must show it
    of_description: ClassVar[bool] = False  # no machine has it, and no sealed world
    forms_may_be_one: ClassVar[bool] = False  # where little varies: then both of their numbers are reported
    by_chance: ClassVar[bool] = False  # happens at random times: a held-out recording cannot confirm when

    @property
    def running_title(self) -> str:
        """The title as it stands within a sentence."""
        return self.title if self.proper_name else self.title[:1].lower() + self.title[1:]

    @property
    def explained(self) -> dict[str, str]:
        """What each parameter is, by its name."""
        return {p.name: p.meaning for p in self.parameters}

    def places(self, trial: T) -> tuple[Place, ...]:
        """Places at which the effect may act in this recording."""
        names = trial.names_of(self.place_kind)
        if self.place_kind == "joint" and self.acts_on_arm(trial):
            names += trial.names_of("arm")
        return tuple(Place.find(trial, name) for name in names)

    def acts_on_arm(self, trial: T) -> bool:
        """Whether an effect on joints may also act on all of them together."""
        return self.at_every_joint and len(trial.names_of("joint")) > 1

    def why_unobservable(self, trial: T) -> str | None:
        """Why this recording cannot show the effect at all; None if it can."""
        return None

    @abstractmethod
    def forms(self, trial: T, place: Place) -> tuple[Form[T], ...]:
        """Forms with their grids, for this system and sampling."""


def lacks_link_torque(trial: Trial) -> str | None:
    """Why a recording cannot show what acts behind the torque sensors; None if it can."""
    if trial.rigid is None or not ({"link", "dynamics"} & set(trial.channels)):
        return too_slow_for_torques(trial) or "needs a torque and a dynamic model"
    return None


def lacks_drive_torque(trial: Trial) -> str | None:
    """Why a recording cannot show torque that is lost in the drives; None if it can."""
    if not ({"drive", "dynamics"} & set(trial.channels)):
        return too_slow_for_torques(trial) or "needs the commanded effort and a dynamic model"
    return None


def lacks_law(trial: Trial, otherwise: str) -> str:
    """What a recording lacks to show what a controller does; `otherwise` where command and law are there."""
    controller = trial.recording.arm.controller
    if trial.recording.command is None:
        return otherwise
    if controller is None:
        return "needs a described controller: the command is there, the law that follows it is not"
    if controller.law.open_loop:
        return (
            f"needs a law that follows the command: `{controller.kind}` is a motor without a loop, driven by"
            " the recorded commanded effort"
        )
    return otherwise


def too_slow_for_torques(trial: Trial) -> str:
    """Why torques were recorded, and are compared with nothing; empty where they are, or there are none."""
    motion = trial.motion
    if trial.rigid is None or motion.dynamic or not motion.has_torque:
        return ""
    return (
        f"{trial.recording.name} has {motion.rate:.3g} Hz and moves faster than that tells, so its"
        f" accelerations are not known: log at {FAST_HZ:.0f} Hz or more, or move slower"
    )
