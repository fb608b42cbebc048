"""Things that lie about on the table: seen and measured by a camera, touched by nobody.

They keep away from the middle of the table, where the work is done, and from both arms' feet, and are low
enough not to stand between the camera and the work.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Box, Cylinder, Part, Rgb
from samrl_core.cell.world.table import TABLE_IN_WORLD, TABLE_SIZE

WORK = 0.175  # radius about the table's middle that is kept clear [m]
WAY = 0.07  # and half the width of the tool arm's way to it [m]
FOOT = 0.17  # the same about what stands at the table's ends [m]
HIGHEST = 0.055  # [m]
_TRIES = 60


@dataclass(frozen=True, eq=False)
class Thing:
    """A part with its colour; the part's pose is in world."""

    part: Part
    color: Rgb


def lay_clutter(rng: np.random.Generator, count: int) -> tuple[Thing, ...]:
    """At most `count` things, none on top of another."""
    things: list[Thing] = []
    taken: list[tuple[np.ndarray, float]] = []
    for _ in range(_TRIES * count):
        if len(things) == count:
            break
        place = (rng.random(2) - 0.5) * (np.array(TABLE_SIZE[:2]) - 0.06)
        thing, radius = _thing(rng, place + TABLE_IN_WORLD.position[:2])
        along = 0.5 * TABLE_SIZE[0] - np.abs(place[0]) + 0.5 * np.abs(place[1])
        on_the_way = place[0] < 0.0 and abs(place[1]) < WAY + radius
        if np.hypot(*place) < WORK + radius or along < FOOT or on_the_way:
            continue
        if any(np.hypot(*(place - other)) < radius + reach for other, reach in taken):
            continue
        things.append(thing)
        taken.append((place, radius))
    return tuple(things)


def _thing(rng: np.random.Generator, place: np.ndarray) -> tuple[Thing, float]:
    """One thing and the radius that it takes."""
    turn = (0.0, 0.0, float(rng.uniform(0, np.pi)))
    kind = rng.random()
    color = _color(rng)
    if kind < 0.35:  # a carton, a block, a notebook
        half = np.array(
            [rng.uniform(0.012, 0.05), rng.uniform(0.010, 0.035), rng.uniform(0.003, 0.5 * HIGHEST)]
        )
        pose = Pose.from_rpy(np.array([*place, half[2]]), turn)
        return Thing(Box((half[0], half[1], half[2]), pose), color), float(np.hypot(half[0], half[1]))
    if kind < 0.65:  # a cap, a pot, a roll of tape
        radius, height = rng.uniform(0.008, 0.035), rng.uniform(0.008, HIGHEST)
        pose = Pose.from_rpy(np.array([*place, 0.5 * height]), turn)
        return Thing(Cylinder(radius, height, pose), color), float(radius)
    # a pen, a screwdriver, a bolt that lies
    radius, length = rng.uniform(0.003, 0.010), rng.uniform(0.03, 0.16)
    lying = Pose.from_rpy(np.array([*place, radius]), turn) @ Pose.from_rpy(
        np.zeros(3), (0.0, 0.5 * np.pi, 0.0)
    )
    return Thing(Cylinder(radius, length, lying), color), float(0.5 * length)


def _color(rng: np.random.Generator) -> Rgb:
    """Mostly grey, black or brown, now and then loud."""
    if rng.random() < 0.65:
        tone = rng.uniform(0.08, 0.8)
        r, g, b = np.clip(tone * rng.uniform(0.85, 1.15, 3), 0.0, 1.0).tolist()
    else:
        r, g, b = rng.uniform(0.05, 0.9, 3).tolist()
    return r, g, b
