"""Random worlds of bodies: one effect or none, a background within tolerances, a tracker, an engine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.body_recording import BodyRecording, Support
from tests.diagnosis.bodies.body_worlds import G, Tracker, World, bounces, slide, toss
from tests.diagnosis.bodies.engine_bodies import BLOCK, CUBE, bouncing_ball, sliding_block, tossed_cube

NOMINAL = {"friction": 0.3, "restitution": 0.6}
SETTINGS: dict[str, Callable[..., BodyRecording]] = {
    "toss": toss,
    "slide": slide,
    "bounce": bounces,
    "cube": tossed_cube,
    "block": sliding_block,
    "ball": bouncing_ball,
}
SHOWN = {  # which worlds show which effects, and what else the right answer may be called
    "none": tuple(SETTINGS),
    "contact_friction": ("slide", "block"),
    "base_tilt": ("toss", "slide", "cube"),
    "contact_stiffness": ("bounce", "ball"),
    "object_mass": ("toss", "cube"),
    "rate": ("toss", "cube", "bounce", "ball"),
    "length": ("toss", "cube", "bounce"),
    "drag": ("toss", "cube"),
    "spin": ("toss",),
    "pushed": ("slide",),
}
UNKNOWN = ("drag", "spin", "pushed")


@dataclass(frozen=True)
class Case:
    """Recordings and what is true of them."""

    cause: str
    setting: str
    size: float  # of the effect, in the parameter that is reported
    recordings: tuple[BodyRecording, ...]


def draw(cause: str, seed: int, count: int = 6) -> Case:
    """The case of a cause and a seed."""
    rng = np.random.default_rng([seed, sorted(SHOWN).index(cause)])
    setting = str(rng.choice(SHOWN[cause]))
    tracker = Tracker(
        rate=float(rng.choice([60.0, 100.0, 120.0, 240.0])), noise=float(10 ** rng.uniform(-3.7, -2.7)),
        turn_noise=float(10 ** rng.uniform(-2.5, -1.8)), lost=float(rng.choice([0.0, 0.05])),
        wrong=float(rng.choice([0.0, 0.01])), smooth=float(rng.choice([0.0, 0.0, 1.2])),
    )  # fmt: skip
    background = rng.uniform(-1, 1, 8)
    leans = 0.004 * background[:2]
    world = World(
        gravity=_leaning(leans), friction=NOMINAL["friction"] * (1 + 0.04 * background[2]),
        restitution=NOMINAL["restitution"] + 0.02 * background[3],
        center=tuple(0.0008 * background[4:7]) if setting in ("toss", "cube") else (0.0, 0.0, 0.0),
        gyration=tuple((BLOCK if setting == "block" else CUBE).gyration), tracker=replace(
            tracker, scale=1.0 + 0.004 * float(background[7])
        ),
    )  # fmt: skip
    push, pace = np.zeros(3), 0.0
    sign, size = float(rng.choice([-1.0, 1.0])), 0.0
    if cause == "contact_friction":
        size = NOMINAL["friction"] * (1.0 + sign * rng.uniform(0.25, 0.6))
        world = replace(world, friction=size)
    elif cause == "base_tilt":
        size, angle = rng.uniform(0.025, 0.06), rng.uniform(0, 2 * np.pi)
        world = replace(world, gravity=_leaning(leans + size * np.array([np.cos(angle), np.sin(angle)])))
    elif cause == "contact_stiffness":
        size = NOMINAL["restitution"] + sign * rng.uniform(0.12, 0.25)
        world = replace(world, restitution=size)
    elif cause == "object_mass":
        way = rng.standard_normal(3)
        size = rng.uniform(0.006, 0.02)
        world = replace(world, center=tuple(size * way / np.linalg.norm(way)))
    elif cause == "rate":
        size = float(rng.choice([-0.1667, -0.08, -0.04, 0.04, 0.08, 0.2]))
        world = replace(world, tracker=replace(world.tracker, clock=1.0 + size))
    elif cause == "length":
        size = sign * rng.uniform(0.04, 0.1)
        world = replace(world, tracker=replace(world.tracker, scale=1.0 / (1.0 + size)))
    elif cause == "drag":
        size = rng.uniform(0.06, 0.25)
        world = replace(world, drag=size)
    elif cause == "spin":
        way = rng.standard_normal(3) * [1, 1, 0.3]
        world = replace(world, lift=tuple(rng.uniform(0.5, 1.2) * way / np.linalg.norm(way)))
    elif cause == "pushed":
        way, pace, strength = rng.uniform(0, 2 * np.pi), rng.uniform(8.0, 20.0), rng.uniform(0.8, 2.0)
        push = strength * np.array([np.cos(way), np.sin(way), 0.0])
    made = []
    for k in range(count):
        if cause == "pushed":
            phase = rng.uniform(0, 2 * np.pi)
            world = replace(world, push=lambda t, phase=phase: push * np.sin(pace * t + phase))
        recording = SETTINGS[setting](world, rng)
        made.append(replace(recording, name=f"run{k:02d}", sha256=f"{seed * 100 + k:064x}"))
    return Case(cause, setting, float(size), tuple(made))


def _leaning(axes: np.ndarray) -> tuple[float, float, float]:
    """Gravity turned by a rotation vector about x and y."""
    x, y, z = Rotation.from_rotvec([axes[0], axes[1], 0.0]).apply([0.0, 0.0, -G])
    return float(x), float(y), float(z)


def right(case: Case, verdict: str, named: tuple[str, ...], ambiguous: tuple[str, ...]) -> bool:
    """Whether a verdict with families named, or ambiguous, is what should be said of a case."""
    if case.cause == "none":
        return verdict == "no_gap"
    if case.cause in UNKNOWN:
        return verdict == "none_of_mine"
    if case.cause in ("rate", "length"):
        return verdict == "ambiguous" and set(ambiguous) == {"clock_offset", "object_geometry"}
    return verdict == "effect" and named[:1] == (case.cause,)


__all__ = ["SHOWN", "UNKNOWN", "Case", "Support", "draw", "right"]
