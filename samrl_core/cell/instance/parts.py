"""Parts: what is handled is not made, placed or weighed as drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.instance.difference import difference

_ISO = "ISO 2768-m: +-0.1 mm up to 6 mm, +-0.2 mm up to 30 mm; a printed part +-0.5 % and 0.2 mm at least"
_FIXTURE = "ASSUMPTION: a fixture set up with a ruler; careless: put down and taped"
_FOOD = "ASSUMPTION: a pancake or a thread is not a standard part"
_PLATE = "ASSUMPTION: plates of 5 to 15 mm laid on one bench, drawn with 10 mm; careless: whatever lies there"
_SHAKEN = (
    "Ko and Hu 2020: cooks shake a wok three times a second; at +-2.5 cm that is 0.5 m/s, and a pancake that"
    " goes on with it slides by 3 cm at a friction of 0.4; half of it for who shakes half as wide"
)
_FRICTION = "ASSUMPTION: tables of dry friction spread by a third for the same pair"


@dataclass(frozen=True, eq=False)
class Parts:
    """Relative differences are shares of the nominal value; tasks say what they mean for them (`as_made`)."""

    held_size: float = difference("radius of what is held", "m", "uniform", 0.0001, 0.0003, _ISO)
    clearance: float = difference("of the opening, share of it", "-", "uniform", 0.10, 0.20, _ISO)
    size: np.ndarray = difference(
        "of a soft part, across and in thickness or length", "-", "uniform", 0.03, 0.08, _FOOD, (2,)
    )
    either: float = difference(
        "which of two kinds a cell has been given, where a task has two: by its sign",
        "-",
        "uniform",
        1.0,
        1.0,
        "no range: a coin for each cell",
    )
    mass: float = difference("of a part that moves", "-", "uniform", 0.10, 0.20, _FOOD)
    stiffness: float = difference(
        "of a part that bends and of contacts, logarithm", "-", "uniform", 0.20, 0.50, _FOOD
    )
    friction: np.ndarray = difference(
        "of the target, the tool and what stands fixed, logarithm",
        "-",
        "uniform",
        0.20,
        0.40,
        _FRICTION,
        (3,),
    )
    tilt: np.ndarray = difference(
        "of the fixed part whose place is estimated, about world's x and y",
        "rad",
        "normal",
        0.006,
        0.020,
        _FIXTURE,
        (2,),
    )
    turn: float = difference("of the same about world's z", "rad", "uniform", 0.15, 0.40, _FIXTURE)
    place: np.ndarray = difference(
        "of fixed parts that nobody estimates, in x and y", "m", "normal", 0.0007, 0.002, _FIXTURE, (2,)
    )
    place_turn: float = difference(
        "of the same about their own vertical axis", "rad", "normal", 0.005, 0.015, _FIXTURE
    )
    surface: float = difference(
        "of what the work lies on, in height, where a task does not know it",
        "m",
        "uniform",
        0.005,
        0.010,
        _PLATE,
    )
    slide: float = difference(
        "way of a loose part when what it lies on is shaken once, where a task has that",
        "m",
        "share",
        0.030,
        0.045,
        _SHAKEN,
    )
