"""A YAML mapping read key by key, so that every refusal names the exact key path."""

from __future__ import annotations

from typing import Any

from samrl_core.common.errors import InputError

_MISSING = object()


class Keys:
    """A mapping and its path. `end` refuses what nobody asked for: a misspelt key must not pass."""

    def __init__(self, value: Any, path: str) -> None:
        if not isinstance(value, dict):
            raise InputError(f"{path} is {_kind(value)}, must be a mapping of keys to values")
        self.path = path
        self._value = {str(k): v for k, v in value.items()}
        self._asked: set[str] = set()

    def at(self, key: str) -> str:
        """Path of a key."""
        return f"{self.path}.{key}" if not self.path.endswith(":") else f"{self.path} {key}"

    def has(self, key: str) -> bool:
        """Present and not null."""
        self._asked.add(key)
        return self._value.get(key) is not None

    def any(self, key: str, default: Any = _MISSING) -> Any:
        """A value of any kind. Raises `InputError` if it is missing and has no default."""
        self._asked.add(key)
        if self._value.get(key) is None:
            if default is _MISSING:
                raise InputError(f"{self.at(key)} is missing; present are {sorted(self._value)}")
            return default
        return self._value[key]

    def text(self, key: str, default: Any = _MISSING) -> Any:
        """A text."""
        return self._typed(key, default, str, "a text")

    def number(self, key: str, default: Any = _MISSING) -> Any:
        """A finite number."""
        value = self.any(key, default)
        if value is default:
            return value
        if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value:
            raise InputError(f"{self.at(key)} is {value!r}, must be a number")
        return float(value)

    def positive(self, key: str, default: Any = _MISSING) -> Any:
        """A number above zero."""
        value = self.number(key, default)
        if value is not default and not 0 < value < float("inf"):
            raise InputError(f"{self.at(key)} is {value}, must be above zero")
        return value

    def pair(self, key: str) -> tuple[float | None, float | None] | None:
        """[begin, end], either of which may be null."""
        value = self.any(key, None)
        if value is None:
            return None
        good = isinstance(value, list) and len(value) == 2
        if not good or not all(v is None or (isinstance(v, (int, float)) and v is not True) for v in value):
            raise InputError(f"{self.at(key)} is {value!r}, must be [begin, end]; null is open")
        return value[0], value[1]

    def list(self, key: str, default: Any = _MISSING) -> Any:
        """A list."""
        return self._typed(key, default, list, "a list")

    def keys(self, key: str, default: Any = _MISSING) -> Any:
        """A mapping inside, as `Keys`."""
        value = self.any(key, default)
        return value if value is default else Keys(value, self.at(key))

    def items(self) -> dict[str, Any]:
        """All of it; every key counts as asked for."""
        self._asked |= set(self._value)
        return dict(self._value)

    def end(self) -> None:
        """Raises `InputError` naming keys that nobody asked for, and those that could be."""
        if unknown := sorted(set(self._value) - self._asked):
            raise InputError(f"{self.at(unknown[0])} is not known here; known keys are {sorted(self._asked)}")

    def _typed(self, key: str, default: Any, kind: type, named: str) -> Any:
        value = self.any(key, default)
        if value is not default and not isinstance(value, kind):
            raise InputError(f"{self.at(key)} is {value!r}, must be {named}")
        return value


def _kind(value: Any) -> str:
    return "empty" if value is None else f"{type(value).__name__} {value!r}"[:80]
