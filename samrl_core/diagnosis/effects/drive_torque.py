"""Torque that is lost between commanded effort and torque sensor, at one joint or at all of an arm."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, lacks_drive_torque
from samrl_core.diagnosis.effects.form import Form, Place, Shape
from samrl_core.diagnosis.residuals.basis_functions import SIGN_SPEEDS
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

WIDEST = 0.2  # of the fastest motion: a wider turn of the sign is viscous friction under another name
COMMON = 2.0 / 3.0  # of the joints that must show what is said of all
USUAL_TURN = 0.005  # [rad/s] of a sign at an arm's speeds
FAST = 1.2  # [rad/s] beyond an arm's speeds, where frictions may turn more slowly too
TRAVEL_UNITS = 3.0  # of a slide's travel: each counts as a radian
RIPPLES = 15.0  # [1/rad] order of a turning joint from which on a torque that repeats is called ripple
REPEATED = 3.0  # periods within a slide's travel, likewise
BEYOND = 3.0  # tolerances; a background of twice the tolerances is none
LEAST_BEND = 1.5e-4  # [rad] that encoders of arms resolve


class DriveEffect(Effect):
    """An effect that acts in the drives."""

    acts_on = "dynamics"

    def why_unobservable(self, trial: Trial) -> str | None:
        """Needs the commanded effort."""
        return lacks_drive_torque(trial)


class DriveForm(Form):
    """A torque lost in the drive of each joint of the place."""

    @abstractmethod
    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        """Lost torque (p, F) per unit amplitude at full rate."""

    @abstractmethod
    def spread(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        """Prior standard deviations (p,) of the amplitudes around zero."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        """Lost torque in the drive equation; rows of the first joint, then of the second, ..."""
        return lose_torque(trial, self.place, lambda j: self.torque(trial, j, shape))

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Centred on no effect."""
        spread = np.concatenate([self.spread(trial, j, shape) for j in self.place.joints])
        return np.zeros(len(spread)), spread


def least_bend(trial: Trial, joints: tuple[int, ...]) -> float:
    """Distance [rad] over which a friction must build up to be told from one that jumps.

    Less than a step of the encoder is not seen: sizes of steps within which a reading stays as it is.
    """
    return max(LEAST_BEND, float(np.max(trial.motion.reading_step[list(joints)], initial=0.0)))


@dataclass(frozen=True)
class Shaft:
    """A shaft that turns with the sum or the difference of two joints."""

    name: str
    first: int
    second: int
    sign: float


@dataclass(frozen=True, eq=False, kw_only=True)
class ShaftForm(Form):
    """A friction of one amplitude per joint, which may also act on one shaft that turns with two joints."""

    shaft: Shaft | None = None

    @abstractmethod
    def friction(self, trial: Trial, speed: np.ndarray, shape: Shape) -> np.ndarray:
        """Lost torque (F,) per unit amplitude at a speed (F,)."""

    @abstractmethod
    def spread(self, trial: Trial, joint: int) -> float:
        """Prior standard deviation of a joint's amplitude around zero."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        """Rows of the joints, then that of the shaft."""
        speed = trial.motion.sure_velocity
        out = lose_torque(trial, self.place, lambda j: self.friction(trial, speed[:, j], shape)[None])
        if self.shaft is None:
            return out
        first, second, sign = self.shaft.first, self.shaft.second, self.shaft.sign
        lost = self.friction(trial, speed[:, first] + sign * speed[:, second], shape)[None]
        out = {key: np.pad(rows, ((0, 1), (0, 0))) for key, rows in out.items()}
        for j, direction in ((first, 1.0), (second, sign)):
            for key, rows in trial.drive(j, direction * lost).items():
                out[key][-1:] = rows
        return out

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Centred on no effect; the shaft is as likely as the joint behind it."""
        joints = [*self.place.joints, *([] if self.shaft is None else [self.shaft.second])]
        return np.zeros(len(joints)), np.array([self.spread(trial, j) for j in joints])

    def with_shafts(self, trial: Trial) -> tuple[ShaftForm, ...]:
        """The form alone, and with each further shaft of the wrist."""
        return (
            self,
            *(
                replace(self, name=f"{self.name} coupled {s.name}".strip(), shaft=s)
                for s in wrist_shafts(trial)
            ),
        )


def lose_torque(trial: Trial, place: Place, torque: Callable[[int], np.ndarray]) -> Columns:
    """Columns of torques (p, F) of each joint of a place; rows of the first joint, then of the second, ..."""
    out: Columns = {}
    for i, j in enumerate(place.joints):
        for key, rows in trial.drive(j, torque(j)).items():
            out[key] = np.zeros((len(rows) * len(place.joints), rows.shape[1]))
            out[key][i * len(rows) : (i + 1) * len(rows)] = rows
    return out


def unknown_torque(trial: Trial, joint: int) -> float:
    """What the drive's torque may be off by within tolerances [N m]."""
    return _of_scale(trial.recording.arm.tolerances.torque_offset, trial, joint)


def unknown_friction(trial: Trial, joint: int) -> float:
    """What a joint's dry friction may be off by within tolerances [N m]."""
    return _of_scale(trial.recording.arm.tolerances.coulomb_friction, trial, joint)


def _of_scale(share: float | tuple[float, ...], trial: Trial, joint: int) -> float:
    """A tolerance, one or one for each joint, as a torque [N m]."""
    return float(np.broadcast_to(share, (trial.joints,))[joint] * trial.scale[joint])


def wrist_shafts(trial: Trial) -> tuple[Shaft, ...]:
    """Shafts that gears of a wrist may share: neighbours among the last three joints, sum and difference.

    Only where the torque is the motors' own: a link-side sensor sits behind the coupling.
    """
    names = trial.recording.arm.joints
    if len(names) < 4 or "dynamics" not in trial.channels:
        return ()
    last = len(names) - 1
    return tuple(
        Shaft(f"{names[a]}{sign}{names[a + 1]}", a, a + 1, 1.0 if sign == "+" else -1.0)
        for a in (last - 2, last - 1)
        for sign in "+-"
    )


def are_possible(
    place: Place, amplitudes: np.ndarray, beyond_nominal: Callable[[int], float], stated: np.ndarray
) -> bool:
    """Whether sizes (J,) on top of what the model states (J,) leave friction, or one in all is left out."""
    least = stated[list(place.joints)]
    if len(place.joints) == 1:
        return bool(amplitudes[0] > -least[0])
    if are_positive(place, amplitudes, beyond_nominal):
        return True
    own = amplitudes[: len(least)]
    return bool(np.all(own > -least) and are_positive(place, -amplitudes, beyond_nominal))


def are_positive(place: Place, amplitudes: np.ndarray, beyond_nominal: Callable[[int], float]) -> bool:
    """Whether sizes (J,) of one amplitude per joint are positive and, at an arm's joints, common.

    Common: beyond the tolerances at two joints in three, and against the motion at none. So a single bad
    joint among good ones is never called the arm's. `beyond_nominal` is the size from which a joint counts.
    """
    joints = place.joints
    if len(joints) == 1:
        return bool(amplitudes[0] > 0)
    least = np.array([beyond_nominal(j) for j in joints])
    own, shaft = amplitudes[: len(joints)], amplitudes[len(joints) :]
    common = np.count_nonzero(own > least) >= max(2, COMMON * len(joints))
    little = max(float(np.median(least)), 0.1 * float(np.median(own)))
    return bool(common and np.min(own) > -little and np.all(shaft > np.min(least)))


def name_sizes(
    trial: Trial, place: Place, name: str, amplitudes: np.ndarray, shaft: Shaft | None = None
) -> dict[str, float]:
    """Parameters by name; of an arm with the joint's name, or both of a shaft, in brackets."""
    if len(place.joints) == 1:
        return {name: float(amplitudes[0])}
    where = [trial.recording.arm.joints[j] for j in place.joints]
    if shaft is not None:
        where.append(shaft.name)
    return {f"{name}[{w}]": float(a) for w, a in zip(where, amplitudes, strict=True)}


def track_joints(trial: Trial, place: Place, error: Callable[[int], np.ndarray]) -> Columns:
    """Columns of tracking errors (p, N) of each joint; rows of the first joint, then of the second, ..."""
    out: Columns = {}
    for i, j in enumerate(place.joints):
        own = error(j)
        rows = np.zeros((len(place.joints) * len(own), len(trial)))
        rows[i * len(own) : (i + 1) * len(own)] = own
        out |= trial.tracking(j, rows)
    return out


def fastest_motion(trial: Trial, joints: tuple[int, ...]) -> float:
    """Speed [rad/s] of the fastest of some joints in the system's recordings."""
    return float(np.max(trial.fastest[list(joints)]))


def travel_unit(trial: Trial, joint: int) -> float:
    """1 for a joint that turns; of one that slides the travel [m] that counts as a radian."""
    assert trial.rigid is not None
    if not trial.rigid.slides[joint]:
        return 1.0
    return max(float(trial.travel[joint]) / TRAVEL_UNITS, 1e-3)


def least_ripple_order(trial: Trial, joint: int) -> float:
    """Order [1/rad, 1/m] from which on a torque that repeats with the position is called gear ripple.

    A slide has no turn to count by, and its drive turns many times within its travel: what repeats there
    again and again comes from teeth, poles or a screw.
    """
    assert trial.rigid is not None
    if not trial.rigid.slides[joint]:
        return RIPPLES
    return 2.0 * np.pi * REPEATED / (TRAVEL_UNITS * travel_unit(trial, joint))


def widest_turn(trial: Trial, joints: tuple[int, ...], most: float) -> float:
    """Width [rad/s] up to which a turn of the sign is one, for the speeds that were reached."""
    fastest = fastest_motion(trial, joints)
    return float(np.clip(max(min(WIDEST * fastest, most), 0.25 * WIDEST * fastest), 0.008, 3.0 * most))


def turn_widths(widest: float) -> tuple[float, ...]:
    """Widths [rad/s] of a sign's turn from which a search begins, below the widest.

    What turns in 0.02 rad/s on an arm turns in a hundredth of the speed on a fast machine: its search must
    begin as near.
    """
    wider, width = list(SIGN_SPEEDS), 3.0 * SIGN_SPEEDS[-1]
    while width <= 0.7 * widest:
        wider.append(width)
        width *= 3.0
    return tuple(width for width in wider if width < widest)


def usual_turns(trial: Trial, joints: tuple[int, ...]) -> tuple[float, ...]:
    """Widths [rad/s] of a sign's turn to begin with where another shape is searched beside it.

    Whatever the machine, one of them is wide: where the sign turns more slowly than the sharpest, a level
    beside waves comes out negative, which no friction is, and the search would not begin. Torques by the law
    and fast motors need one between the two.
    """
    fastest = fastest_motion(trial, joints)
    narrow, wide = min(USUAL_TURN, 0.015 * fastest), 0.015 * fastest
    wider = min(4.0 * wide, 0.8 * widest_turn(trial, joints, 0.1))
    if trial.motion.computed or fastest >= FAST:
        return narrow, wide, wider
    return narrow, wider
