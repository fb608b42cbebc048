"""Numbers that look like another unit: degrees for radians, millimetres for metres, rpm, milliseconds.

What cannot be otherwise is refused; the rest is said. Nothing is converted in silence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.robots.urdf_text import parse_urdf
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.recordings.motion_check import LEAST_RANGE, derivative, smooth
from samrl_core.diagnosis.recordings.turns import find_wraps

DEGREES = 180.0 / np.pi
_BEYOND = 0.2  # [rad or m] over a limit before units are suspected: offsets and soft limits are smaller
_BEYOND_EFFORT = 3.0  # times the limit, rms: peaks may be above a continuous rating, the whole run is not
_SHARE = 0.01  # of samples
_CLEAR = 0.9  # correlation above which a ratio of two channels means something
_UNLIKE = 0.5  # correlation below which they are not the same thing
_VELOCITY_FACTORS = {
    DEGREES: "velocity in deg/s, or position in turns of rad",
    30.0 / np.pi: "velocity in rpm",
    1000.0: "velocity in mm/s or mrad/s, or the time in milliseconds",
    1.0 / DEGREES: "position in degrees beside velocity in rad/s",
    1e-3: "position in mm beside velocity in m/s, or the time in milliseconds",
    1e-6: "the time in microseconds",
}
_COMMAND_FACTORS = {
    DEGREES: "the command in degrees, the states in radians",
    1.0 / DEGREES: "the states in degrees, the command in radians",
    1000.0: "the command in mm (or mrad), the states in m (or rad)",
    1e-3: "the states in mm (or mrad), the command in m (or rad)",
}
_TURN = 2.0 * np.pi
_NEAR_TURN = 0.1  # relative, by which a ratio may miss a turn's: what sags below its command does by 4 %
_APART = 4.0  # times, beyond which a command is no set point of what moves with it


@dataclass(frozen=True)
class AxisKind:
    """What a URDF says of a joint; limits are infinite where it states none."""

    prismatic: bool
    lower: float
    upper: float


def joint_kinds(urdf: str) -> dict[str, AxisKind]:
    """Of the moving joints by name. Raises `InputError` if the text is no XML."""
    root = parse_urdf(urdf, "the URDF")
    kinds = {}
    for joint in root.findall("joint"):
        limit = joint.find("limit")
        lower = float(limit.get("lower", "-inf")) if limit is not None else -np.inf
        upper = float(limit.get("upper", "inf")) if limit is not None else np.inf
        if joint.get("type") == "continuous" or lower == upper == 0.0:
            lower, upper = -np.inf, np.inf
        kinds[str(joint.get("name"))] = AxisKind(joint.get("type") == "prismatic", lower, upper)
    return kinds


def limit_notes(where: str, recording: ArmRecording) -> list[str]:
    """Positions against the URDF's limits.

    Raises:
        InputError: far beyond the limits, and within them all as degrees or millimetres.
    """
    q = recording.states.position
    if q is None:
        return []
    joints = recording.arm.joints
    if recording.arm.urdf is None:
        large = [j for j, m in zip(joints, np.abs(q).max(axis=0), strict=True) if m > 4 * np.pi]
        if large:
            reach = np.abs(q).max()
            return [f"positions of {', '.join(large)} reach {reach:.4g}; are they in radians (or metres)?"]
        return []
    kinds = joint_kinds(recording.arm.urdf)
    listed = [kinds.get(j, AxisKind(False, -np.inf, np.inf)) for j in joints]
    lower, upper = np.array([k.lower for k in listed]), np.array([k.upper for k in listed])
    beyond = ((q < lower - _BEYOND) | (q > upper + _BEYOND)).mean(axis=0) > _SHARE
    if not beyond.any():
        return []
    factor = np.where([k.prismatic for k in listed], 1000.0, DEGREES)
    inside = ((q / factor >= lower - _BEYOND) & (q / factor <= upper + _BEYOND)).all()
    worst = int(np.argmax(np.where(beyond, np.abs(q).max(axis=0), 0)))
    unit = "mm" if listed[worst].prismatic else "degrees"
    said = (
        f"position of {joints[worst]} reaches {np.abs(q[:, worst]).max():.4g}, its URDF limits are"
        f" {lower[worst]:.4g} to {upper[worst]:.4g} {'m' if listed[worst].prismatic else 'rad'}"
    )
    span = np.abs([lower[worst], upper[worst]]).max()
    if inside and np.abs(q[:, worst]).max() > 2.0 * span:
        raise InputError(
            f"{where}: {said}; divided by {factor[worst]:.4g} all joints fit, as if it were in {unit}:"
            " convert to SI units (a mapping of `samrl bag import` states the unit)"
            + ("" if listed[worst].prismatic else ", or call a joint that turns on `continuous` in the URDF")
        )
    return [f"{said}; wrong URDF, zero position or unit?"]


def refuse_wraps(where: str, recording: ArmRecording) -> None:
    """Angles that jump by a turn, which a derivative would take for a motion.

    Raises:
        InputError: a measured position does so.
    """
    states = recording.states
    if states.position is None:
        return
    for joint, angles in zip(recording.arm.joints, states.position.T, strict=True):
        jumps = find_wraps(angles, 2.0 * np.pi)
        if len(jumps):
            k = int(jumps[0])
            raise InputError(
                f"{where}: position of {joint} goes from {angles[k]:.4g} to {angles[k + 1]:.4g} rad at"
                f" {states.time[k] - states.time[0]:.4g} s, and so {len(jumps)} times: an angle that wraps"
                " around. Take its turns out: `samrl bag draft` does, in a mapping unwrap(x, 360) of degrees"
            )


def velocity_notes(where: str, recording: ArmRecording) -> list[str]:
    """Recorded velocity against the derivative of position.

    Raises:
        InputError: they agree up to the factor of a unit, or up to the sign.
    """
    states = recording.states
    if states.position is None or states.velocity is None:
        return []
    derived = derivative(states.time, states.position)
    recorded = smooth(states.time, states.velocity)
    moving = np.ptp(states.position, axis=0) > LEAST_RANGE
    notes = []
    for j in np.flatnonzero(moving & (recorded.std(axis=0) > 0)):
        ratio, likeness = _ratio(recorded[:, j], derived[:, j])
        joint = recording.arm.joints[j]
        if abs(likeness) < _UNLIKE:
            notes.append(
                f"velocity of {joint} is not the derivative of its position (correlation {likeness:.2f})"
            )
        if abs(likeness) < _CLEAR:
            continue  # small motion drowned in noise
        said = f"velocity of {joint} is {ratio:.4g} times the derivative of its position"
        if likeness < 0:
            raise InputError(f"{where}: {said}; one of them has the wrong sign, mend it")
        _refuse_factor(where, said, ratio, _VELOCITY_FACTORS, 0.1)
        if not 0.8 < ratio < 1.25:
            notes.append(said + _by_a_turn(ratio, "velocity", "position"))
    return notes


def command_notes(where: str, recording: ArmRecording) -> list[str]:
    """Commanded against measured position.

    Raises:
        InputError: they agree up to the factor of a unit.
    """
    command, states = recording.command, recording.states
    if command is None or command.position is None or states.position is None:
        return []
    notes = []
    for j, joint in enumerate(recording.arm.joints):
        wanted = np.interp(states.time, command.time, command.position[:, j])
        got = states.position[:, j]
        if np.ptp(got) < LEAST_RANGE or np.ptp(wanted) < LEAST_RANGE:
            continue
        ratio, likeness = _ratio(wanted - wanted.mean(), got - got.mean())
        said = f"the command of {joint} is {ratio:.4g} times its measured position"
        if abs(likeness) > _CLEAR:
            _refuse_factor(where, said, ratio, _COMMAND_FACTORS, 0.1)
        if likeness < -_CLEAR:
            notes.append(f"{said}: they move in opposite directions")
        elif likeness > _CLEAR and not 1.0 / _APART < ratio < _APART:
            turns = _by_a_turn(ratio, "command", "states")
            notes.append(f"{said}{turns}; is it in another unit, or before a gear?")
    return notes


def _by_a_turn(ratio: float, one: str, other: str) -> str:
    """What a ratio of a turn's radians, or its inverse, says of two channels; empty for any other."""
    for factor, turns, radians in ((_TURN, other, one), (1.0 / _TURN, one, other)):
        if abs(abs(ratio) / factor - 1.0) < _NEAR_TURN:
            return f", as if {turns} were in revolutions and {radians} in radians"
    return ""


def effort_notes(recording: ArmRecording) -> list[str]:
    """Suspicion where efforts are far beyond what the URDF says the joint can give."""
    if recording.arm.urdf is None:
        return []
    limits = effort_limits(recording.arm.urdf)
    notes = []
    for name, signal in (("effort", recording.states), ("commanded effort", recording.commanded_effort)):
        if signal is None or signal.effort is None:
            continue
        for joint, values in zip(recording.arm.joints, signal.effort.T, strict=True):
            typical, limit = float(np.sqrt(np.mean(values**2))), limits.get(joint, np.inf)
            if typical > _BEYOND_EFFORT * limit:
                notes.append(
                    f"suspected: {name} of {joint} is {typical:.3g} rms, its URDF limit {limit:.4g};"
                    " mN m, motor counts, or another URDF?"
                )
    return notes


def effort_limits(urdf: str) -> dict[str, float]:
    """By joint; infinite where the URDF states none."""
    out = {}
    for joint in parse_urdf(urdf, "the URDF").findall("joint"):
        limit = joint.find("limit")
        value = float(limit.get("effort", "0")) if limit is not None else 0.0
        out[str(joint.get("name"))] = value if value > 0 else np.inf
    return out


def _ratio(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """Factor from b to a by least squares (of both errors alike), and their likeness -1..1."""
    product, aa, bb = float(a @ b), float(a @ a), float(b @ b)
    if aa == 0 or bb == 0:
        return 0.0, 0.0
    return float(np.sign(product) * np.sqrt(aa / bb)), product / np.sqrt(aa * bb)


def _refuse_factor(where: str, said: str, ratio: float, factors: dict[float, str], tolerance: float) -> None:
    for factor, meaning in factors.items():
        if abs(ratio / factor - 1.0) < tolerance:
            raise InputError(f"{where}: {said}, which is {meaning}; convert to SI units")
