"""Pydantic models whose refusals read as ours do: file, key path, value, limit, remedy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from samrl_core.common.errors import InputError


class Checked(BaseModel):
    """Base of models read from files: exact types, no unknown keys, null is as good as absent."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _keys(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        if unknown := sorted(map(str, set(value) - set(cls.model_fields))):
            raise fault(f" is not known here; known keys are {sorted(cls.model_fields)}", unknown[0])
        return {key: each for key, each in value.items() if each is not None}

    @classmethod
    def read(cls, value: Any, where: str) -> Self:
        """The model of `value`. Raises `InputError` with the key path below `where` of the first fault."""
        try:
            return cls.model_validate(value)
        except ValidationError as error:
            raise InputError(explain(error, where)) from error


def fault(text: str, *below: str | int) -> PydanticCustomError:
    """What a validator raises: `text` follows the key path, of keys `below` the validated value."""
    return PydanticCustomError("fault", "{text}", {"text": text, "below": below})


def explain(error: ValidationError, where: str) -> str:
    """The first fault as `<where>.<key path> is <value>, must be <limit>`."""
    first = error.errors(include_url=False)[0]
    context: dict[str, Any] = first.get("ctx", {})
    path = key_path(where, [key for key in (*first["loc"], *context.get("below", ())) if key != "[key]"])
    kind, value, text = first["type"], first["input"], first["msg"]
    shown = "empty" if value is None else f"{value!r}"[:80]
    if kind == "fault":
        return f"{path}{text}"
    if kind == "missing":
        present = sorted(value) if isinstance(value, dict) else "none"
        return f"{path} is missing; present are {present}"
    if kind == "literal_error":
        allowed = context["expected"].replace(" or ", ", ").replace("'", "")
        return f"{path} is {shown}, must be one of {allowed}"
    if kind == "model_type":
        return f"{path} is {shown}, must be a mapping of keys to values"
    return f"{path} is {shown}, {text[:1].lower()}{text[1:]}".replace("input should be", "must be")


def key_path(where: str, keys: Sequence[str | int]) -> str:
    """`m.yaml:` and (`recordings`, 0, `name`) as `m.yaml: recordings[0].name`."""
    path = where
    for key in keys:
        separator = " " if path.endswith(":") else "." if path else ""
        path += f"[{key}]" if isinstance(key, int) else f"{separator}{key}"
    return path
