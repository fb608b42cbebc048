"""What names of columns say: quantity, unit, measured or commanded, and which part of it names the joint."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

SLOT = "{}"  # where the joint stands in a stem
_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|\{\}")
_TORQUE_UNIT = re.compile(r"(?<![A-Za-z])([mkc]?)N[ ._*-]?(mm|cm|m)(?![A-Za-z])")  # mNm is no m and Nm
_NUMBER = re.compile(r"\d+")
_PRESSURE = re.compile(r"[\[(][kMm]?(?:bar|Pa|psi)[\])]$|_(?:[kM]Pa|mbar|psi)$")
_MICRO = str.maketrans({"\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u"})  # of Zeit [us]
_FEEDBACK = re.compile(r"feed_?back", re.IGNORECASE)  # ABB's feedBack.joints
_COMPOUND = re.compile(r"(soll|ist)([a-z]{3,})")  # German: Sollweg, Istdrehzahl
_ELECTRIC = re.compile(
    r"(?:[\[(]|_)(m?[VA])(?:rms)?(?:[\])]|$)"
)  # unit of a motor's input at the end of a name
_OF_MOTOR = re.compile(r"([VI])_?(?:m|mot|motor)")  # Quanser's Vm

QUANTITIES = {
    "position": "q pos position positions qpos theta angle angles rad radian radians deg degree degrees"
    " counts encoder enc tick ticks winkel drehwinkel weg lage",
    "velocity": "dq dtheta qdot qvel vel velocity velocities speed speeds omega rpm dps drehzahl"
    " geschwindigkeit",
    "acceleration": "ddq ddtheta qddot acc accel acceleration accelerations",
    "effort": "tau trq torque torques effort efforts moment force forces nm mnm knm cnm ncm nmm drehmoment"
    " kraft",
    "current": "current currents cur curr amps amp ampere iq strom",
    "voltage": "voltage voltages volt volts pwm duty spannung",
    "pressure": "pressure pressures druck",
    "temperature": "temperature temp temperatures celsius",
}
COMMANDED = "cmd command commanded commands target targets ref reference desired des goal goals setpoint"
COMMANDED += " dem demand demanded"
COMMANDED += " planned set point action wanted control con d soll sol actions commands setpoints references"
MEASURED = "actual act meas measured feedback state states obs observation present real process value ist"
MEASURED += " sensor msr fb"  # fb: the second half of a drive's PL.CMD and PL.FB
COMPUTED = "error err output residual integral multi last prev previous next computed safened cos sin"
# Of a torque: a share that somebody worked out of it, or its rate.
SHARES = "ext external hat interact interaction gravity g coriolis friction contact disturbance dot rate ff"
SHARES += " feedforward"
ENABLED = frozenset("enable enabled".split())  # whether a drive gives torque: torque_enable
TIME = "t tm time times timestamp timestamps stamp stamps tstamp tstamps sec secs seconds ms us ns clock zeit"
TIME += " duration tout tiempo tempo temps millis micros millisec microsec milliseconds microseconds"
TIME += " msec msecs usec usecs utc date datetime"
UNIT_WORDS = {
    "rad": "rad", "radian": "rad", "radians": "rad",
    "deg": "deg", "degrees": "deg", "degree": "deg", "rpm": "rpm", "nm": "N m", "ms": "ms",
    "us": "us", "ns": "ns", "millis": "ms", "millisec": "ms", "milliseconds": "ms", "msec": "ms",
    "msecs": "ms", "micros": "us", "microsec": "us", "microseconds": "us", "usec": "us", "usecs": "us",
    "s": "s", "sec": "s", "secs": "s", "seconds": "s", "mm": "mm", "mnm": "mN m",
    "nmm": "mN m", "knm": "kN m", "ncm": "N cm", "cnm": "N cm",
}  # fmt: skip
# Of poses: what a camera sees, what an arm carries, cameras' frames and the frames that arms stand in.
SEEN = frozenset(
    "tag tags marker markers target aruco apriltag april board charuco checkerboard chessboard object cam"
    " camera detection detected vision optical pattern eye tracking tvec rvec".split()
)
CARRIED = frozenset(
    "robot flange ee eef tcp tool tool0 gripper hand effector endeffector fk arm wrist base link7 link8"
    " body kuka fanuc abb iiwa franka panda rtde rsi".split()
)
CAMERAS = frozenset("cam camera optical rgb sensor eye".split())
FRAME_LETTERS = {  # of A_p_B, B's origin in A
    "b": "base", "c": "camera", "e": "hand", "f": "flange", "g": "gripper", "h": "hand", "m": "marker",
    "o": "object", "w": "world",
}  # fmt: skip
BASES = frozenset("base world link0 root origin o".split())  # o: of libfranka's O_T_EE

_TICKS, _TICK_UNITS = frozenset(("tick", "ticks")), frozenset("ms us ns".split())  # MicroPython's ticks_ms
_TRAVELS, _PER_SECOND = frozenset("rad deg degrees degree mrad rev mm".split()), frozenset("s sec".split())
_OTHER_RATES = frozenset("sample samples sampling loop control frame update baud hz".split())
_QUANTITY_OF = {word: quantity for quantity, words in QUANTITIES.items() for word in words.split()}
_COMMANDED, _MEASURED = set(COMMANDED.split()), set(MEASURED.split())
_COMPUTED, _SHARES, _TIME = set(COMPUTED.split()), set(SHARES.split()), set(TIME.split())
_TURNS = frozenset(("roll", "pitch", "yaw"))
_RATES = {"dot": "velocity", "ddot": "acceleration"}  # of a position: q_dot, theta_dot


@dataclass(frozen=True)
class NameMeaning:
    """What a column's name says; empty where it says nothing."""

    quantity: str = ""  # a key of QUANTITIES
    commanded: bool = False
    measured: bool = False
    computed: bool = False  # an error, an output, a sample of before: neither measured now nor tracked
    unit: str = ""


def meaning(name: str) -> NameMeaning:
    """Reads a stem or a name such as `q_des_deg{}`."""
    words = words_in(name)
    if "from" in words and any(word in _QUANTITY_OF for word in words[: words.index("from")]):
        words = words[: words.index("from")]  # torquesFromCurrentMeasurement
    quantities = [_QUANTITY_OF[word] for word in words if word in _QUANTITY_OF]
    if "qd" in words and {"actual", "target"} & set(words):  # UR's RTDE; alone it may be a desired position
        quantities.append("velocity")
    if "eff" in words and "end" not in words:  # ros2_control's third beside pos and vel; no end effector
        quantities.append("effort")
    # The last word that names something other than an angle: `joint_position_velocity` does not occur.
    quantity = next((q for q in reversed(quantities) if q != "position"), quantities[0] if quantities else "")
    if quantity == "position" and (dot := next((word for word in words if word in _RATES), "")):
        quantity = _RATES[dot]
    units = [UNIT_WORDS[word] for word in words if word in UNIT_WORDS]
    if quantity in ("", "position") and (rate := _rate_in(words)):
        quantity, units = rate, []  # qd_deg_s
    if quantity in ("", "position") and "rate" in words and not _OTHER_RATES & set(words):
        quantity = "velocity"  # of a gimbal or a gyroscope
    if (electric := _ELECTRIC.search(name)) and quantity in ("", "current", "voltage"):
        units = [electric[1]]
        quantity = quantity or ("current" if electric[1].endswith("A") else "voltage")
    if not quantity and (of_motor := _OF_MOTOR.fullmatch(re.split(r"[./ \[(]", name)[0])):
        quantity = "voltage" if of_motor[1] == "V" else "current"
    if not quantity and _PRESSURE.search(name):
        quantity = "pressure"
    found = set(words)
    if found & ENABLED:
        return NameMeaning("enabled")
    role = _last_role(name)
    followed = quantity in ("position", "velocity") and "input" in words  # ODrive's input_pos, input_vel
    return NameMeaning(
        quantity=quantity,
        commanded=bool(role & _COMMANDED) or followed,
        measured=bool(role & _MEASURED),
        computed=bool(found & _COMPUTED) or (quantity == "effort" and bool(found & _SHARES)),
        unit=units[-1] if units else "",
    )


def says_commanded(name: str) -> bool:
    """Whether any word of a name is one of commands."""
    return bool(set(words_in(name)) & _COMMANDED)


def _last_role(name: str) -> set[str]:
    """Words of the last part of a path that says who the number is of: `action.robot_state.q` is a state."""
    parts = [set(words_in(part)) for part in re.split(r"[./]", name)]
    said = [part for part in parts if part & (_COMMANDED | _MEASURED)]
    return said[-1] if said else set()


def _rate_in(words: Sequence[str]) -> str:
    """Quantity that a unit per s or per s2 at the end of a name says; empty where there is none."""
    for unit, per, *power in (each for each in (words[-2:], words[-3:]) if len(each) > 1):
        if unit in _TRAVELS and per in _PER_SECOND and power in ([], ["2"]):
            return "acceleration" if power else "velocity"
    return ""


def is_time(name: str) -> bool:
    """Whether a name is one of time and of nothing else."""
    words = [word for word in words_in(name) if not word.isdecimal()]
    return bool(words) and any(word in _TIME for word in words) and not meaning(name).quantity


def words_in(name: str) -> list[str]:
    """Lower-case words of a name in snake case, camel case or with dots."""
    name = _FEEDBACK.sub("feedback", name.translate(_MICRO))
    words = [word.lower() for word in _WORDS.findall(_TORQUE_UNIT.sub(_as_word, name))]
    parts = [part for word in words for part in _parts_of(word)]
    # Ticks of a unit of time are a clock's, others an encoder's.
    return parts[1:] if parts[:1] and parts[0] in _TICKS and set(parts[1:2]) & _TICK_UNITS else parts


def _parts_of(word: str) -> tuple[str, ...]:
    """Set point or actual value, and of what, where German writes both as one word."""
    compound = _COMPOUND.fullmatch(word)
    return compound.groups() if compound and compound[2] in _QUANTITY_OF else (word,)


def _as_word(unit: re.Match[str]) -> str:
    """A unit of torque in capitals and small letters as one word in small ones."""
    return f" {unit[1]}n{unit[2]} "


def split_names(names: Sequence[str], joints: Sequence[str]) -> dict[str, list[tuple[str, str]]]:
    """Names that differ in one place alone belong together.

    Args:
        names: of columns.
        joints: known names of joints, if any.

    Returns:
        Pairs (joint's label, column) by stem; the stem has `{}` where the label stood. A column of its own
        is its own stem, with an empty label.
    """
    candidates = {name: _stems(name, joints) for name in names}
    members = Counter(stem for found in candidates.values() for stem in {stem for stem, _ in found})
    grouped: dict[str, list[tuple[str, str]]] = {}
    for name in names:
        best = max(candidates[name], key=lambda p: (p[1] in joints, members[p[0]]), default=("", ""))
        named = best[1] in joints
        stem, label = best if named or members[best[0]] > 1 else (name, "")
        grouped.setdefault(stem, []).append((label, name))
    return _without_tools(grouped, joints)


def _without_tools(
    grouped: dict[str, list[tuple[str, str]]], joints: Sequence[str]
) -> dict[str, list[tuple[str, str]]]:
    """A tool's turns apart from joints: `roll_rad` beside `j1_rad` is none, alone it may be one."""
    out: dict[str, list[tuple[str, str]]] = {}
    for stem, members in grouped.items():
        labels = {label for label, _ in members}
        tool = _TURNS if _TURNS < labels and not _TURNS & set(joints) else frozenset()
        out.setdefault(stem, []).extend(each for each in members if each[0] not in tool)
        for label, name in members:
            if label in tool:
                out.setdefault(name, []).append(("", name))
    return out


def _stems(name: str, joints: Sequence[str]) -> list[tuple[str, str]]:
    """Ways to take one part of a name as the joint's, the likeliest first."""
    found = []
    for joint in sorted(joints, key=len, reverse=True):
        if re.search(rf"(?<![A-Za-z0-9]){re.escape(joint)}(?![A-Za-z0-9])", name):
            found.append((name.replace(joint, SLOT, 1), joint))
            break
    for between in "./":  # PlotJuggler writes /joint_states/shoulder/position
        parts = name.split(between)
        for k, part in enumerate(parts):
            if len(parts) > 1 and part and not meaning(part).quantity and not _is_role(part):
                found.append((between.join([*parts[:k], SLOT, *parts[k + 1 :]]), part))
    for run in _NUMBER.finditer(name):
        found.append((name[: run.start()] + SLOT + name[run.end() :], run.group()))
    words = re.split(r"(_)", name)
    for k, word in enumerate(words):
        if word not in ("", "_") and len(words) > 1 and not meaning(word).quantity and not _is_role(word):
            found.append(("".join([*words[:k], SLOT, *words[k + 1 :]]), word))
    return found


def _is_role(word: str) -> bool:
    return bool(set(words_in(word)) & (_COMMANDED | _MEASURED | _COMPUTED | _TIME))
