"""Arms whose models state friction, and that really stick: what is stated, what is true, what is read.

The URDF of the description carries it, the real arm sticks near it, its encoders round, its velocities are
filtered differences, and its log loses messages.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.robots.urdf_text import parse_urdf
from samrl_core.cell.types.arm_recording import JointSignal

_DRY, _WET = (0.01, 0.05), (0.005, 0.04)  # of effort limits, and of those over velocity limits
_COUNTS = (2**17, 2**20)  # of an encoder in a turn of its joint
_CUTOFF_HZ = (60.0, 200.0)  # of the filter of its differences
_LOST = 0.005  # share of messages, at most
_LEAST = 0.2  # of what is stated, that a real joint has

Reader = Callable[[float, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class StatedFriction:
    """As a model states it, (J,)."""

    dry: np.ndarray  # [N m]
    wet: np.ndarray  # [N m s/rad]

    @property
    def any(self) -> bool:
        """Whether there is some."""
        return bool(self.dry.any())

    def in_urdf(self, text: str, joints: tuple[str, ...]) -> str:
        """A URDF with it."""
        if not self.any:
            return text
        root = parse_urdf(text, "the nominal model")
        for name, dry, wet in zip(joints, self.dry.tolist(), self.wet.tolist(), strict=True):
            joint = next(j for j in root.iter("joint") if j.get("name") == name)
            for old in joint.findall("dynamics"):
                joint.remove(old)
            joint.append(joint.makeelement("dynamics", {"friction": f"{dry:.4g}", "damping": f"{wet:.4g}"}))
        return ElementTree.tostring(root, "unicode")


def state_friction(spec: RobotSpec, seed: int, sticks: bool) -> StatedFriction:
    """Of a world, three digits as a model has them; none where machines do not stick."""
    if not sticks:
        return StatedFriction(np.zeros(len(spec.joint_names)), np.zeros(len(spec.joint_names)))
    rng = np.random.default_rng([seed, 1])
    limits, count = spec.limits, len(spec.joint_names)
    dry = rng.uniform(*_DRY, size=count) * limits.effort
    wet = rng.uniform(*_WET, size=count) * limits.effort / limits.velocity
    return StatedFriction(*(np.array([float(f"{x:.3g}") for x in values]) for values in (dry, wet)))


def near(stated: np.ndarray, tolerated: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Friction (J,) of a real arm: off by a share, 0..1 from below to above, of what is tolerated."""
    return np.maximum(_LEAST * stated, stated + tolerated * (2.0 * share - 1.0))


def encoders(joints: int, period: float, seed: int) -> Reader:
    """Readings of a recording: positions in whole counts, velocities as their filtered differences."""
    rng = np.random.default_rng([seed, 2])
    step = 2.0 * math.pi / np.exp(rng.uniform(*np.log(_COUNTS), size=joints))
    keep = math.exp(-2.0 * math.pi * float(rng.uniform(*_CUTOFF_HZ)) * period)
    last: list[np.ndarray] = []
    speed = np.zeros(joints)

    def read(t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        seen = np.round(q / step) * step
        before = last.pop() if last else seen
        last.append(seen)
        speed[:] = keep * speed + (1.0 - keep) * (seen - before) / period
        return seen, speed.copy()

    return read


def with_losses(signal: JointSignal, rng: np.random.Generator) -> JointSignal:
    """A channel some of whose messages (N,) nobody got."""
    there = rng.random(len(signal)) >= rng.uniform(0.0, _LOST)
    there[[0, -1]] = True
    parts = (signal.position, signal.velocity, signal.acceleration, signal.effort)
    return JointSignal(signal.time[there], *(None if x is None else x[there] for x in parts))
