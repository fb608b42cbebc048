"""Which worlds of a camera there are: background, one cause, its size, and what the right answer is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from samrl_core.cell.instance.cell_instance import CellInstance, instance_named
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.common.errors import InputError
from samrl_core.common.streams import stream

STREAM = "camera world"
NOTHING = ""  # cause of a world whose cell is as well installed as its background says
UNKNOWN = "unknown"  # answer where the library has no such effect
Changed = tuple[CellInstance, str, tuple[float, ...]]  # the cell, the right answer, its sizes
Change = Callable[[CellInstance, float, np.random.Generator], Changed]


@dataclass(frozen=True)
class CameraWorld:
    """One world; `name` is all that recordings tell of it."""

    name: str
    seed: int
    background: str  # level of the cell instance around the cause
    cause: str  # key of `CAUSES`, or NOTHING
    severity: float  # 1 is the upper end of what the catalogue has seen


@dataclass(frozen=True)
class CameraTruth:
    """What a diagnosis of the world should say."""

    answer: str  # `family@place`, NOTHING or UNKNOWN
    values: tuple[float, ...]  # sizes in the units of the effect's parameters


def instance_of(world: CameraWorld, cell: CellSpec) -> tuple[CellInstance, CameraTruth]:
    """The cell instance and the truth; the same whenever it is asked.

    Raises:
        InputError: an unknown cause.
    """
    name = world.background if world.background == "nominal" else f"{world.background}:{world.seed}"
    instance = instance_named(name, cell)
    if world.cause == NOTHING:
        return instance, CameraTruth(NOTHING, ())
    if world.cause not in CAUSES:
        raise InputError(f"no cause is called {world.cause!r}; there are: {', '.join(CAUSES)}")
    rng = stream(world.seed, STREAM, world.cause)
    changed, answer, values = CAUSES[world.cause](instance, world.severity, rng)
    return changed, CameraTruth(answer, values)


def _with(instance: CellInstance, group: str, **values: object) -> CellInstance:
    return replace(instance, **{group: replace(getattr(instance, group), **values)})


def _direction(rng: np.random.Generator, size: int = 3) -> np.ndarray:
    drawn = rng.standard_normal(size)
    return drawn / np.linalg.norm(drawn)


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _hand_eye(i: CellInstance, s: float, rng: np.random.Generator) -> Changed:
    position, rotation = 0.005 * s * _direction(rng), 0.0175 * s * _direction(rng)
    changed = _with(i, "calibration", hand_eye_position=position, hand_eye_rotation=rotation)
    return changed, "hand_eye@sensor:camera", (0.005 * s, 0.0175 * s)


def _base(i: CellInstance, s: float, rng: np.random.Generator) -> Changed:
    position, rotation = 0.010 * s * _direction(rng), 0.0175 * s * _direction(rng)
    changed = _with(i, "calibration", camera_base_position=position, camera_base_rotation=rotation)
    return changed, "base_to_base@cell", (0.010 * s, 0.0175 * s)


def _zero(role: str, joints: str, name: str) -> Change:
    def change(i: CellInstance, s: float, rng: np.random.Generator) -> Changed:
        zeros = getattr(i.calibration, name).copy()
        joint, size = int(rng.integers(1, len(zeros) - 1)), 0.02 * s * _sign(rng)
        zeros[joint] = size
        return (
            _with(i, "calibration", **{name: zeros}),
            f"encoder_offset@joint:{joints}{joint + 1}",
            (size,),
        )

    return change


def _depth_scale(i: CellInstance, s: float, rng: np.random.Generator) -> Changed:
    size = 0.02 * s * _sign(rng)
    return _with(i, "depth", scale=size), "depth_scale@sensor:camera", (size,)


def _depth_bias(i: CellInstance, s: float, rng: np.random.Generator) -> Changed:
    size = 0.008 * s * _sign(rng)
    return _with(i, "depth", bias=size), "depth_scale@sensor:camera", (size,)


def _focal(i: CellInstance, s: float, rng: np.random.Generator) -> Changed:
    size = 0.03 * s * _sign(rng)
    return _with(i, "optics", focal=np.full(2, size)), "intrinsics@sensor:camera", (size, size)


def _centre(i: CellInstance, s: float, rng: np.random.Generator) -> Changed:
    size = 0.03 * s * _direction(rng, 2)
    return _with(i, "optics", centre=size), "intrinsics@sensor:camera", tuple(map(float, size))


def _radial(i: CellInstance, s: float, rng: np.random.Generator) -> Changed:
    size = 0.2 * s * _sign(rng)
    return _with(i, "optics", radial=np.array([size, 0.0])), "lens_distortion@sensor:camera", (size, 0.0)


def _late(i: CellInstance, s: float, rng: np.random.Generator) -> Changed:
    size = 0.06 * s
    return _with(i, "timing", stamp_late=size), "camera_latency@sensor:camera", (size,)


def _exposure(i: CellInstance, s: float, rng: np.random.Generator) -> Changed:
    return _with(i, "optics", exposure=-0.6 * min(s, 1.5)), "lighting@cell", (-0.6 * min(s, 1.5),)


def _lamp(i: CellInstance, s: float, rng: np.random.Generator) -> Changed:
    size = 1.0 * s
    return _with(i, "look", light_strength=size), "lighting@cell", (size,)


def _depth_noise(i: CellInstance, s: float, rng: np.random.Generator) -> Changed:
    size = 0.3 * s
    ratio = float(np.log(np.hypot(0.08, size) / 0.08))
    return _with(i, "depth", subpixel=size), "depth_noise@sensor:camera", (ratio,)


def _grip(i: CellInstance, s: float, rng: np.random.Generator) -> Changed:
    size = 0.012 * s * _direction(rng)
    return _with(i, "grip", position=size), UNKNOWN, ()


def _growth(i: CellInstance, s: float, rng: np.random.Generator) -> Changed:
    return _with(i, "segmentation", growth=4.0 * s), UNKNOWN, ()


def _shift(i: CellInstance, s: float, rng: np.random.Generator) -> Changed:
    return _with(i, "depth", shift=0.04 * s * _sign(rng)), UNKNOWN, ()


CAUSES: dict[str, Change] = {
    "hand_eye": _hand_eye,
    "base": _base,
    "camera_zero": _zero("camera_arm", "rizon_joint", "camera_arm_zeros"),
    "tool_zero": _zero("tool_arm", "panda_joint", "tool_arm_zeros"),
    "depth_scale": _depth_scale,
    "depth_bias": _depth_bias,
    "focal": _focal,
    "centre": _centre,
    "radial": _radial,
    "late": _late,
    "exposure": _exposure,
    "lamp": _lamp,
    "depth_noise": _depth_noise,
    "grip": _grip,
    "growth": _growth,
    "shift": _shift,
}
OUTSIDE = ("grip", "growth", "shift")  # causes that the library does not have
ON_REQUEST = ("lamp",)  # younger than sealed sets, which are made again from their seeds without it


def planned(
    count_nothing: int, seeds: int, severities: tuple[float, ...], first_seed: int
) -> list[CameraWorld]:
    """Worlds without a cause, then every cause at every severity, `seeds` times; each is another cell."""
    made: list[CameraWorld] = []
    for _ in range(count_nothing):
        made.append(_numbered(made, first_seed, NOTHING, 0.0))
    for _ in range(seeds):
        for cause in CAUSES:
            for severity in (1.0,) if cause in OUTSIDE else severities:
                made.append(_numbered(made, first_seed, cause, severity))
    return made


def _numbered(made: list[CameraWorld], first_seed: int, cause: str, severity: float) -> CameraWorld:
    number = len(made)
    return CameraWorld(f"{number:03d}", first_seed + number, "typical", cause, severity)
