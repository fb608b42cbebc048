"""What a report.json of schema 1 must hold; used by whoever writes or checks one."""

from __future__ import annotations

import json
import math
import re
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from samrl_core.common.errors import InputError
from samrl_core.common.validation import fault, read_model

SCHEMA = 1
_KINDS = "joint, arm, link, body, sensor"
_PLACE = rf"cell|({_KINDS.replace(', ', '|')}):.+"


def _place(value: str) -> str:
    if not re.fullmatch(_PLACE, value, re.DOTALL):
        raise fault(f" is {value!r}, must be `cell` or one of {_KINDS}, a colon and a name")
    return value


def _effect_name(value: str) -> str:
    family, at, place = value.partition("@")
    if not (family and at):
        raise fault(f" is {value!r}, must be written `family@place`")
    _place(place)
    return value


def _version(value: int) -> int:
    if value != SCHEMA:
        raise fault(f" is {value!r}, must be {SCHEMA}")
    return value


def _fraction(value: float) -> float:
    if not 0 <= value <= 1:
        raise fault(f" is {value!r}, must be within 0 and 1")
    return value


def _pair(value: Any) -> Any:
    if isinstance(value, list) and len(value) != 2:
        raise fault(f" is {value!r}, must be a pair [low, high]")
    return value


Place = Annotated[str, AfterValidator(_place), Field(json_schema_extra={"pattern": f"^({_PLACE})$"})]
EffectName = Annotated[
    str, AfterValidator(_effect_name), Field(json_schema_extra={"pattern": f"^[^@]+@({_PLACE})$"})
]
Fraction = Annotated[float, AfterValidator(_fraction), Field(json_schema_extra={"minimum": 0, "maximum": 1})]
Interval = Annotated[
    list[float | None], BeforeValidator(_pair), Field(json_schema_extra={"minItems": 2, "maxItems": 2})
]


class _Part(BaseModel):
    """Exact types; every key must be there, null where nothing is known; extra keys are welcome."""

    model_config = ConfigDict(extra="allow", frozen=True, strict=True, allow_inf_nan=False)


class WhereEntry(_Part):
    """A part of the recordings in which the gap is significant."""

    place: Place
    channel: str
    phase: str
    t0: float | None = Field(description="in the recording [s]")
    t1: float | None = Field(description="in the recording [s]")
    share: float | None = Field(description="of the excess energy of all significant parts")


class ParameterEntry(_Part):
    """A parameter with its 95 % interval."""

    value: float | None
    unit: str
    ci95: Interval | None


class EffectEntry(_Part):
    """A named effect."""

    family: str
    place: Place
    probability: Fraction | None = Field(description="among all that were tried")
    parameters: dict[str, ParameterEntry]


class NextExperimentEntry(_Part):
    """The recording that would split the ambiguity set."""

    file: str = Field(description="relative to the report; `samrl excite` plays it")
    why: str
    separates: Fraction | None = Field(description="probability that the closest pair is told apart by it")


class HeldOutEntry(_Part):
    """How far the gap shrinks on recordings never fitted."""

    metric: str | None
    unit: str | None
    nominal: float | None
    with_effect: float | None
    runner_up: float | None
    runner_up_effect: str | None
    shrink: float | None = Field(description="1 - with_effect / nominal")
    ci95: Interval | None = Field(description="of `shrink`")


class GapEntry(_Part):
    """The gap in numbers."""

    held_out: HeldOutEntry


class InputEntry(_Part):
    """A bag that was read."""

    bag: str
    sha256: str
    role: Literal["fit", "held_out"]


class Report(_Part):
    """report.json of samrl, schema 1. What is not finite is null."""

    schema_: Annotated[int, AfterValidator(_version)] = Field(
        alias="schema", json_schema_extra={"const": SCHEMA}
    )
    verdict: Literal["no_gap", "effect", "ambiguous", "none_of_mine", "not_testable"]
    where: list[WhereEntry] = Field(description="strongest first")
    effects: list[EffectEntry]
    ambiguity_set: list[list[EffectName]]
    next_experiment: NextExperimentEntry | None
    gap: GapEntry
    unexplained_fraction: float | None
    not_testable: dict[str, str] = Field(description="reason by family")
    inputs: list[InputEntry]
    seed: int
    version: str

    @model_validator(mode="after")
    def _verdict_has_its_evidence(self) -> Report:
        if self.verdict == "effect" and not self.effects:
            raise fault(" is empty, but the verdict is `effect`; name at least one", "effects")
        if self.verdict == "ambiguous" and not any(len(names) > 1 for names in self.ambiguity_set):
            raise fault(" has no set of two, but the verdict is `ambiguous`", "ambiguity_set")
        return self


def check_report(report: object) -> None:
    """Accept a report of schema 1, with any extra keys.

    Raises:
        InputError: the first thing that is wrong, with its place in the report.
    """
    read_model(Report, report, "report")
    _refuse_infinite(report, "report")


def schema_text() -> str:
    """The JSON schema that is published as `msgs_docs/reference/report.schema.json`."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **Report.model_json_schema()}
    return json.dumps(schema, indent=1) + "\n"


def _refuse_infinite(value: object, where: str) -> None:
    """Keys beyond the schema hold no infinite number either."""
    if isinstance(value, float) and not math.isfinite(value):
        raise InputError(f"{where} is {value!r}, must be a finite number or null")
    if isinstance(value, dict):
        for key, item in value.items():
            _refuse_infinite(item, f"{where}.{key}")
    elif isinstance(value, list):
        for i, item in enumerate(value):
            _refuse_infinite(item, f"{where}[{i}]")
