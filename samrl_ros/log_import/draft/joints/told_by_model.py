"""What a robot's description settles about a log that names neither joints nor units: limits and torques.

Gravity and inertia load each joint of an arm in its own way. Torques that follow the model's in one order of
the joints, and do not with any two exchanged, prove the order, the unit of torques and that of positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.resampling import even

UNITS = {"rad": 1.0, "deg": np.pi / 180.0, "rev": 2.0 * np.pi}  # of positions that arms log, in rad
_MOMENTS = 600  # of a log, that are looked at
_SMOOTHED_S = 0.25  # over which positions are differentiated
_BEYOND = 0.1  # [rad] outside the described limits that zeros and soft stops may account for
_PER_SECOND = 4.0  # independent readings
_SURELY = 12.0  # log likelihood ratio [nat]
_FLOOR = 0.03  # of a torque's range: no model is so exact that less tells two apart
_CARRIES = 0.5  # share of what friction of a joint leaves, that the model explains where it counts
_ALIKE = (0.75, 1.33)  # measured over modelled torque: N m
_LEAST_CARRYING = 2  # joints, or all of an arm with fewer


@dataclass(frozen=True)
class ToldByModel:
    """What limits and torques of a model say of a log, as it was taken."""

    unit_by_limits: bool  # no other unit of position stays within the limits
    unit_by_torque: bool  # the torques follow with no other that does
    torque_in_nm: bool
    order: bool  # no two joints can change places
    exchangeable: tuple[tuple[str, str], ...] = ()  # pairs that can
    compared: bool = True  # whether there were torques to compare
    slope: float = 0.0  # measured over modelled torque, median of the joints that carry
    reversed: bool = False  # the torques follow the model's with the other sign

    @property
    def unit(self) -> bool:
        """Whether the unit of positions is settled."""
        return self.unit_by_limits or self.unit_by_torque


def told_by_model(
    urdf: str,
    joints: Sequence[str],
    time: np.ndarray,
    position: np.ndarray,
    unit: str,
    effort: np.ndarray | None,
) -> ToldByModel | None:
    """Compare a log with a model; None where that has other joints than turning ones, or no such joints.

    Args:
        urdf: text.
        joints: its joints, one for each column.
        time: (N,) [s].
        position: (N, J) in `unit`.
        unit: `rad`, `deg` or `rev`.
        effort: (N, J) as logged, if there is one.
    """
    arm = _turning_arm(urdf, joints, unit)
    if arm is None:
        return None
    others = [u for u in UNITS if u != unit]
    inside = {u: _within_limits(arm, position * factor) for u, factor in UNITS.items()}
    by_limits = inside[unit] and not any(inside[u] for u in others)
    log = None if effort is None or not inside[unit] else _Log.of(time, position, effort)
    if log is None:
        return ToldByModel(by_limits, False, False, False, compared=False)
    mine = log.against(arm, UNITS[unit])
    needed = min(_LEAST_CARRYING, len(joints))
    slope = float(np.median(mine.slopes[mine.carries])) if mine.carries.any() else 0.0
    follows, turned = (
        bool(mine.carries.sum() >= needed and ((_ALIKE[0] < slopes) & (slopes < _ALIKE[1])).all())
        for slopes in (mine.slopes[mine.carries], -mine.slopes[mine.carries])
    )
    if not follows:
        return ToldByModel(by_limits, False, False, False, slope=slope, reversed=turned)
    by_torque = all(
        mine.likelihood - log.against(arm, UNITS[u]).likelihood > _SURELY for u in others if inside[u]
    )
    pairs = []
    for a, b in combinations(range(len(joints)), 2):
        swapped = log.against(arm, UNITS[unit], (a, b))
        if mine.likelihood - swapped.likelihood <= _SURELY:
            pairs.append((joints[a], joints[b]))
    return ToldByModel(by_limits, by_torque, True, not pairs, tuple(pairs), slope=slope)


def settle_by_model(draft: Draft, told: ToldByModel, unit: str) -> None:
    """Answer the draft's open questions of order and units as far as the model does."""
    follow = f"the measured torques follow the URDF's (ratio {told.slope:.2f})"
    if told.order:
        draft.settle("order", f"{follow}, and do not with any two joints exchanged")
    elif told.torque_in_nm:
        pairs = ", ".join(f"{a} and {b}" for a, b in told.exchangeable[:4])
        draft.add_reason("order", f"{follow}, which does not tell apart {pairs}")
    elif told.compared:
        draft.add_reason("order", "in this order the measured torques do not follow the URDF's")
    if told.unit:
        draft.settle("unit", f"{unit}: " + (
            "in any other unit the joints leave the URDF's limits" if told.unit_by_limits
            else f"{follow} in {unit} alone"
        ))  # fmt: skip
    if told.torque_in_nm:
        draft.settle("torque_unit", follow)


def is_reversed(draft: Draft) -> bool:
    """Whether a draft takes its measured torque with a minus."""
    return any(
        str(formula).startswith("-")
        for channel in (draft.channels.get("states", {}), draft.channels.get("commanded_effort", {}))
        if isinstance(quantity := channel.get("effort"), dict)
        for formula in quantity["formula"]
    )


def with_minus(quantity: dict[str, Any]) -> None:
    """Takes a quantity of a draft with the other sign."""
    quantity["formula"] = [f"-{formula}" for formula in quantity["formula"]]


def reverse_torque(draft: Draft, told: ToldByModel) -> None:
    """Take the measured torque with a minus, and ask."""
    name = "states" if "effort" in draft.channels["states"] else "commanded_effort"
    with_minus(draft.channels[name]["effort"])
    draft.note(
        f"channels.{name}.effort",
        f"the torques follow the URDF's with the other sign (ratio {told.slope:.2f}): taken with a minus",
        "does the log give the reaction, or do the joints turn the other way than the URDF's?",
    )


def is_without_gravity(
    urdf: str, joints: Sequence[str], time: np.ndarray, position: np.ndarray, unit: str, effort: np.ndarray
) -> bool:
    """Whether torques follow the model's without gravity, and surely not with it; arguments as above."""
    arm, log = _turning_arm(urdf, joints, unit), _Log.of(time, position, effort)
    if arm is None or log is None:
        return False
    whole, rest = (log.against(arm, UNITS[unit], weighs=weighs).likelihood for weighs in (True, False))
    return rest - whole > _SURELY


def _turning_arm(urdf: str, joints: Sequence[str], unit: str) -> RigidArm | None:
    """The described arm; None where it has no such joints, or what they are logged in is no angle."""
    try:
        arm = RigidArm(ArmDescription("tool_arm", tuple(joints), urdf, None))
    except InputError:
        return None
    return None if any(arm.slides) or unit not in UNITS else arm


def _within_limits(arm: RigidArm, position: np.ndarray) -> bool:
    low, high = arm.position_limits()
    return bool(((position > low - _BEYOND) & (position < high + _BEYOND)).all())


@dataclass(frozen=True, eq=False)
class _Fit:
    likelihood: float  # log, up to a constant
    slopes: np.ndarray  # (J,) measured over modelled torque
    carries: np.ndarray  # (J,) bool: the model explains most of what nothing else does


@dataclass(frozen=True, eq=False)
class _Log:
    """Moments of a log: positions and their differences in its own unit, torques."""

    q: np.ndarray  # (M, J)
    dq: np.ndarray
    ddq: np.ndarray
    tau: np.ndarray
    independent: float  # readings

    @classmethod
    def of(cls, time: np.ndarray, position: np.ndarray, effort: np.ndarray) -> _Log | None:
        """Evenly sampled and differentiated; None of a log that is too short for it."""
        step = float(np.median(np.diff(time)))
        if not step > 0.0:
            return None
        grid, q, _ = even(time, position)
        _, tau, _ = even(time, effort)
        window = max(5, 2 * round(0.5 * _SMOOTHED_S / step) + 1)
        if len(grid) < 4 * window:
            return None
        smooth = [
            savgol_filter(q, window, 3, deriv=order, delta=step, axis=0)[window:-window] for order in range(3)
        ]
        tau = savgol_filter(tau, window, 3, axis=0)[window:-window]
        keep = np.unique(np.linspace(0, len(tau) - 1, _MOMENTS).astype(int))
        count = min(len(keep), _PER_SECOND * (grid[-1] - grid[0]))
        return cls(*(block[keep] for block in (*smooth, tau)), independent=float(count))

    def against(
        self, arm: RigidArm, factor: float, exchanged: tuple[int, int] | None = None, weighs: bool = True
    ) -> _Fit:
        """The torques as the model's (`weighs`: with gravity's), the joint's own friction, and an offset."""
        order = list(range(self.q.shape[1]))
        if exchanged is not None:
            a, b = exchanged
            order[a], order[b] = order[b], order[a]
        q, dq, ddq = (factor * block[:, order] for block in (self.q, self.dq, self.ddq))
        modelled, tau = arm.inverse_dynamics(q, dq, ddq), self.tau[:, order]
        modelled = modelled if weighs else modelled - arm.gravity(q)
        likelihood, slopes, carries = 0.0, np.zeros(len(order)), np.zeros(len(order), dtype=bool)
        for j in range(len(order)):
            speed = dq[:, j]
            turns = np.tanh(speed / max(0.1 * float(np.abs(speed).max()), 1e-12))
            own = np.column_stack([np.ones_like(speed), speed, turns])
            floor = (_FLOOR * float(np.ptp(tau[:, j]))) ** 2 + 1e-12
            left = _left(own, tau[:, j])
            rest = _left(own, modelled[:, j])
            pull = float(rest @ rest)
            slopes[j] = float(rest @ left) / pull if pull > 1e-9 else 0.0
            after = left - slopes[j] * rest
            carries[j] = 1.0 - float(after @ after) / max(float(left @ left), 1e-12) > _CARRIES
            carries[j] &= float(np.mean(left**2)) > floor
            as_is = left - rest  # in N m, with nothing to choose
            likelihood -= 0.5 * self.independent * float(np.log(np.mean(as_is**2) + floor))
        return _Fit(likelihood, slopes, carries)


def _left(columns: np.ndarray, y: np.ndarray) -> np.ndarray:
    """What is left of y by least squares on the columns."""
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
    return y - scaled @ np.linalg.lstsq(scaled, y, rcond=None)[0]
