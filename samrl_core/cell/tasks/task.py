"""The border that every task fills: scene, what is unknown, sub-goals, and when it is done.

A task never accesses the simulator. `is_done` uses the model's estimate (as the paper's automatic
termination does); `succeeded` uses ground truth and is called by evaluation alone.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Literal

import numpy as np

from samrl_core.cell.instance.parts import Parts
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Scene


@dataclass(frozen=True)
class ParameterSpec:
    """How a number that Real2Sim fits is declared."""

    name: str
    unit: str
    nominal: float
    scale: float  # prior standard deviation
    lower: float
    upper: float
    # "state" changes as the tool moves, "constant" stays as it is, "camera" stays until the camera moves.
    kind: Literal["state", "constant", "camera"] = "state"


def camera_specs(deviation: float, surface: float = 0.0) -> tuple[ParameterSpec, ...]:
    """Parameters of `Task.camera_shift`, of so large a standard deviation per axis [m] before any image.

    Where all that is seen lies on a `surface` of so unknown a height, its standard deviation [m], the shift
    upwards has that too.
    """
    deviations = {"x": deviation, "y": deviation, "z": float(np.hypot(deviation, surface))}
    return tuple(
        ParameterSpec(f"camera_{axis}", "m", 0.0, size, -5.0 * size, 5.0 * size, "camera")
        for axis, size in deviations.items()
    )


@dataclass(frozen=True, eq=False)
class SubGoal:
    """A state of the tool tip to reach (eq. 22's G(T)_i), in the tool arm's base frame."""

    name: str
    tip_position: np.ndarray  # (3,) [m]
    tolerance: float  # reached when the tip is this near [m]
    max_step: float  # largest displacement per action on the way there [m]


@dataclass(frozen=True, eq=False)
class ViewRegion:
    """Where the camera may look from: a spherical shell about a target."""

    target: np.ndarray  # (3,) in world [m]
    distance: tuple[float, float]  # [m]
    azimuth: tuple[float, float]  # about world z, 0 along +x [rad]
    elevation: tuple[float, float]  # above the horizon [rad]


@dataclass(frozen=True, eq=False)
class Slide:
    """What is done to a body that nothing touches: it slides once, as what it lies on is shaken."""

    body: str
    way: np.ndarray  # (2,) in world's x and y, until friction has stopped it [m]
    after: float  # it begins when the tool's tip has come so far from where it started [m]


@dataclass(frozen=True, eq=False)
class EpisodeStart:
    """Sampled start of an episode, and what else is bound to happen in it."""

    body_in_world: dict[str, Pose]  # of the bodies that do not stand at their nominal pose
    chain_angles: np.ndarray  # (2 K,) of the tool's chain, hanging at rest; x and y joint of each link [rad]
    slides: tuple[Slide, ...] = ()


@dataclass(frozen=True, eq=False)
class Ending:
    """How an episode truly ended, in world. Made by evaluation alone, from `evaluation/truth.jsonl`."""

    body_in_world: dict[str, Pose]
    body_speed: dict[str, float]  # of the bodies' origins [m/s]
    body_peak_height: dict[str, float]  # highest z of the bodies' origins in this episode [m]
    tip_position: np.ndarray  # (3,) tool tip [m]
    chain_points: np.ndarray  # (K + 1, 3) joints of the tool's chain, then its end; (0, 3) without one [m]
    peak_contact_force: float = 0.0  # largest normal force on the tool in this episode [N]


class Task(ABC):
    """One manipulation task. Implementations are final and hold settings only.

    Parameters may move bodies (`body_poses`), bend the chain that hangs from the tool (`chain_angles`), or
    both. `tip_position` is the origin of the tool frame, which an action displaces; the end of a chain
    follows from it and the angles.
    """

    name: str
    max_actions: int
    variant_of: str = ""  # name of the task whose trained networks serve this one too; empty for none
    usual_policy: str = ""  # that a run has unless asked for another one; empty for the learned one

    @property
    @abstractmethod
    def action_limit(self) -> float:
        """Longest action [m]: no sub-goal has a larger `max_step`."""

    @property
    def surface_height(self) -> float:
        """How high the table's top is that the bodies lie on, in world [m]; another one only as made."""
        return 0.0

    @abstractmethod
    def scene(self, cell: CellSpec) -> Scene:
        """Bodies at their nominal poses, and the tool."""

    def as_made(self, parts: Parts) -> Task:
        """This task with parts that differ from the drawing: what a world is built from, and no model.

        A task without a method of its own has parts exactly as drawn.
        """
        return self

    @abstractmethod
    def parameters(self) -> tuple[ParameterSpec, ...]:
        """What Real2Sim estimates, in order."""

    @abstractmethod
    def body_poses(self, values: np.ndarray) -> dict[str, Pose]:
        """Poses in world of the bodies that the parameters move."""

    def body_scales(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """How many times as large as drawn (3,) such bodies are along their own axes [-]; {} for as drawn."""
        return {}

    @abstractmethod
    def chain_angles(self, values: np.ndarray) -> np.ndarray:
        """Angles (2 K,) [rad] of the tool's chain of K links; (0,) for a rigid tool."""

    def chain_stretch(self, values: np.ndarray) -> float:
        """Length of the tool's chain by the parameters (P,), as a share of the drawn one [-]."""
        return 1.0

    def camera_shift(self, values: np.ndarray) -> np.ndarray:
        """How far (3,) [m] in world the camera shows everything beside where the encoders have it.

        What errors of hand-eye, bases and encoders come to near the target; what is drawn there and what is
        held are shown beside their places by the same.
        """
        return np.zeros(3)

    def aim(self, values: np.ndarray, tip_position: np.ndarray) -> np.ndarray:
        """What the next actions have to hit, as a distance (A,) [m] that views shall make known.

        (0,) where a view is worth what it tells of all parameters alike.
        """
        return np.zeros(0)

    def needs_aim(self, values: np.ndarray, tip_position: np.ndarray) -> bool:
        """Whether the next action goes wrong if `aim` is not known: a better view is searched before it."""
        return False

    def held_within(self, values: np.ndarray, tip_position: np.ndarray) -> float:
        """How long `aim` can be of what has gone in and leaves only on the way that it came; else inf [m]."""
        return math.inf

    def as_believed(self, values: np.ndarray) -> Task:
        """This task with what the parameters (P,) say of its parts' sizes drawn in, for the physics."""
        return self

    @abstractmethod
    def values_at(self, body_in_world: dict[str, Pose], chain_angles: np.ndarray) -> np.ndarray:
        """The parameters (P,) of such poses and angles: the inverse of `body_poses` and `chain_angles`.

        What no parameter shows, as a disc's spin about its own axis, is left out.
        """

    def values_from_truth(self, body_in_world: dict[str, Pose], chain_points: np.ndarray) -> np.ndarray:
        """The parameters (P,) of true poses, and of the points (K + 1, 3) [m] of the tool's chain.

        Evaluation alone calls it. A task whose parameters bend the chain reads them off the points.
        """
        return self.values_at(body_in_world, np.zeros(0))

    def look_alikes(self, values: np.ndarray) -> tuple[np.ndarray, ...]:
        """Other parameters (P,) that give the target the same shape in the same place, as a disc turned over.

        No outline and no depth tells them apart, only colours do, or that one of them cannot be.
        """
        return ()

    def is_possible(self, values: np.ndarray) -> bool:
        """Whether the target can lie so: of look-alikes, one that cannot gives way to one that can."""
        return True

    @abstractmethod
    def start_joints(self, cell: CellSpec) -> dict[str, np.ndarray]:
        """Joint positions at the start of an episode, per role (J,) [rad]."""

    @abstractmethod
    def start_camera(self) -> Pose:
        """Camera pose in world at the start of an episode."""

    @abstractmethod
    def view_region(self) -> ViewRegion:
        """Allowed camera positions."""

    @abstractmethod
    def sub_goals(self, values: np.ndarray, tip_position: np.ndarray) -> tuple[SubGoal, ...]:
        """Goals still ahead, given the estimate and the tip (3,) [m] in the tool arm's base frame."""

    @abstractmethod
    def is_done(self, values: np.ndarray, tip_position: np.ndarray) -> bool:
        """Whether the model believes that the task is done."""

    @abstractmethod
    def start_values(self, rng: np.random.Generator) -> np.ndarray:
        """Parameters (P,) of a random start, as the task declares them: what a learner may practise from."""

    @property
    @abstractmethod
    def start_range(self) -> tuple[np.ndarray, np.ndarray]:
        """Bounds (P,) between which `start_values` is uniform; equal where a parameter starts as it is."""

    def sample_start(self, rng: np.random.Generator) -> EpisodeStart:
        """A random start; the simulated world calls it on reset."""
        values = self.start_values(rng)
        return EpisodeStart(self.body_poses(values), self.chain_angles(values), self.sample_slides(rng))

    def sample_slides(self, rng: np.random.Generator) -> tuple[Slide, ...]:
        """What will slide in an episode; only as made."""
        return ()

    @property
    def stands_still(self) -> bool:
        """Whether the tool alone moves the target: only then has an estimate one error before contact."""
        return True

    @abstractmethod
    def succeeded(self, ending: Ending) -> bool:
        """From ground truth. Evaluation alone calls it."""

    @abstractmethod
    def final_error(self, ending: Ending) -> float:
        """Distance to the goal from truth [m], for the summary. Evaluation alone calls it."""

    @abstractmethod
    def shaped_reward(self, ending: Ending) -> float:
        """The paper's reward of a state for the learners that it compares with, were it the last one [m].
        From ground truth: evaluation alone calls it, SAM-RL itself never does.
        """
