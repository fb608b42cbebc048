"""Pydantic models whose refusals read as ours do: file, key path, value, limit, remedy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from samrl_core.common.errors import InputError
from samrl_core.common.names import known_are

Model = TypeVar("Model", bound=BaseModel)

_WANTED = {  # pydantic's kinds of error
    "bool_type": "true or false",
    "dict_type": "a mapping of keys to values",
    "finite_number": "a finite number or null",
    "float_type": "a number",
    "int_from_float": "a whole number",
    "int_type": "a whole number",
    "list_type": "a list",
    "model_type": "a mapping of keys to values",
    "string_type": "text",
}


class Checked(BaseModel):
    """Base of models read from files: exact types, no unknown keys, null is as good as absent."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _keys(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        if unknown := sorted(map(str, set(value) - set(cls.model_fields))):
            listed = known_are(unknown[0], sorted(cls.model_fields), "known keys are")
            raise fault(f" is not known here; {listed}", unknown[0])
        return {key: each for key, each in value.items() if each is not None}

    @model_validator(mode="after")
    def _values(self) -> Self:
        try:
            self.require_sense()
        except InputError as error:
            raise fault(f": {error}") from error
        return self

    def require_sense(self) -> None:
        """Raise `InputError` for values that have the right types and are none all the same."""

    @classmethod
    def read(cls, value: Any, where: str) -> Self:
        """As `read_model`."""
        return read_model(cls, value, where)


def read_model(model: type[Model], value: Any, where: str) -> Model:
    """The model of `value`. Raises `InputError` with the key path below `where` of the first fault."""
    try:
        return model.model_validate(value)
    except ValidationError as error:
        raise InputError(explain(error, where)) from error


def fault(text: str, *below: str | int) -> PydanticCustomError:
    """What a validator raises: `text` follows the key path, of keys `below` the validated value."""
    return PydanticCustomError("fault", "{text}", {"text": text, "below": below})


def explain(error: ValidationError, where: str) -> str:
    """The first fault as `<where>.<key path> is <value>, must be <limit>`."""
    found = error.errors(include_url=False)
    first, context = found[0], found[0].get("ctx", {})
    path = key_path(where, [key for key in (*first["loc"], *context.get("below", ())) if key != "[key]"])
    kind, value, text = first["type"], first["input"], first["msg"]
    if kind == "fault":
        return f"{path}{text}"
    if kind == "missing":
        parent = first["loc"][:-1]
        missing = [str(e["loc"][-1]) for e in found if e["type"] == "missing" and e["loc"][:-1] == parent]
        present = f"; it has {sorted(map(str, value))}" if isinstance(value, dict) else ""
        return f"{key_path(where, parent)} lacks {', '.join(missing)}{present}"
    if kind == "literal_error":
        allowed = context["expected"].replace(" or ", ", ").replace("'", "")
        wanted = f"must be one of {allowed}"
    elif kind in _WANTED:
        wanted = f"must be {_WANTED[kind]}"
        if kind == "string_type" and isinstance(value, bool):
            wanted += "; YAML takes on, off, yes and no for true and false: quote it"
    else:
        wanted = f"{text[:1].lower()}{text[1:]}".replace("input should be", "must be")
    shown = repr(value)
    return f"{path} is {shown if len(shown) < 80 else shown[:77] + '...'}, {wanted}"


def key_path(where: str, keys: Sequence[str | int]) -> str:
    """`m.yaml:` and (`recordings`, 0, `name`) as `m.yaml: recordings[0].name`."""
    path = where
    for key in keys:
        separator = " " if path.endswith(":") else "." if path else ""
        path += f"[{key}]" if isinstance(key, int) else f"{separator}{key}"
    return path
