"""How well the arms followed their commands, from joint states and commands of a bag."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from samrl_ros.bags.reader import Bag, RawMessage
from samrl_ros.bags.recorder import header_stamp_ns

GRID_NS = 4_000_000  # period of joint states; long bags are read on a multiple of it
JOINT_SAMPLES = 12_000  # per arm, at most


@dataclass(frozen=True, eq=False)
class Tracking:
    """Commanded minus measured position of one arm."""

    role: str
    joints: tuple[str, ...]
    time: np.ndarray  # (N,) [s]
    error: np.ndarray  # (N, J) [rad]


class JointSamples:
    """Names, stamps [ns] and positions [rad] of a topic, thinned to `JOINT_SAMPLES`."""

    def __init__(self, bag: Bag, topic: str) -> None:
        """Nothing is read yet."""
        count = next((t.count for t in bag.topics if t.name == topic), 0)
        self._stride = -(-count // JOINT_SAMPLES)
        self._rows: dict[int, np.ndarray] = {}
        self.names: tuple[str, ...] = ()

    def take(self, raw: RawMessage, decoded: Callable[[RawMessage], Any]) -> None:
        """Take a message of the topic; `decoded` makes an object of it."""
        stamp = header_stamp_ns(raw.type, raw.data)
        # By the stamp, not by counting: measured and commanded samples of one instant stay together.
        if stamp is None or (stamp // GRID_NS) % self._stride:
            return
        message = decoded(raw)
        trajectory = hasattr(message, "points")
        if trajectory and len(message.points) != 1:
            return
        here = tuple(message.joint_names if trajectory else message.name)
        row = np.asarray(message.points[0].positions if trajectory else message.position, dtype=float)
        self.names = self.names or here
        if here == self.names and row.shape == (len(self.names),):
            self._rows[stamp] = row

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        """Stamps (N,) [ns] and positions (N, J) [rad]."""
        stamps = sorted(self._rows)
        positions = np.array([self._rows[s] for s in stamps]).reshape(-1, len(self.names))
        return np.array(stamps, dtype=np.int64), positions


def tracking_of(role: str, measured: JointSamples, commanded: JointSamples) -> list[Tracking]:
    """Errors at the stamps of the joint states; the command is interpolated between its stamps."""
    if not measured.names or sorted(measured.names) != sorted(commanded.names):
        return []
    (time, position), (valid, target) = measured.arrays(), commanded.arrays()
    if not len(time) or not len(valid):
        return []
    target = target[:, [commanded.names.index(name) for name in measured.names]]
    inside = (time >= valid[0]) & (time <= valid[-1])
    if inside.sum() < 2:
        return []
    time, position = time[inside], position[inside]
    wanted = np.column_stack([np.interp(time, valid, column) for column in target.T])
    return [Tracking(role, measured.names, time * 1e-9, wanted - position)]
