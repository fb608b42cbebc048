"""What a kind of controller is: its keys with their units, its law in words, and how keys become numbers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from samrl_core.cell.types.arm_description import (
    HELD,
    LINE,
    STANDARD_GRAVITY,
    ArmController,
)
from samrl_core.cell.types.drive_law import DriveLaw
from samrl_core.common.errors import InputError

LARGEST = 1e12  # of any figure, in its SI unit: beyond, it is no machine's, and products overflow
SIDES = ("motor", "link")
OFF = ("free", "braked")
ENCODER = {"encoder": SIDES}


@dataclass(frozen=True)
class Key:
    """A number per joint in a kind's text; sliding joints read m for rad and N for N m."""

    name: str
    unit: str
    meaning: str
    default: float | None = None  # None: it must be given
    positive: bool = False
    absent: bool = False  # 0 at a joint that has no drive: its other positive numbers do not count then


@dataclass(frozen=True)
class Gains:
    """A kind's numbers in the common form."""

    law: DriveLaw
    stiffness: np.ndarray | float = 0.0  # K [N m/rad]
    damping: np.ndarray | float = 0.0  # D [N m s/rad]
    limit: np.ndarray | None = None  # of u [N m], beside the effort limit
    rotor: np.ndarray | None = None  # rotor inertia at the joint [kg m2]


class ControllerKind(ABC):
    """A law, its parameters and how they are written."""

    name: ClassVar[str]  # `type` in the text
    title: ClassVar[str]
    formula: ClassVar[str]
    source: ClassVar[str]  # where the law is documented
    keys: ClassVar[tuple[Key, ...]]
    choices: ClassVar[Mapping[str, tuple[str, ...]]] = {}  # further keys of words; the first is the default
    compensates: ClassVar[bool] = False  # default of gravity_compensation

    @abstractmethod
    def gains(self, values: Mapping[str, np.ndarray], words: Mapping[str, str]) -> Gains:
        """The common form of the kind's numbers (J,)."""

    def unknown(self, about: Mapping[str, Any]) -> list[str]:
        """Keys of a text that the kind does not know."""
        known = {*(key.name for key in (*self.keys, *COMMON)), *self.choices, *WORDS}
        return sorted(str(key) for key in set(about) - known)

    def read(self, about: Mapping[str, Any], joints: tuple[str, ...], where: str) -> ArmController:
        """The controller that a text of this kind describes.

        Raises:
            InputError: a missing key, a word that is none of the choices, or numbers that do not fit.
        """
        needed = ["joints", *(key.name for key in self.keys if key.default is None)]
        if missing := [name for name in needed if name not in about]:
            raise InputError(f"{where} lacks {', '.join(missing)}; it has {sorted(about)}")
        count = len(joints)
        values = {key.name: _of_key(key, about, count, where) for key in self.keys}
        self._check_positive(about, values, where)
        words = {name: word(about, name, allowed, where) for name, allowed in self.choices.items()}
        period = numbers(about.get("period_s", 0.001), (), f"{where}: period_s")
        if not period > 0:
            raise InputError(f"{where}: period_s is {period}, must be above zero [s]")
        gravity = numbers(about.get("gravity", list(STANDARD_GRAVITY)), (3,), f"{where}: gravity").tolist()
        limit, rotor = (
            None if about.get(name) is None else not_negative(about[name], count, f"{where}: {name}")
            for name in ("effort_limit", "armature")
        )
        gains = self.gains(values, words)
        own = {key.name: values[key.name].tolist() for key in self.keys if key.name in about}
        limits = [each for each in (limit, gains.limit) if each is not None]
        return ArmController(
            joints=joints,
            stiffness=np.broadcast_to(np.asarray(gains.stiffness, dtype=float), (count,)).copy(),
            damping=np.broadcast_to(np.asarray(gains.damping, dtype=float), (count,)).copy(),
            period_s=float(period),
            gravity_compensation=bool(about.get("gravity_compensation", self.compensates)),
            gravity=(gravity[0], gravity[1], gravity[2]),
            effort_limit=np.min(limits, axis=0) if limits else None,
            armature=gains.rotor if rotor is None else rotor,
            law=gains.law,
            kind=self.name,
            between_commands=word(about, "between_commands", (LINE, HELD), where),
            stated={**own, **{name: about[name] for name in (*self.choices, *COMMON_KEPT) if name in about}},
        )

    def _check_positive(self, about: Mapping[str, Any], values: Mapping[str, np.ndarray], where: str) -> None:
        """Refuse numbers that must be above zero and are not; a joint without a drive has none.

        Raises:
            InputError: such a number, or no joint that has a drive.
        """
        driven = np.ones(len(next(iter(values.values()), ())), dtype=bool)
        for key in self.keys:
            if key.absent and np.any(values[key.name] > 0):
                driven = values[key.name] > 0
        for key in self.keys:
            if key.positive and not (values[key.name][driven] > 0).all():
                given = shown(about.get(key.name))
                raise InputError(f"{where}: {key.name} is {given}, must be above zero [{key.unit}]")

    def describe(self, controller: ArmController) -> dict[str, Any]:
        """The kind's own keys of a controller, as they were read."""
        return dict(controller.stated)


COMMON = (
    Key("period_s", "s", "sampling; the output is held in between", 0.001, True),
    Key("effort_limit", "N m", "most torque at the joint; the URDF's where it is left out", np.inf),
    Key("armature", "kg m2", "rotor inertia at the joint", 0.0),
)
WORDS = ("type", "joints", "gravity_compensation", "gravity", "tolerances", "between_commands")
COMMON_KEPT = ("effort_limit", "armature")


def _of_key(key: Key, about: Mapping[str, Any], count: int, where: str) -> np.ndarray:
    if about.get(key.name) is None:
        assert key.default is not None
        return np.full(count, key.default)
    return not_negative(about[key.name], count, f"{where}: {key.name}")


def word(about: Mapping[str, Any], name: str, allowed: tuple[str, ...], where: str) -> str:
    """A key that holds one of some words; the first where it is left out."""
    value = about.get(name, allowed[0])
    if value not in allowed:
        raise InputError(f"{where}: {name} is {value!r}, must be one of {', '.join(allowed)}")
    return str(value)


def joint_names(value: Any, where: str) -> tuple[str, ...]:
    """Different names. Raises `InputError` for anything else."""
    if not (isinstance(value, list | tuple) and all(isinstance(joint, str) for joint in value)):
        raise InputError(f"{where}: joints is {value!r}, must be a list of names")
    if len(set(value)) != len(value):
        raise InputError(f"{where}: joints {value} holds a name twice")
    return tuple(value)


def numbers(value: Any, shape: tuple[int, ...], where: str) -> np.ndarray:
    """Finite numbers of a shape. Raises `InputError` for anything else."""
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{where} is {shown(value)}, must be numbers") from error
    if array.shape != shape or not (np.abs(array) <= LARGEST).all():  # not NaN either
        what = f"{shape[0]} finite number{'' if shape[0] == 1 else 's'}" if shape else "one finite number"
        text = f"{where} is {shown(value)}, must be"
        if shape and not array.shape:
            listed = ", ".join([shown(value)] * shape[0])
            raise InputError(f"{text} a list of {what}; write [{listed}]")
        raise InputError(f"{text} {what} up to {LARGEST:g}")
    return array


def not_negative(value: Any, count: int | None, where: str) -> np.ndarray:
    """The same, from zero on; a single number where `count` is None."""
    array = numbers(value, () if count is None else (count,), where)
    if (array < 0).any():
        raise InputError(f"{where} is {shown(value)}, must not be negative")
    return array


def shown(value: Any) -> str:
    """A value as messages show it."""
    text = repr(value)
    return text if len(text) < 200 else text[:197] + "..."
