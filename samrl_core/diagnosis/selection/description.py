"""Errors of the description, looked for before any effect: joints in another order, torques in another unit.

Such an error makes most of the nominal model's torque wrong, and no effect of a machine does that at every
joint. It is told by trying: the motion is the log's, the columns are exchanged or the torques converted, and
what remains of the equation of torques is compared, after each joint was given an offset and friction of its
own. One hypothesis must leave a small part of what the description as it stands leaves, and much less than
any other. The diagnosis then goes on with the corrected recordings.

At one joint alone it may be a unit, a gear's ratio, a sign, or a direction of turning.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations
from typing import Protocol

import numpy as np

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.result import HeldOutGap, NamedEffect, ParameterEstimate

GROSS = 0.12  # share of the torque's variance that a right description hardly leaves
EXPLAINS = 0.3  # of what the description leaves, that a hypothesis may leave
ONE_JOINT = 0.5  # the same of one joint, from where on it is tried alone
FAR = 3.0  # a factor of torques that no drive is off by
OF_MODEL = 0.03  # of a fitted factor: ASSUMPTION, what masses and inertias are off by
NEAR_UNIT = 0.2  # of a factor, within which it is a unit's
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


class WrongDescription(Protocol):
    """An error of the description that recordings show, and what they fit instead."""

    @property
    def family(self) -> str:
        """Under which it is named."""
        ...

    @property
    def says(self) -> str:
        """What holds instead, to follow "this log fits if"."""
        ...

    @property
    def before(self) -> float:
        """Share of the torque's power that contradicts the description, on fitted recordings."""
        ...

    @property
    def after(self) -> float:
        """And that is left once it is corrected."""
        ...

    def corrected(self, recording: ArmRecording) -> ArmRecording:
        """The recording and its description without the error."""
        ...

    def named(self, arm: str, joints: Sequence[str]) -> tuple[NamedEffect, ...]:
        """As effects of the report."""
        ...

    def gap(self, trials: Sequence[Trial]) -> HeldOutGap | None:
        """How far the gap shrinks on recordings that were not looked at; None where none shows the error."""
        ...


@dataclass(frozen=True)
class Misdescription:
    """What a log fits: joints in another order, torques in another unit, or one that turns the other way."""

    family: str  # joint_order or unit_error
    order: tuple[int, ...]  # column of the log that belongs to each joint
    factor: float  # from the logged torque to N m
    says: str
    before: float  # share of the torque's variance that is left, on fitted recordings; beside friction where
    after: float  # that hides a joint's own
    joint: int = -1  # whose torque has the factor; all
    turned: bool = False  # and whose motion is counted the other way round
    unsure: tuple[float, float] = (0.0, 0.0)  # of the factor, relative; none of a unit's

    def corrected(self, recording: ArmRecording) -> ArmRecording:
        """The recording as the description means it."""
        factors, turns = np.full(len(self.order), self.factor), np.ones(len(self.order))
        if self.joint >= 0:
            factors = np.where(np.arange(len(factors)) == self.joint, self.factor, 1.0)
            turns[self.joint] = -1.0 if self.turned else 1.0

        def mended(signal: JointSignal | None) -> JointSignal | None:
            return None if signal is None else _corrected(signal, self.order, factors, turns)

        states, enabled = mended(recording.states), recording.torque_enabled
        assert states is not None
        return replace(
            recording,
            states=states,
            command=mended(recording.command),
            commanded_effort=mended(recording.commanded_effort),
            torque_enabled=enabled and _corrected(enabled, self.order, np.ones(len(factors)), turns),
        )

    def named(self, arm: str, joints: Sequence[str]) -> tuple[NamedEffect, ...]:
        """As an effect of the report."""
        if self.family == "unit_error":
            low, high = sorted(self.factor * (1.0 + x) for x in self.unsure)
            sizes = {"factor": ParameterEstimate(self.factor, "1", (low, high))}
        else:
            # Which joint's columns stand under this name, counted from 1.
            sizes = {
                f"column[{joints[j]}]": ParameterEstimate(k + 1.0, "1", (k + 1.0, k + 1.0))
                for j, k in enumerate(self.order)
                if j != k
            }
        certain = float(np.clip(1.0 - self.after / max(self.before, 1e-9), 0.0, 0.99))
        place = f"arm:{arm}" if self.joint < 0 else f"joint:{joints[self.joint]}"
        return (NamedEffect(self.family, place, certain, sizes, 0.0, "", "primary"),)

    def gap(self, trials: Sequence[Trial]) -> HeldOutGap | None:
        """How far the torque residual shrinks on recordings that were not looked at."""
        if not trials:
            return None
        joints = tuple(range(trials[0].joints))
        before = float(np.sqrt(_left(trials, joints, 1.0)))
        if self.joint >= 0:
            own = [self.corrected(trial.recording) for trial in trials]
            trials = [Trial(each, trial.rigid) for each, trial in zip(own, trials, strict=True)]
            after = float(np.sqrt(_left(trials, joints, 1.0)))
        else:
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
    whole = left_at_joints(trials, same, np.ones(len(same)), np.ones(len(same)))
    before = float(np.mean(whole))
    if before < GROSS:
        return _clearest(_at_one_joint(trials, whole))
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
    return _clearest(tried) or _clearest(_at_one_joint(trials, whole))


def _clearest(tried: list[tuple[float, Misdescription]]) -> Misdescription | None:
    """The one of these hypotheses, with what each leaves, that leaves little and clearly less than others."""
    if not tried:
        return None
    tried.sort(key=lambda item: item[0])
    left, best = tried[0]
    second = tried[1][0] if len(tried) > 1 else best.before
    if left > EXPLAINS * best.before or left > GROSS or left > CLEARLY * min(second, best.before):
        return None
    return replace(best, after=left)


def _at_one_joint(trials: Sequence[Trial], whole: np.ndarray) -> list[tuple[float, Misdescription]]:
    """Hypotheses of one joint each, of those that stand out, with what they leave there.

    What they change at other joints counts too.

    Its torques in another unit or with the other sign, its motion counted the other way round, or, where no
    unit is near, torques of the other side of a gear. Where friction is most of a joint's torque, its share
    hides the rest: such a joint is compared beside its friction.

    Args:
        trials: fitted recordings.
        whole: (J,) what the description leaves.
    """
    out: list[tuple[float, Misdescription]] = []
    same, once = tuple(range(len(whole))), np.ones(len(whole))
    beside = left_at_joints(trials, same, once, once, beside_friction=True)
    for j in np.flatnonzero(beside > ONE_JOINT).tolist():
        if not all(_has_torque(trial, j) for trial in trials):
            continue
        name, mine = trials[0].recording.arm.joints[j], np.arange(len(whole)) == j
        hidden = bool(whole[j] <= ONE_JOINT)
        stands = beside if hidden else whole
        tried = [(f, False, f"the torques of {name} are in {unit}") for unit, f in UNITS.items()]
        if len(whole) == 1:  # that is asked of all joints
            tried = []
        tried += [
            (1 / f, False, f"the torques of {name} are {1 / f:.4g} times too small") for f in (1e-3, 1e-2)
        ]
        tried += [
            (-1.0, False, f"the torques of {name} have the other sign"),
            (-1.0, True, f"{name} turns the other way round"),
            (1.0, True, f"the positions of {name} have the other sign"),
        ]
        geared = _best_factor(trials, j)
        if abs(geared) > FAR and all(
            abs(geared / f - 1.0) > NEAR_UNIT for f, turned, _ in tried if not turned
        ):
            tried.append((geared, False, f"the torques of {name} are before a gear of {geared:.3g}"))
        for factor, turned, says in tried:
            turns = np.where(mine, -1.0, 1.0) if turned else once
            shares = left_at_joints(trials, same, np.where(mine, factor, 1.0), turns, beside_friction=hidden)
            left = max(0.0, float(np.sum(shares) - np.sum(stands[~mine])))
            unsure = (-OF_MODEL, OF_MODEL) if factor == geared else (0.0, 0.0)
            made = Misdescription("unit_error", same, factor, says, float(stands[j]), 0.0, j, turned, unsure)
            out.append((left, made))
    return out


def _has_torque(trial: Trial, joint: int) -> bool:
    """Whether a joint's torque was recorded as such: a law's is none, a voltage's falls with the speed."""
    controller = trial.motion.controller
    if trial.motion.computed:
        return False
    if trial.motion.tau is not None or controller is None or controller.law.after_back_emf:
        return True
    return float(controller.law.of_joints("back_emf", trial.joints)[joint]) == 0.0


def _best_factor(trials: Sequence[Trial], joint: int) -> float:
    """Factor of a joint's torque that leaves least, with an offset and friction of its own."""
    moment = power = 0.0
    for trial in trials:
        logged, model, dq = _torques(trial, range(trial.joints), np.ones(trial.joints))
        basis = _friction_basis(dq[:, joint])
        free = [
            x - basis @ np.linalg.lstsq(basis, x, rcond=None)[0] for x in (logged[:, joint], model[:, joint])
        ]
        moment, power = moment + float(free[0] @ free[1]), power + float(free[0] @ free[0])
    return moment / max(power, 1e-300)


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
    return float(np.mean(left_at_joints(trials, order, np.full(len(order), factor), np.ones(len(order)))))


def left_at_joints(
    trials: Sequence[Trial],
    order: Sequence[int],
    factors: np.ndarray,
    turns: np.ndarray,
    beside_friction: bool = False,
) -> np.ndarray:
    """The same of each joint (J,), mean over recordings.

    Args:
        trials: fitted recordings.
        order: column of the log that belongs to each joint.
        factors: (J,) of the torques.
        turns: (J,) 1, or -1 of joints that turn the other way.
        beside_friction: shares of the torque that no offset and friction explain, and not of all of it.
    """
    shares = np.zeros((len(trials), len(order)))
    for t, trial in enumerate(trials):
        logged, model, dq = _torques(trial, order, turns)
        logged = factors * logged
        for j in range(trial.joints):
            basis = _friction_basis(dq[:, j])
            both = np.stack([logged[:, j], model[:, j]], axis=1)
            free = both - basis @ np.linalg.lstsq(basis, both, rcond=None)[0]
            rest = free[:, 0] - free[:, 1]
            # In units of the larger of both: a tiny torque leaves no more than all of the model's.
            whole = max(1e-12, *np.var(free if beside_friction else both, axis=0))
            shares[t, j] = min(1.0, float(np.mean(rest**2)) / whole)
    return np.mean(shares, axis=0)


def _torques(
    trial: Trial, order: Sequence[int], turns: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Logged torque, the model's, and velocity (n, J) of some samples."""
    motion, rigid, columns = trial.motion, trial.rigid, list(order)
    torque = motion.tau if motion.tau is not None else motion.u
    assert rigid is not None and torque is not None
    some = slice(None, None, max(1, len(motion.q) // SAMPLES))
    q, dq, ddq = (turns * x[some][:, columns] for x in (motion.q, motion.dq, motion.ddq))
    model = rigid.inverse_dynamics(q, dq, ddq)
    if motion.tau is None:
        model = model + trial.rotor * ddq
    return torque[some][:, columns], model, dq


def _friction_basis(velocity: np.ndarray) -> np.ndarray:
    """Offset and friction (n, 3) of a joint, each of length one."""
    basis = np.stack([np.ones(len(velocity)), np.tanh(velocity / TURN), velocity], axis=1)
    return basis / (np.linalg.norm(basis, axis=0) + 1e-300)


def _corrected(
    signal: JointSignal, order: Sequence[int], factors: np.ndarray, turns: np.ndarray
) -> JointSignal:
    columns = list(order)

    def moved(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else turns * values[:, columns]

    effort = None if signal.effort is None else factors * signal.effort[:, columns]
    return replace(
        signal,
        position=moved(signal.position),
        velocity=moved(signal.velocity),
        acceleration=moved(signal.acceleration),
        effort=effort,
        filtered_velocity=moved(signal.filtered_velocity),
    )
