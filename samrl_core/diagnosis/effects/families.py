"""Bases of effects that differ only in their formula."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Form, Shape
from samrl_core.diagnosis.effects.packet_age import detail_support
from samrl_core.diagnosis.residuals.basis_functions import low_passed, resonant
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial, add

WIDEST = 0.2  # of the fastest motion: a wider turn of the sign is viscous friction under another name
COMMON = 2.0 / 3.0  # of the joints that must show what is said of all
COUPLED = "coupled"
CUTOFFS = (8.0, 16.0, 24.0, 32.0, 48.0, 64.0, 96.0)  # [Hz] of filters that detail is compared with
DELAYS = np.arange(0.0, 25.1, 0.5)  # [samples] likewise of delays
BEYOND = 3.0  # tolerances; a background of twice the tolerances is none


class DriveTorque(Effect):
    """A torque lost between commanded effort and torque sensor of one joint."""

    acts_on = "dynamics"

    def places(self, trial: Trial) -> tuple[str, ...]:
        """Each joint; for some families also the arm: the same formula at every joint."""
        every = self.at_every_joint and trial.joints > 1
        return super().places(trial) + ((f"arm:{trial.recording.arm.role}",) if every else ())

    @abstractmethod
    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        """Lost torque (p, F) per unit amplitude at full rate."""

    @abstractmethod
    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        """Prior standard deviations (p,) of the amplitudes around zero."""

    def unobservable(self, trial: Trial) -> str | None:
        """Needs the commanded effort."""
        if not ({"drive", "dynamics"} & set(trial.channels)):
            return "needs the commanded effort and a dynamic model"
        return None

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        """Lost torque in the drive equation; rows of the first joint, then of the second, ..."""
        joints = self.joints_at(trial, place)
        out: Columns = {}
        for i, j in enumerate(joints):
            for key, rows in trial.drive(j, self.torque(trial, j, form, shape)).items():
                out[key] = np.zeros((len(rows) * len(joints), rows.shape[1]))
                out[key][i * len(rows) : (i + 1) * len(rows)] = rows
        return out

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Centred on no effect."""
        spread = np.concatenate([self.spread(trial, j, form, shape) for j in self.joints_at(trial, place)])
        return np.zeros(len(spread)), spread

    def beyond_nominal(self, trial: Trial, joint: int) -> float:
        """Size from which a joint counts as having the effect, when all of them are said to have it."""
        return 0.0

    def positive(self, trial: Trial, place: str, amplitudes: np.ndarray) -> bool:
        """Sizes (J,) of a family with one amplitude per joint: positive, and at an arm's joints common.

        Common: beyond the tolerances at two joints in three, and against the motion at none. So a single bad
        joint among good ones is never called the arm's.
        """
        joints = self.joints_at(trial, place)
        if len(joints) == 1:
            return bool(amplitudes[0] > 0)
        least = np.array([self.beyond_nominal(trial, j) for j in joints])
        own, shaft = amplitudes[: len(joints)], amplitudes[len(joints) :]
        common = np.count_nonzero(own > least) >= max(2, COMMON * len(joints))
        little = max(float(np.median(least)), 0.1 * float(np.median(own)))
        return bool(common and np.min(own) > -little and np.all(shaft > np.min(least)))

    def sizes(
        self, trial: Trial, place: str, form: str, name: str, amplitudes: np.ndarray
    ) -> dict[str, float]:
        """Parameters by name; of an arm with the joint's name, or both of a coupled shaft, in brackets."""
        joints = self.joints_at(trial, place)
        if len(joints) == 1:
            return {name: float(amplitudes[0])}
        where = [trial.recording.arm.joints[j] for j in joints]
        if len(amplitudes) > len(joints):
            where.append(form.partition(f"{COUPLED} ")[2])
        return {f"{name}[{w}]": float(a) for w, a in zip(where, amplitudes, strict=True)}


class ShaftFriction(DriveTorque):
    """A friction that may also act on a shaft which turns with two joints of the wrist."""

    @abstractmethod
    def of_shaft(
        self, trial: Trial, first: int, second: int, sign: float, form: str, shape: Shape
    ) -> np.ndarray:
        """Lost torque (p, F) on a shaft that turns with the sum (or difference) of two joints."""

    def coupled_forms(self, trial: Trial, form: Form) -> tuple[Form, ...]:
        """A form at every joint, alone and with one more shaft that turns with two joints of the wrist."""
        return (form, *(replace(form, name=f"{form.name} {COUPLED} {p}".strip()) for p in wrist_pairs(trial)))

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        """Rows of the joints, then those of the shaft."""
        out, pair = super().columns(trial, place, form, shape), coupled_pair(trial, form)
        if pair is None:
            return out
        first, second, sign = pair
        shaft = self.of_shaft(trial, first, second, sign, form, shape)
        out = {key: np.pad(rows, ((0, len(shaft)), (0, 0))) for key, rows in out.items()}
        for j, direction in ((first, 1.0), (second, sign)):
            for key, rows in trial.drive(j, direction * shaft).items():
                out[key][-len(rows) :] = rows
        return out

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """The shaft is as likely as the joint behind it."""
        _, spread = super().prior(trial, place, form, shape)
        if (pair := coupled_pair(trial, form)) is not None:
            spread = np.concatenate([spread, self.spread(trial, pair[1], form, shape)])
        return np.zeros(len(spread)), spread


def wrist_pairs(trial: Trial) -> tuple[str, ...]:
    """Joints of a wrist whose gears may share a shaft: neighbours among the last three, sum and difference.

    Only where the torque is the motors' own: a link-side sensor sits behind the coupling.
    """
    names = trial.recording.arm.joints
    if len(names) < 4 or "dynamics" not in trial.channels:
        return ()
    return tuple(f"{a}{sign}{b}" for a, b in zip(names[-3:-1], names[-2:], strict=True) for sign in "+-")


def coupled_pair(trial: Trial, form: str) -> tuple[int, int, float] | None:
    """First joint, second joint and sign of a coupled form; None for the others."""
    if f"{COUPLED} " not in form:
        return None
    names, text = trial.recording.arm.joints, form.partition(f"{COUPLED} ")[2]
    for sign in "+-":
        for first, second in zip(names[-3:-1], names[-2:], strict=True):
            if text == f"{first}{sign}{second}":
                return names.index(first), names.index(second), 1.0 if sign == "+" else -1.0
    raise ValueError(f"{form} names no two joints of {names}")


def fastest_motion(trial: Trial, joints: tuple[int, ...]) -> float:
    """Speed [rad/s] that a hundredth of the samples exceed."""
    return float(np.quantile(np.abs(trial.motion.full_velocity[:, list(joints)]), 0.99))


def widest_turn(trial: Trial, joints: tuple[int, ...], most: float) -> float:
    """Width [rad/s] up to which a turn of the sign is one, for the speeds that were reached."""
    fastest = fastest_motion(trial, joints)
    return float(np.clip(max(min(WIDEST * fastest, most), 0.25 * WIDEST * fastest), 0.008, 3.0 * most))


class Deflection(Effect):
    """The link trails the joint's reading by an angle."""

    acts_on = "dynamics"
    # What engines and sampling do to fast motion looks like a little give.
    prior_cost = 2.0

    def unobservable(self, trial: Trial) -> str | None:
        """Needs torques."""
        if trial.rigid is None or not ({"link", "dynamics"} & set(trial.channels)):
            if "tracking" in trial.channels and trial.motion.tau is not None:
                return None
            # What a servo commands is its answer to the very error that should be explained by it.
            return "needs a measured torque, not only a commanded one"
        return None


class TorqueDeflection(Deflection):
    """The angle depends on the transmitted torque alone."""

    @abstractmethod
    def angle(self, trial: Trial, joint: int, form: str, shape: Shape, torque: np.ndarray) -> np.ndarray:
        """Deflection (p, N) per unit amplitude [rad] under the transmitted torque (N,) [N m]."""

    by_turns: ClassVar[tuple[str, ...]] = ()  # forms in which the torque's turning points count

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        """Motor-side reading: the link is where its inertia and weight are felt."""
        (joint,) = self.joints_at(trial, place)
        if "tracking" in trial.channels:
            load = trial.motion.tau if trial.motion.tau is not None else trial.motion.u
            assert load is not None
            return trial.tracking(joint, self.angle(trial, joint, form, shape, load[:, joint]))
        fine = trial.transmitted_finely if form in self.by_turns else None
        if fine is None:
            angle = self.angle(trial, joint, form, shape, trial.transmitted[:, joint])
        else:
            angle = trial.from_fine(self.angle(trial, joint, form, shape, fine[:, joint]))
        return trial.link(trial.deflection(joint, angle))

    def line(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> float:
        """Stiffness [N m/rad] of the straight line through what the torque does to the angle."""
        (joint,) = self.joints_at(trial, place)
        torque = trial.transmitted[:, joint]
        angle = amplitudes @ self.angle(trial, joint, form, shape, torque)
        slope = float(np.polyfit(torque - np.mean(torque), angle, 1)[0])
        return 1.0 / max(slope, 1e-12)


class FixedResponse(Effect):
    """An effect that is there or not: its amplitude is one, and only its shape is unknown.

    A small freedom of the amplitude absorbs that a real filter is not exactly of first order.
    """

    freedom = 0.05

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Centred on one."""
        return np.ones(1), np.full(1, self.freedom)

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        """Must be present."""
        return bool(amplitudes[0] > 0.5)


class LateResponse(FixedResponse):
    """What is commanded acts later: the command before the controller, or the torque before the drive."""

    acts_on = "command"
    symbol: ClassVar[str]  # the shape that says how late
    grid: ClassVar[tuple[float, ...]]
    limits: ClassVar[tuple[float, float]]
    tracking_grid: ClassVar[tuple[float, ...]]  # for servos that only log where they are
    tracking_limits: ClassVar[tuple[float, float]] = (1e-3, 50.0)
    variants: ClassVar[tuple[str, ...]] = ("",)  # formulas of the response, of loggers at full rate

    @abstractmethod
    def late(self, trial: Trial, x: np.ndarray, form: str, shape: Shape) -> np.ndarray:
        """A full-rate signal (F, J) as it arrives."""

    def places(self, trial: Trial) -> tuple[str, ...]:
        """Each joint, or all of them alike."""
        return super().places(trial) + (f"arm:{trial.recording.arm.role}",)

    def unobservable(self, trial: Trial) -> str | None:
        """Needs what was asked for and what came of it, fast enough."""
        if trial.motion.command is None and trial.motion.u is None:
            return "needs the command or the commanded effort"
        if not trial.motion.dynamic and trial.motion.rate < 20.0:
            return f"sampled at {trial.motion.rate:.0f} Hz, timing needs 20 Hz"
        if set(trial.channels) <= {"link", "dynamics"}:
            return "needs the command, or both commanded and measured effort"
        return None

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        """By where it acts, as far as the channels show it, and by formula."""
        if "tracking" in trial.channels:
            return (self._form("tracking", self.tracking_grid, self.tracking_limits),)
        low, high = self.limits_at(trial)
        grid = tuple(v for v in self.grid if low < v < high)
        shown = (("controller", "command"), ("drive", "effort"))
        return tuple(
            self._form(f"{name} {variant}".strip(), grid, (low, high))
            for channel, name in shown
            if channel in trial.channels
            for variant in self.variants
        )

    def limits_at(self, trial: Trial) -> tuple[float, float]:
        """Between which the shape is searched, for what the sampling can show."""
        return self.limits

    def _form(self, name: str, grid: tuple[float, ...], limits: tuple[float, float]) -> Form:
        return Form(name, ("present",), tuple({self.symbol: v} for v in grid), {self.symbol: limits})

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        """What is missing while the signal is on its way."""
        parts = []
        motion, command, controller = trial.motion, trial.motion.command, trial.recording.arm.controller
        if form.startswith("effort"):
            assert motion.raw_commanded is not None
            lost = motion.raw_commanded - self.late(trial, motion.raw_commanded, form, shape)
            parts = [trial.drive(j, lost[:, [j]].T) for j in self.joints_at(trial, place)]
        elif command is not None and command.position is not None:
            lost = command.position - self.late(trial, command.position, form, shape)
            if form == "tracking":
                parts = [
                    trial.tracking(j, motion.reduce(lost[:, [j]]).T) for j in self.joints_at(trial, place)
                ]
            else:
                assert controller is not None and command.velocity is not None and command.effort is not None
                lost = controller.stiffness * lost
                slower = command.velocity - self.late(trial, command.velocity, form, shape)
                lost = lost + controller.damping * slower
                lost = lost + command.effort - self.late(trial, command.effort, form, shape)
                parts = [trial.controller(j, lost[:, [j]].T) for j in self.joints_at(trial, place)]
        return add(*parts)

    def cost(self, trials: Sequence[Trial], place: str, form: str, shape: Shape) -> float:
        """What the best response loses of the torque's detail above the compared band, where noise passes.

        There a delay leaves everything as it was and a filter takes it away: within the band both look alike.
        """
        if not form.startswith("effort"):
            return self.prior_cost
        lacks = 0.0
        for trial in trials:
            joints = list(self.joints_at(trial, place))
            mine = np.sum(self._support(trial, form, shape)[joints])
            lacks += max(0.0, max(float(np.sum(x[joints])) for x in _supports(trial)) - float(mine))
        return self.prior_cost + lacks

    def _support(self, trial: Trial, form: str, shape: Shape) -> np.ndarray:
        key = (f"{self.family} {form}", repr(sorted(shape.items())))
        if key not in trial.kept:
            assert trial.motion.raw_commanded is not None
            late = self.late(trial, trial.motion.raw_commanded, form, shape)
            trial.kept[key] = detail_support(trial, late)
        return trial.kept[key]

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        """How late."""
        return {self.symbol: shape[self.symbol]}


def clearest_delay(trial: Trial, joints: Sequence[int]) -> float:
    """The delay [s] that explains most of the torque's detail, to half a sample."""
    supports = [float(np.sum(x[list(joints)])) for x in _supports(trial)[: len(DELAYS)]]
    return float(DELAYS[int(np.argmax(supports))]) / trial.motion.rate


def _supports(trial: Trial) -> list[np.ndarray]:
    """What pure delays and filters of a few sizes explain of the torque's detail, (J,) [nat] each."""
    key = ("supports", "effort")
    if key not in trial.kept:
        motion, u = trial.motion, trial.motion.raw_commanded
        assert u is not None
        late = [motion.delayed(u, d / motion.rate) for d in DELAYS]
        late += [low_passed(u, f, motion.rate) for f in CUTOFFS]
        late += [resonant(u, f, np.sqrt(0.5), 1.0 / motion.rate) for f in CUTOFFS]
        trial.kept[key] = [detail_support(trial, x) for x in late]
    return trial.kept[key]


def single(
    amplitudes: tuple[str, ...], shapes: tuple[Shape, ...] = ({},), **refine: tuple[float, float]
) -> tuple[Form, ...]:
    """The only form of an effect."""
    return (Form("", amplitudes, shapes, refine),)
