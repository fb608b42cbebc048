"""A cell instance: all groups of differences of one real cell, drawn from its name."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.instance.arms import ArmDifferences
from samrl_core.cell.instance.calibration import Calibration
from samrl_core.cell.instance.depth import Depth
from samrl_core.cell.instance.difference import LEVELS, draw_group
from samrl_core.cell.instance.dominant import DOMINANT
from samrl_core.cell.instance.grip import Grip
from samrl_core.cell.instance.look import Look
from samrl_core.cell.instance.optics import Optics
from samrl_core.cell.instance.parts import Parts
from samrl_core.cell.instance.segmentation import Segmentation
from samrl_core.cell.instance.timing import Timing
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole
from samrl_core.common.streams import DEVELOPMENT, PURPOSES
from samrl_core.common.text_files import parse_json, read_text

GROUPS: dict[str, type[Any]] = {
    "calibration": Calibration,
    "optics": Optics,
    "depth": Depth,
    "timing": Timing,
    "arms": ArmDifferences,
    "parts": Parts,
    "grip": Grip,
    "look": Look,
    "segmentation": Segmentation,
}
NOMINAL = LEVELS[0]
STREAM = "cell instance"
FILE = "instance.json"  # in a run's evaluation folder


@dataclass(frozen=True)
class InstanceName:
    """What an instance is drawn from: `nominal`, `typical:7`, `careless:test:3`, `typical:7 depth=2`.

    `typical:7 hand_eye=2` has an error of `DOMINANT` on top, twice as large as met in practice.

    A number alone is for development; `test:` before it names the instances that a final table is made of.

    Raises:
        InputError: an unknown level, purpose or group, or a number or factor out of range.
    """

    level: str = NOMINAL
    seed: int = 0
    purpose: str = DEVELOPMENT
    scales: tuple[tuple[str, float], ...] = ()  # group, or error that stands out, and factor

    def __post_init__(self) -> None:
        if self.level not in LEVELS:
            raise InputError(f"no level is called {self.level!r}; there are: {', '.join(LEVELS)}")
        if self.purpose not in PURPOSES:
            raise InputError(f"no purpose is called {self.purpose!r}; there are: {', '.join(PURPOSES)}")
        if self.seed < 0:
            raise InputError(f"seed {self.seed} of a cell instance must be at least 0")
        for group, factor in self.scales:
            if group not in GROUPS and group not in DOMINANT:
                raise InputError(
                    f"no group is called {group!r}; there are: {', '.join(GROUPS)}; and errors that stand "
                    f"out: {', '.join(DOMINANT)}"
                )
            if not (math.isfinite(factor) and 0.0 <= factor <= 10.0):
                raise InputError(f"scale {factor} of {group} must be within 0 .. 10")
        if len({group for group, _ in self.scales}) < len(self.scales):
            raise InputError(f"a group is scaled twice in {self.scales}; give one factor")
        if self.scales and self.level == NOMINAL:
            raise InputError(
                "a nominal cell has no differences to scale; give --instance typical:SEED as well"
            )

    @staticmethod
    def parse(text: str, scales: tuple[str, ...] = ()) -> InstanceName:
        """From `LEVEL[:[test:]SEED] [GROUP=FACTOR ...]`, and further factors.

        Raises:
            InputError: the text is no such name.
        """
        name, *more = text.split() or [""]
        level, *rest = name.split(":")
        if level == NOMINAL and not rest:
            rest = ["0"]
        *purpose, number = rest or [""]
        if len(purpose) > 1 or not number.isascii() or not number.isdigit():
            raise InputError(
                f"cell instance {text!r} is none; give nominal, LEVEL:SEED or LEVEL:test:SEED with LEVEL "
                f"{' or '.join(LEVELS[1:])} and a whole number as SEED, as typical:7"
            )
        factors = tuple(_factor(one) for one in (*more, *scales))
        return InstanceName(level, int(number), purpose[0] if purpose else DEVELOPMENT, factors)

    def __str__(self) -> str:
        if self.level == NOMINAL:
            return NOMINAL
        purpose = "" if self.purpose == DEVELOPMENT else f"{self.purpose}:"
        return " ".join([f"{self.level}:{purpose}{self.seed}", *(f"{g}={f:g}" for g, f in self.scales)])


def _factor(text: str) -> tuple[str, float]:
    group, equals, number = text.partition("=")
    try:
        return group, float(number if equals else "")
    except ValueError as error:
        raise InputError(f"scale {text!r} is none; give GROUP=FACTOR, as depth=2") from error


@dataclass(frozen=True, eq=False)
class CellInstance:
    """The differences of one cell, and the name that they were drawn from."""

    name: InstanceName
    calibration: Calibration
    optics: Optics
    depth: Depth
    timing: Timing
    arms: ArmDifferences
    parts: Parts
    grip: Grip
    look: Look
    segmentation: Segmentation

    @property
    def is_nominal(self) -> bool:
        """Whether there is no difference at all."""
        return self.name.level == NOMINAL


def draw_instance(name: InstanceName, cell: CellSpec) -> CellInstance:
    """The instance of that name; the same whatever else is drawn.

    Level and scale are no part of the stream: `careless:7` is `typical:7` treated worse.
    """
    joints = {role: len(cell.arm(role).joint_names) for role in ROLES}
    scales = dict(name.scales)
    groups = {
        key: draw_group(
            group, name.level, name.seed, (STREAM, name.purpose, key), joints, scales.get(key, 1.0)
        )
        for key, group in GROUPS.items()
    }
    for key, factor in name.scales:
        if key in DOMINANT:
            one = DOMINANT[key]
            added = one.add_to(key, factor, name.seed, (STREAM, name.purpose, "dominant"))
            old = groups[one.group]
            groups[one.group] = replace(old, **{f: getattr(old, f) + v for f, v in added.items()})
    return CellInstance(name, **groups)


def instance_named(text: str, cell: CellSpec) -> CellInstance:
    """The instance of a name as text.

    Raises:
        InputError: from `InstanceName.parse`.
    """
    return draw_instance(InstanceName.parse(text), cell)


def seal_instance(path: Path, instance: CellInstance) -> None:
    """Write all drawn values where evaluation alone reads them."""
    groups = {
        key: {f.name: np.asarray(getattr(getattr(instance, key), f.name)).tolist() for f in fields(group)}
        for key, group in GROUPS.items()
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, json.dumps({"name": str(instance.name), "differences": groups}, indent=1) + "\n")


def read_instance_file(path: Path) -> dict[str, Any]:
    """What `seal_instance` wrote: `name`, and `differences` by group and field.

    Raises:
        InputError: the file is missing or damaged.
    """
    if not path.is_file():
        raise InputError(f"no cell instance at {path}; the simulated world's bridge alone writes one")
    found = parse_json(read_text(path, "the cell instance"), str(path))
    if not isinstance(found, dict) or not {"name", "differences"} <= set(found):
        raise InputError(f"{path} holds no cell instance; the simulated world's bridge alone writes one")
    return found
