"""Errors of the description, looked for before any effect: joints in another order, torques in another unit.

Such an error makes most of the nominal model's torque wrong, and no effect of a machine does that at every
joint. It is told by trying: the motion is the log's, the columns are exchanged or the torques converted, and
what remains of the equation of torques is compared, after each joint was given an offset and friction of its
own. One hypothesis must leave a small part of what the description as it stands leaves, and much less than
any other. The diagnosis then goes on with the corrected recordings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations

import numpy as np

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.result import HeldOutGap, NamedEffect, ParameterEstimate

GROSS = 0.12  # share of the torque's variance that a right description hardly leaves
EXPLAINS = 0.3  # of what the description leaves, that a hypothesis may leave
CLEARLY = 0.5  # of what the next hypothesis leaves, likewise
SAMPLES = 300  # per recording
ALL_ORDERS = 4  # joints up to which every order is tried; beyond, exchanges, shifts and the reverse
UNITS = {  # N m (or N) per unit
    "N cm": 0.01,
    "N mm or mN m": 0.001,
    "kgf m": 9.80665,
    "kgf cm": 0.0980665,
    "lbf ft": 1.355818,
    "lbf in": 0.1129848,
    "ozf in": 0.00706155,
}
TURN = 0.01  # [rad/s or m/s] over which friction turns its sign


@dataclass(frozen=True)
class Misdescription:
    """What a log fits: joints in another order, or torques in another unit."""

    family: str  # joint_order or unit_error
    order: tuple[int, ...]  # column of the log that belongs to each joint
    factor: float  # from the logged torque to N m
    says: str
    before: float  # share of the torque's variance that is left, on fitted recordings
    after: float

    def corrected(self, recording: ArmRecording) -> ArmRecording:
        """The recording as the description means it."""
        return replace(
            recording,
            states=_corrected(recording.states, self.order, self.factor),
            command=None if recording.command is None else _corrected(recording.command, self.order, 1.0),
            commanded_effort=None
            if recording.commanded_effort is None
            else _corrected(recording.commanded_effort, self.order, self.factor),
            torque_enabled=None
            if recording.torque_enabled is None
            else _corrected(recording.torque_enabled, self.order, 1.0),
        )

    def named(self, arm: str, joints: Sequence[str]) -> NamedEffect:
        """As an effect of the report."""
        if self.family == "unit_error":
            sizes = {"factor": ParameterEstimate(self.factor, "1", (self.factor, self.factor))}
        else:
            # Which joint's columns stand under this name, counted from 1.
            sizes = {
                f"column[{joints[j]}]": ParameterEstimate(k + 1.0, "1", (k + 1.0, k + 1.0))
                for j, k in enumerate(self.order)
                if j != k
            }
        certain = float(np.clip(1.0 - self.after / max(self.before, 1e-9), 0.0, 0.99))
        return NamedEffect(self.family, f"arm:{arm}", certain, sizes, 0.0, "", "primary")

    def gap(self, trials: Sequence[Trial]) -> HeldOutGap | None:
        """How far the torque residual shrinks on recordings that were not looked at."""
        if not trials:
            return None
        joints = tuple(range(trials[0].joints))
        before = float(np.sqrt(_left(trials, joints, 1.0)))
        after = float(np.sqrt(_left(trials, self.order, self.factor)))
        share = 1.0 - after / before if before > 0 else 0.0
        return HeldOutGap(
            "residual torque along the log over the torque, RMS over joints", "1", before, after, None, None,
            share, None, None, (), tuple(t.recording.name for t in trials),
        )  # fmt: skip


def misdescription(trials: Sequence[Trial]) -> Misdescription | None:
    """The error of the description that these recordings show; None where there is none or no clear one."""
    first = trials[0]
    if first.rigid is None or not ({"link", "dynamics"} & set(first.channels)):
        return None
    same = tuple(range(first.joints))
    before = _left(trials, same, 1.0)
    if before < GROSS:
        return None
    joints = first.recording.arm.joints
    tried = [
        (
            _left(trials, order, 1.0),
            Misdescription("joint_order", order, 1.0, _order_text(joints, order), before, 0.0),
        )
        for order in _orders(first.joints)
    ]
    tried += [
        (
            _left(trials, same, f),
            Misdescription("unit_error", same, f, f"its torques are in {unit}", before, 0.0),
        )
        for unit, f in UNITS.items()
    ]
    if not tried:
        return None
    tried.sort(key=lambda item: item[0])
    left, best = tried[0]
    second = tried[1][0] if len(tried) > 1 else before
    if left > EXPLAINS * before or left > GROSS or left > CLEARLY * min(second, before):
        return None
    return replace(best, after=left)


def _orders(count: int) -> list[tuple[int, ...]]:
    same = tuple(range(count))
    if count <= ALL_ORDERS:
        return [order for order in permutations(same) if order != same]
    out = {same[::-1], same[1:] + same[:1], same[-1:] + same[:-1]}
    for a, b in combinations(same, 2):
        swapped = list(same)
        swapped[a], swapped[b] = b, a
        out.add(tuple(swapped))
    return sorted(out)


def _order_text(joints: Sequence[str], order: tuple[int, ...]) -> str:
    moved = [j for j, k in enumerate(order) if j != k]
    if len(moved) == 2:
        return f"{joints[moved[0]]} and {joints[moved[1]]} are exchanged"
    return "its columns are those of " + ", ".join(joints[order.index(k)] for k in range(len(order)))


def _left(trials: Sequence[Trial], order: Sequence[int], factor: float) -> float:
    """Share of the torque's variance, mean over joints, that inverse dynamics, offsets and friction leave."""
    columns = list(order)
    shares = []
    for trial in trials:
        motion, rigid = trial.motion, trial.rigid
        torque = motion.tau if motion.tau is not None else motion.u
        assert rigid is not None and torque is not None
        some = slice(None, None, max(1, len(motion.q) // SAMPLES))
        q, dq, ddq = (x[some][:, columns] for x in (motion.q, motion.dq, motion.ddq))
        logged = factor * torque[some][:, columns]
        model = rigid.inverse_dynamics(q, dq, ddq)
        if motion.tau is None:
            model = model + trial.rotor * ddq
        for j in range(trial.joints):
            basis = np.stack([np.ones(len(dq)), np.tanh(dq[:, j] / TURN), dq[:, j]], axis=1)
            scale = np.linalg.norm(basis, axis=0) + 1e-300
            rest = logged[:, j] - model[:, j]
            rest = rest - basis / scale @ np.linalg.lstsq(basis / scale, rest, rcond=None)[0]
            # In units of the larger of both: a tiny torque leaves no more than all of the model's.
            whole = max(float(np.var(logged[:, j])), float(np.var(model[:, j])), 1e-12)
            shares.append(min(1.0, float(np.mean(rest**2)) / whole))
    return float(np.mean(shares))


def _corrected(signal: JointSignal, order: Sequence[int], factor: float) -> JointSignal:
    columns = list(order)

    def moved(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else values[:, columns]

    effort = moved(signal.effort)
    return replace(
        signal,
        position=moved(signal.position),
        velocity=moved(signal.velocity),
        acceleration=moved(signal.acceleration),
        effort=None if effort is None else factor * effort,
    )
