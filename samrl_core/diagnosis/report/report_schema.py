"""What a report.json of schema 1 must hold; used by whoever writes or judges one."""

from __future__ import annotations

import math
from collections.abc import Callable

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.result import VERDICTS

SCHEMA = 1
KINDS_OF_PLACE = ("joint", "arm", "link", "body", "sensor")

Check = Callable[[object, str], None]


def check_report(report: object) -> None:
    """Accept a report of schema 1, with any extra keys.

    Raises:
        InputError: the first thing that is wrong, with its place in the report.
    """
    _record(
        {
            "schema": _schema,
            "verdict": _one_of(VERDICTS),
            "where": _list_of(_record(_WHERE)),
            "effects": _list_of(_record(_EFFECT)),
            "ambiguity_set": _list_of(_list_of(_effect_name)),
            "next_experiment": _or_null(
                _record({"file": _text, "why": _text, "separates": _or_null(_fraction)})
            ),
            "gap": _record({"held_out": _record(_HELD_OUT)}),
            "unexplained_fraction": _or_null(_number),
            "not_testable": _mapping_of(_text),
            "inputs": _list_of(
                _record({"bag": _text, "sha256": _text, "role": _one_of(("fit", "held_out"))})
            ),
            "seed": _integer,
            "version": _text,
        }
    )(report, "report")
    assert isinstance(report, dict)
    _all_finite(report, "report")
    if report["verdict"] == "effect" and not report["effects"]:
        raise InputError("report.effects is empty, but the verdict is `effect`; name at least one")
    if report["verdict"] == "ambiguous" and not any(len(names) > 1 for names in report["ambiguity_set"]):
        raise InputError("report.ambiguity_set has no set of two, but the verdict is `ambiguous`")


def _fail(where: str, value: object, wanted: str) -> InputError:
    shown = repr(value)
    return InputError(f"{where} is {shown if len(shown) < 80 else shown[:77] + '...'}, must be {wanted}")


def _schema(value: object, where: str) -> None:
    if value != SCHEMA or isinstance(value, bool):
        raise _fail(where, value, f"{SCHEMA}")


def _text(value: object, where: str) -> None:
    if not isinstance(value, str):
        raise _fail(where, value, "text")


def _integer(value: object, where: str) -> None:
    if not isinstance(value, int) or isinstance(value, bool):
        raise _fail(where, value, "a whole number")


def _number(value: object, where: str) -> None:
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise _fail(where, value, "a number")


def _fraction(value: object, where: str) -> None:
    _number(value, where)
    if not 0 <= value <= 1:  # type: ignore[operator]
        raise _fail(where, value, "within 0 and 1")


def _place(value: object, where: str) -> None:
    _text(value, where)
    assert isinstance(value, str)
    kind, _, name = value.partition(":")
    if value != "cell" and not (kind in KINDS_OF_PLACE and name):
        raise _fail(where, value, f"`cell` or one of {', '.join(KINDS_OF_PLACE)}, a colon and a name")


def _effect_name(value: object, where: str) -> None:
    _text(value, where)
    assert isinstance(value, str)
    family, at, place = value.partition("@")
    if not (family and at):
        raise _fail(where, value, "written `family@place`")
    _place(place, where)


def _one_of(allowed: tuple[str, ...]) -> Check:
    def check(value: object, where: str) -> None:
        if value not in allowed:
            raise _fail(where, value, f"one of {', '.join(allowed)}")

    return check


def _or_null(inner: Check) -> Check:
    def check(value: object, where: str) -> None:
        if value is not None:
            inner(value, where)

    return check


def _list_of(inner: Check) -> Check:
    def check(value: object, where: str) -> None:
        if not isinstance(value, list):
            raise _fail(where, value, "a list")
        for i, item in enumerate(value):
            inner(item, f"{where}[{i}]")

    return check


def _mapping_of(inner: Check) -> Check:
    def check(value: object, where: str) -> None:
        if not isinstance(value, dict):
            raise _fail(where, value, "a mapping")
        for key, item in value.items():
            _text(key, where)
            inner(item, f"{where}.{key}")

    return check


def _record(keys: dict[str, Check]) -> Check:
    def check(value: object, where: str) -> None:
        if not isinstance(value, dict):
            raise _fail(where, value, "a mapping")
        if missing := [key for key in keys if key not in value]:
            raise InputError(f"{where} lacks {', '.join(missing)}")
        for key, inner in keys.items():
            inner(value[key], f"{where}.{key}")

    return check


def _pair(value: object, where: str) -> None:
    _list_of(_or_null(_number))(value, where)
    assert isinstance(value, list)
    if len(value) != 2:
        raise _fail(where, value, "a pair [low, high]")


def _all_finite(value: object, where: str) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise _fail(where, value, "a finite number or null")
    if isinstance(value, dict):
        for key, item in value.items():
            _all_finite(item, f"{where}.{key}")
    elif isinstance(value, list):
        for i, item in enumerate(value):
            _all_finite(item, f"{where}[{i}]")


_WHERE: dict[str, Check] = {
    "place": _place,
    "channel": _text,
    "phase": _text,
    "t0": _or_null(_number),
    "t1": _or_null(_number),
    "share": _or_null(_number),
}
_PARAMETER: dict[str, Check] = {"value": _or_null(_number), "unit": _text, "ci95": _or_null(_pair)}
_EFFECT: dict[str, Check] = {
    "family": _text,
    "place": _place,
    "probability": _or_null(_fraction),
    "parameters": _mapping_of(_record(_PARAMETER)),
}
_HELD_OUT: dict[str, Check] = {
    "metric": _or_null(_text),
    "unit": _or_null(_text),
    "nominal": _or_null(_number),
    "with_effect": _or_null(_number),
    "runner_up": _or_null(_number),
    "runner_up_effect": _or_null(_text),
    "shrink": _or_null(_number),
    "ci95": _or_null(_pair),
}
