"""Which servo worlds a study holds: mechanism, drive, effects and severities, from one seed."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from samrl_core.blind_test.servo_worlds.drives import OPEN_LOOP
from samrl_core.blind_test.servo_worlds.effects import FAMILIES, USUAL
from samrl_core.blind_test.servo_worlds.mechanisms import mechanisms
from samrl_core.blind_test.servo_worlds.unknown import UNKNOWN
from samrl_core.common.errors import InputError

# Drives by turns, the common ones more often.
KINDS = (
    "position_servo", "voltage_servo", "velocity_drive", "position_servo", "voltage_motor",
    "voltage_servo", "position_servo", "current_motor", "velocity_drive", "stepper",
)  # fmt: skip
_SEVERITIES = (0.5, 0.75, 0.95, 0.25)
_STRONG = (0.5, 0.75, 0.95)
_FALLING = ("pendulum", "two_link", "gimbal", "pan_two_link")  # gravity turns with an axis' angle
_SERVOS = ("position_servo", "voltage_servo")
# Drives that an effect can act on; the others take any.
_ONLY: dict[str, tuple[str, ...]] = {
    "controller_gain": (*_SERVOS, "velocity_drive"),
    "dead_band": _SERVOS,
    "torque_saturation": ("position_servo", "velocity_drive"),
    "command_low_pass": (*_SERVOS, "velocity_drive", "stepper"),
    "command_delay": (*_SERVOS, "velocity_drive", "stepper"),
    "packet_jitter": (*_SERVOS, "velocity_drive", "stepper"),
}
_NOT_STEPPER = (
    "actuator_gain",
    "backlash",
    "joint_elasticity",
    "encoder_offset",
    "weak_supply",
    "slipping_clutch",
)
_OF_THE_WHOLE = ("payload", "base_tilt", "packet_jitter", "shaken_stand", "weak_supply", "uneven_player")
ROLE = "tool_arm"


@dataclass(frozen=True)
class ServoSettings:
    """How many servo worlds of each kind."""

    seed: int = 0
    single: int = 24  # every family once
    none: int = 6
    outside: int = 6
    double: int = 4
    duration_s: float = 12.0  # of each recording
    stated_friction: bool = False  # models state friction, machines stick, logs miss rows

    def __post_init__(self) -> None:
        counts = (self.single, self.none, self.outside, self.double)
        if min(counts) < 0 or sum(counts) == 0:
            raise InputError(f"numbers of servo worlds {counts} must not be negative, and not all zero")
        if not 4.0 <= self.duration_s <= 35.0:
            raise InputError(f"recordings of {self.duration_s} s; give 4..35 s")

    def as_dict(self) -> dict:
        """For JSON; without what older studies do not state, where it is as in them."""
        return {name: value for name, value in asdict(self).items() if name != "stated_friction" or value}


@dataclass(frozen=True)
class ServoEffect:
    """One effect to be made."""

    family: str
    place: str
    axis: int
    form: str
    severity: float


@dataclass(frozen=True)
class ServoItem:
    """One servo world to be made; nothing else is needed."""

    id: str
    set: str
    mechanism: str
    drive: str
    effects: tuple[ServoEffect, ...]
    seed: int
    duration_s: float
    sticks: bool = False  # as its model states

    def as_dict(self) -> dict:
        """For JSON."""
        return asdict(self)


def plan_servos(settings: ServoSettings) -> list[ServoItem]:
    """All servo worlds in shuffled order; the same for the same settings."""
    rng = np.random.default_rng(settings.seed)
    families, unknown = list(rng.permutation(list(FAMILIES))), list(rng.permutation(list(UNKNOWN)))
    asked: list[tuple[str, tuple[str, ...], float]] = []
    for i in range(settings.single):
        asked.append(("single", (families[i % len(families)],), _SEVERITIES[i % 4]))
    asked += [("none", (), 0.0)] * settings.none
    for i in range(settings.outside):
        asked.append(("outside", (unknown[i % len(unknown)],), _STRONG[i % 3]))
    for _ in range(settings.double):
        first, second = rng.choice(families, size=2, replace=False)
        asked.append(("double", (str(first), str(second)), float(rng.choice(_STRONG))))
    order = rng.permutation(len(asked))
    turn = int(rng.integers(len(KINDS)))
    items = []
    for place, k in enumerate(order.tolist()):
        kind, names, severity = asked[k]
        drive, mechanism, turn = _machine(names, turn, rng)
        items.append(
            ServoItem(
                id=f"s{place:03d}",
                set=kind,
                mechanism=mechanism,
                drive=drive,
                effects=tuple(_place(str(n), mechanism, severity, rng) for n in names),
                seed=int(rng.integers(2**62)),
                duration_s=settings.duration_s,
                sticks=settings.stated_friction and drive != "stepper",
            )
        )
    return items


def _machine(names: tuple[str, ...], turn: int, rng: np.random.Generator) -> tuple[str, str, int]:
    """The next drive that suits the effects, a mechanism that suits both, and the turn after."""
    for step in range(len(KINDS)):
        drive = KINDS[(turn + step) % len(KINDS)]
        fits = all(
            drive in _ONLY.get(n, KINDS) and not (n in _NOT_STEPPER and drive == "stepper") for n in names
        )
        suited = _suited(drive, names)
        if fits and suited:
            return drive, str(rng.choice(suited)), turn + step + 1
    raise InputError(f"no drive suits {names}; the plan's pairs must be mended")


def _suited(drive: str, names: tuple[str, ...]) -> list[str]:
    there = []
    for mechanism in mechanisms(np.random.default_rng(0)):
        name = mechanism.name
        if drive in OPEN_LOOP and not mechanism.hangs:
            continue  # it would drift away
        if drive == "current_motor" and name == "turntable":
            continue  # nothing brakes it
        if "encoder_offset" in names and name not in _FALLING:
            continue  # nothing could tell
        if "base_tilt" in names and name == "turntable":
            continue
        if drive == "stepper" and any(link.kind == "prismatic" for link in mechanism.links):
            continue  # on a spindle it would have to be told single steps, faster than logs are
        there.append(name)
    return there


def _place(name: str, mechanism: str, severity: float, rng: np.random.Generator) -> ServoEffect:
    links = next(m for m in mechanisms(np.random.default_rng(0)) if m.name == mechanism).links
    first = 1 if name == "encoder_offset" and mechanism in ("gimbal", "pan_two_link") else 0
    axis = int(rng.integers(first, len(links)))
    if name == "link_inertia" and mechanism in ("gimbal", "pan_two_link", "cylindrical"):
        axis = len(links) - 1  # masses on a vertical axis show in turning alone
    place = f"joint:{links[axis].joint}"
    if name in _OF_THE_WHOLE:
        place = f"arm:{ROLE}"
    elif name == "link_inertia":
        place = f"link:{links[axis].name}"
    form = "T2" if name in UNKNOWN else ("T0" if name in USUAL else "T1")
    return ServoEffect(name, place, axis, form, severity)
