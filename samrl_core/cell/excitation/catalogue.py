"""The kinds of trajectory that a file may ask for: their parameters, and which effects each shows."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ExcitationParameter:
    """A number, or a list of numbers, with its unit, range and default."""

    unit: str
    lower: float
    upper: float
    default: float | tuple[float, ...]
    whole: bool = False  # integers only

    @property
    def is_list(self) -> bool:
        """Whether it takes a list."""
        return isinstance(self.default, tuple)


@dataclass(frozen=True)
class TrajectoryKind:
    """One kind of trajectory."""

    shows: str  # what is told apart by it
    parameters: dict[str, ExcitationParameter]


def _lasting(default: float) -> ExcitationParameter:
    return ExcitationParameter("s", 1.0, 600.0, default)


_COMMON = {
    "duration_s": _lasting(15.0),
    "seed": ExcitationParameter("-", 0, 2**31 - 1, 0, whole=True),
    "stiffness_scale": ExcitationParameter("-", 0.2, 1.5, 1.0),
    "damping_scale": ExcitationParameter("-", 0.3, 1.2, 1.0),
}
_SCALED = {"amplitude": ExcitationParameter("of the free box", 0.05, 1.0, 1.0)}
_SPEEDS = ExcitationParameter("rad/s", 0.005, 1.0, (0.03, 0.1, 0.3))
_BAND = ExcitationParameter("Hz", 0.05, 50.0, (0.1, 5.0))
_POSES = ExcitationParameter("-", 2, 40, 8, whole=True)

KINDS: dict[str, TrajectoryKind] = {
    "slow": TrajectoryKind(
        "friction: Coulomb, viscous, Stribeck, asymmetry, by speed and direction; loads, by rests",
        _COMMON | _SCALED | {"speeds": _SPEEDS, "poses": ExcitationParameter("-", 2, 40, 6, whole=True)},
    ),
    "multisine": TrajectoryKind(
        "inertia, viscous friction, delay, low-pass and elasticity, by frequency",
        _COMMON | _SCALED | {"band": _BAND},
    ),
    "task": TrajectoryKind("nothing of its own: what is held out", _COMMON | _SCALED),
    "static": TrajectoryKind(
        "payload, base tilt, torque sensor, encoder offset, actuator gain: all without friction's sign",
        _COMMON | _SCALED | {"poses": _POSES, "duration_s": _lasting(24.0)},
    ),
    "chirp": TrajectoryKind(
        "delay (phase linear in frequency) against low-pass (amplitude too) and elasticity (resonance)",
        _COMMON
        | {
            "band": ExcitationParameter("Hz", 0.05, 50.0, (1.0, 20.0)),
            "speed": ExcitationParameter("rad/s", 0.01, 0.5, 0.15),
        },
    ),
    "micro_reversals": TrajectoryKind(
        "presliding, backlash and elasticity against Coulomb friction: loops of milliradians under load",
        _COMMON
        | {
            "amplitude": ExcitationParameter("rad", 0.001, 0.05, 0.004),
            "speed": ExcitationParameter("rad/s", 0.002, 0.1, 0.02),
            "poses": ExcitationParameter("-", 1, 20, 4, whole=True),
        },
    ),
    "sweep": TrajectoryKind(
        "what repeats with position: gear ripple, position-dependent friction, eccentricity, cable",
        _COMMON
        | {
            "amplitude": ExcitationParameter("rad", 0.05, 1.0, 0.3),
            "speeds": ExcitationParameter("rad/s", 0.01, 1.0, (0.2, 0.5)),
            "duration_s": _lasting(65.0),
        },
    ),
    "two_gains": TrajectoryKind(
        "controller gain against every real effect: the same motion at two gains; delay against filter",
        _COMMON
        | _SCALED
        | {
            "band": _BAND,
            "stiffness_scale": ExcitationParameter("-", 0.2, 1.5, 0.5),
            "damping_scale": ExcitationParameter("-", 0.3, 1.2, 0.7),
        },
    ),
    "two_loads": TrajectoryKind(
        "payload against actuator and sensor gain, load-dependent against Coulomb friction: known extra mass",
        _COMMON
        | _SCALED
        | {
            "speeds": _SPEEDS,
            "poses": ExcitationParameter("-", 2, 40, 6, whole=True),
            "extra_mass": ExcitationParameter("kg", 0.05, 3.0, 0.5),
        },
    ),
}
