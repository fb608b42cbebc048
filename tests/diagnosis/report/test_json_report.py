"""report.json keeps the contract's schema for every verdict, and refuses what breaks it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.report.json_report import json_text, read_report, to_json
from samrl_core.diagnosis.report.report_schema import check_report, schema_text
from samrl_core.diagnosis.result import VERDICTS
from tests.diagnosis.report import samples

CONTRACT_KEYS = {
    "schema", "verdict", "where", "effects", "ambiguity_set", "next_experiment", "gap",
    "unexplained_fraction", "not_testable", "inputs", "seed", "version",
}  # fmt: skip
HELD_OUT_KEYS = {
    "metric",
    "unit",
    "nominal",
    "with_effect",
    "runner_up",
    "runner_up_effect",
    "shrink",
    "ci95",
}


@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_key_of_the_contract_stands_in_every_report(verdict: str) -> None:
    report = to_json(samples.diagnosis(verdict))
    assert set(report) >= CONTRACT_KEYS
    assert set(report["gap"]["held_out"]) >= HELD_OUT_KEYS
    assert report["schema"] == 1 and report["verdict"] == verdict


@pytest.mark.parametrize("verdict", VERDICTS)
def test_written_and_read_again_it_is_the_same(verdict: str, tmp_path: Path) -> None:
    report = to_json(samples.diagnosis(verdict))
    (tmp_path / "report.json").write_text(json_text(report))
    assert read_report(tmp_path / "report.json") == report
    assert [p.name for p in tmp_path.iterdir()] == ["report.json"]  # nothing temporary is left
    strict = (tmp_path / "report.json").read_text()
    assert json.loads(strict, parse_constant=lambda name: pytest.fail(f"{name} in the file")) == report


def test_figures_arrive_unchanged() -> None:
    report = to_json(samples.diagnosis("effect"))
    effect = report["effects"][0]
    assert (effect["family"], effect["place"]) == ("coulomb_friction", "joint:panda_joint4")
    assert effect["parameters"]["Fc"] == {"value": 0.412, "unit": "N m", "ci95": [0.381, 0.443]}
    assert report["gap"]["held_out"]["shrink"] == 0.83
    assert report["where"][2]["onset"] == 3.25
    assert report["settings"]["rollouts"] == 120


def test_what_is_not_finite_becomes_null() -> None:
    d = samples.diagnosis("effect")
    assert d.heatmap is not None and np.isnan(d.heatmap.values).any()
    report = to_json(replace(d, unexplained_fraction=float("inf")))
    assert report["unexplained_fraction"] is None
    assert report["heatmap"]["values"][0][0] is None
    json.dumps(report, allow_nan=False)


def test_nothing_known_is_null_with_all_keys() -> None:
    report = to_json(samples.diagnosis("not_testable"))
    assert report["next_experiment"] is None and report["effects"] == []
    assert all(report["gap"]["held_out"][key] is None for key in HELD_OUT_KEYS)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("verdict",), "maybe", "report.verdict is 'maybe', must be one of no_gap"),
        (("schema",), 2, "report.schema is 2, must be 1"),
        (("schema",), True, "report.schema is True, must be a whole number"),
        (("seed",), 1.5, "report.seed is 1.5, must be a whole number"),
        (("unexplained_fraction",), float("nan"), "must be a finite number or null"),
        (("effects",), [], "report.effects is empty"),
        (("effects", 0, "probability"), 1.2, "within 0 and 1"),
        (("effects", 0, "place"), "panda_joint4", r"report.effects\[0\].place is 'panda_joint4'"),
        (("effects", 0, "parameters", "Fc", "ci95"), [0.1], "must be a pair"),
        (("ambiguity_set",), [["backlash"]], "written `family@place`"),
        (("gap",), {}, "report.gap lacks held_out"),
        (("not_testable",), {"backlash": None}, "report.not_testable.backlash is None, must be text"),
        (("inputs", 0, "role"), "training", "one of fit, held_out"),
        (("timings", "fit"), float("inf"), "report.timings.fit is inf"),
    ],
)
def test_a_broken_report_is_refused_with_the_place(path: tuple, value: object, message: str) -> None:
    report = to_json(samples.diagnosis("effect"))
    inner = report
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    with pytest.raises(InputError, match=message):
        check_report(report)


def test_a_missing_key_is_named() -> None:
    report = to_json(samples.diagnosis("no_gap"))
    del report["seed"], report["version"]
    with pytest.raises(InputError, match="report lacks seed, version"):
        check_report(report)


def test_a_broken_report_does_not_replace_a_good_one(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    report = to_json(samples.diagnosis("no_gap"))
    path.write_text(json_text(report))
    with pytest.raises(InputError):
        json_text({**report, "verdict": ""})
    assert read_report(path) == report


def test_settings_that_json_cannot_hold_are_refused() -> None:
    with pytest.raises(InputError, match=r"report.settings.solver is a object"):
        to_json(replace(samples.diagnosis("no_gap"), settings={"solver": object()}))


@pytest.mark.parametrize("content", [None, "{", "[]", '{"schema": 1}'])
def test_reading_what_is_no_report_says_so(content: str | None, tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match="report"):
        read_report(path)


PUBLISHED = Path(__file__).resolve().parents[3] / "msgs_docs" / "reference" / "report.schema.json"


@pytest.mark.parametrize("verdict", VERDICTS)
def test_reports_hold_the_published_schema(verdict: str) -> None:
    schema = json.loads(PUBLISHED.read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(to_json(samples.diagnosis(verdict)), schema, jsonschema.Draft202012Validator)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("verdict",), "maybe"),
        (("schema",), 2),
        (("effects", 0, "place"), "panda_joint4"),
        (("effects", 0, "probability"), 1.2),
        (("effects", 0, "parameters", "Fc", "ci95"), [0.1]),
        (("gap",), {}),
        (("ambiguity_set",), [["backlash"]]),
    ],
)
def test_the_published_schema_refuses_what_the_program_refuses(path: tuple, value: object) -> None:
    report = to_json(samples.diagnosis("effect"))
    inner = report
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(report, json.loads(PUBLISHED.read_text()), jsonschema.Draft202012Validator)


def test_the_published_schema_is_current() -> None:
    assert PUBLISHED.read_text() == schema_text(), "run `make docs`"
