"""Where an arm is excited: a box of joint positions, free of table and self, with varied gravity loads."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from samrl_core.cell.excitation.clearance import ArmLine
from samrl_core.cell.robots.arm_model import Payload
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.common.errors import LimitError

POSITION_MARGIN = 0.05  # kept from position limits [rad]
_HALF_WIDTHS = (0.55, 0.45, 0.35, 0.25)  # tried in turn [rad]
_CANDIDATES = 150
_SAMPLES = 20


@dataclass(frozen=True, eq=False)
class WorkBox:
    """Joint positions within `half_width` of `center`."""

    center: np.ndarray  # (J,) [rad]
    half_width: float  # [rad]

    def sample(self, rng: np.random.Generator, count: int, share: float = 1.0) -> np.ndarray:
        """Positions (count, J) [rad], uniform in the inner `share` of the box."""
        offsets = rng.uniform(-1.0, 1.0, (count, len(self.center)))
        return self.center + share * self.half_width * offsets

    def shrunk(self, factor: float) -> WorkBox:
        """A smaller box about the same centre."""
        return WorkBox(self.center, factor * self.half_width)


@lru_cache(maxsize=32)  # by identity: specs and payloads are module constants or live as long as a run
def work_box(spec: RobotSpec, payload: Payload | None) -> WorkBox:
    """The widest box tried, near the arm's home, whose sampled positions are all free.

    Among boxes of one width, the one over which gravity torques vary most against the effort limits.

    Raises:
        LimitError: none is free; the arm's home must stand free of the table.
    """
    rng = np.random.default_rng(0)  # one box per arm, whatever the seed of a trajectory
    line = ArmLine(spec, payload)
    for half_width in _HALF_WIDTHS:
        lower = spec.limits.lower + half_width + POSITION_MARGIN
        upper = spec.limits.upper - half_width - POSITION_MARGIN
        if np.any(lower > upper):
            continue
        best, best_score = None, -np.inf
        for _ in range(_CANDIDATES):
            center = np.clip(spec.home + rng.uniform(-0.8, 0.8, len(lower)), lower, upper)
            box = WorkBox(center, half_width)
            positions = box.sample(rng, _SAMPLES)
            if line.clearance(center[None]).worst < 0.05 or line.clearance(positions).worst < 0.0:
                continue
            load = np.array([line.model.gravity(q) for q in positions]) / spec.limits.effort
            score = float(np.log(np.ptp(load, axis=0) + 1e-3).sum())
            if score > best_score:
                best, best_score = box, score
        if best is not None:
            return best
    raise LimitError(
        f"no box of joint positions about the home of '{spec.name}' keeps off the table and the arm itself; "
        f"give the spec a home with the flange at least {0.3} m above the base's foot"
    )
