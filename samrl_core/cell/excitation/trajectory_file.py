"""`next.yaml`: an excitation trajectory as a file that the diagnosis writes and `samrl excite` plays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from yaml.constructor import ConstructorError

from samrl_core.cell.excitation.catalogue import KINDS, ExcitationParameter, TrajectoryKind
from samrl_core.cell.robots.robot import ROLES
from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole
from samrl_core.common.names import known_are
from samrl_core.common.text_files import parse_yaml, read_text

SCHEMA = 1
_KEYS = ("schema", "arm", "kind", "joints", "parameters", "why")


@dataclass(frozen=True)
class TrajectoryFile:
    """What a file asks for. `joints` empty: all. `parameters`: those given; the rest have defaults.

    Raises:
        InputError: anything that the reader would refuse, with key, value, limit and remedy.
    """

    arm: str
    kind: str
    joints: tuple[str, ...] = ()
    parameters: Mapping[str, float | tuple[float, ...]] = field(default_factory=dict)
    why: str = ""

    def __post_init__(self) -> None:
        if self.arm not in ROLES:
            raise InputError(f"arm is {self.arm!r}; write one of {', '.join(ROLES)}")
        if self.kind not in KINDS:
            raise InputError(f"kind is {self.kind!r}; write one of {', '.join(KINDS)}")
        checked = {k: _checked(f"parameters.{k}", v, self._rule(k)) for k, v in self.parameters.items()}
        object.__setattr__(self, "parameters", checked)

    def _rule(self, name: str) -> ExcitationParameter:
        known = self.about.parameters
        if name not in known:
            raise InputError(f"parameters.{name} is unknown to '{self.kind}', which has {', '.join(known)}")
        return known[name]

    @property
    def about(self) -> TrajectoryKind:
        """The kind's entry in the catalogue."""
        return KINDS[self.kind]

    def number(self, name: str) -> float:
        """A parameter given or its default."""
        value = self.parameters.get(name, self.about.parameters[name].default)
        assert isinstance(value, (int, float)), name
        return value

    def numbers(self, name: str) -> tuple[float, ...]:
        """A list parameter given or its default."""
        value = self.parameters.get(name, self.about.parameters[name].default)
        assert isinstance(value, tuple), name
        return value

    def mask(self, joint_names: tuple[str, ...]) -> list[bool]:
        """Which of the arm's joints move.

        Raises:
            InputError: a joint that the arm has not.
        """
        for i, name in enumerate(self.joints):
            if name not in joint_names:
                raise InputError(f"joints[{i}] is {name!r}; {self.arm} has {', '.join(joint_names)}")
        return [not self.joints or name in self.joints for name in joint_names]

    def write(self, path: Path) -> None:
        """As YAML, readable by `read`.

        Raises:
            InputError: the file exists.
        """
        if path.exists():
            raise InputError(f"{path} exists; choose another name or remove it")
        values = {k: list(v) if isinstance(v, tuple) else v for k, v in self.parameters.items()}
        data = {"schema": SCHEMA, "arm": self.arm, "kind": self.kind, "joints": list(self.joints)}
        text = yaml.safe_dump(
            data | {"parameters": values, "why": self.why}, sort_keys=False, allow_unicode=True
        )
        write_whole(path, text)

    @classmethod
    def read(cls, path: Path) -> TrajectoryFile:
        """From YAML; nothing unknown, doubled or out of range passes.

        Raises:
            InputError: naming file, key, value, limit and remedy.
        """
        data = parse_yaml(read_text(path, "the trajectory"), str(path), _StrictLoader)
        try:
            return cls._from_mapping(data)
        except InputError as error:
            raise InputError(f"{path}: {error}") from error

    @classmethod
    def _from_mapping(cls, data: Any) -> TrajectoryFile:
        if not isinstance(data, dict):
            raise InputError(f"holds a {type(data).__name__}; write keys {', '.join(_KEYS)}")
        if unknown := [str(k) for k in data if k not in _KEYS]:
            raise InputError(f"unknown key {', '.join(unknown)}; {known_are(unknown[0], _KEYS)}")
        if missing := [k for k in ("schema", "arm", "kind") if k not in data]:
            raise InputError(f"key {', '.join(missing)} is missing; write it")
        if data["schema"] != SCHEMA or isinstance(data["schema"], bool):
            raise InputError(f"schema is {data['schema']!r}, this version reads {SCHEMA}")
        for key in ("arm", "kind", "why"):
            if not isinstance(data.get(key, ""), str):
                raise InputError(f"{key} is {data[key]!r}, must be text")
        joints = data.get("joints") or []
        if not (isinstance(joints, list) and all(isinstance(name, str) for name in joints)):
            raise InputError(f"joints is {joints!r}, must be a list of joint names, or left out for all")
        if len(set(joints)) != len(joints):
            raise InputError(f"joints names one twice: {joints}; name each once")
        parameters = data.get("parameters") or {}
        if not (isinstance(parameters, dict) and all(isinstance(k, str) for k in parameters)):
            raise InputError(f"parameters is {parameters!r}, must be names with numbers")
        return cls(data["arm"], data["kind"], tuple(joints), parameters, data.get("why", ""))


class _StrictLoader(yaml.SafeLoader):
    """Refuses a key that is given twice, where YAML would silently take the last."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        doubled = sorted({str(k) for k in keys if keys.count(k) > 1})
        if doubled:
            raise ConstructorError(None, None, f"key given twice: {', '.join(doubled)}", node.start_mark)
        return super().construct_mapping(node, deep)


def _checked(key: str, value: Any, rule: ExcitationParameter) -> float | tuple[float, ...]:
    if rule.is_list:
        if not isinstance(value, (list, tuple)) or not 1 <= len(value) <= 10:
            raise InputError(f"{key} is {value!r}, must be a list of 1 to 10 numbers [{rule.unit}]")
        numbers = tuple(_number(f"{key}[{i}]", v, rule) for i, v in enumerate(value))
        if rule.unit == "Hz" and not (len(numbers) == 2 and numbers[0] < numbers[1]):
            raise InputError(f"{key} is {list(numbers)}, must be two rising frequencies [low, high] [Hz]")
        return numbers
    return _number(key, value, rule)


def _number(key: str, value: Any, rule: ExcitationParameter) -> float:
    wanted = f"must be {'an integer' if rule.whole else 'a number'} from {rule.lower:g} to {rule.upper:g}"
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise InputError(f"{key} is {value!r}, {wanted} [{rule.unit}]")
    if not rule.lower <= value <= rule.upper or (rule.whole and value != int(value)):
        raise InputError(f"{key} is {value:g}, {wanted} [{rule.unit}]")
    return int(value) if rule.whole else float(value)
