"""Logs of depth and of stamps by a mapping alone, to files and to a report by the command line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from samrl_core.cell.types.reading_recording import ReadingRecording
from samrl_core.common.errors import InputError
from samrl_ros.cli.main import run
from samrl_ros.log_import.any_importer import import_any
from samrl_ros.recordings.reading_file import read_reading_file, reading_roles, shared_readings

MAPPING = {
    "sources": {
        "log": {
            "file": "{name}.csv",
            "time": {"rate_hz": 30},
            "columns": {"z": "depth", "d": "distance"},
            "missing": "drop_row",
        }
    },
    "readings": {"quantity": "depth", "reading": "z", "reference": "d", "unit": "mm"},
    "recordings": [{"name": "a"}, {"name": "b", "role": "held_out"}],
}


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    for seed, name in enumerate("ab"):
        rng = np.random.default_rng(seed)
        true = np.repeat([400.0, 700.0, 1000.0, 1300.0], 50)
        read = 1.012 * true + 1.5e-6 * true**2 * rng.standard_normal(200) * 1e3 / 1e3
        rows = [f"{d},{z if k != 7 else ''}" for k, (d, z) in enumerate(zip(true, read, strict=True))]
        (tmp_path / f"{name}.csv").write_text("distance,depth\n" + "\n".join(rows) + "\n")
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump(MAPPING))
    return tmp_path


def test_a_mapping_alone_gives_a_report(logs: Path) -> None:
    assert run(["bag", "import", str(logs / "mapping.yaml"), "--out", str(logs / "bags")]) == 0
    assert run(["diagnose", str(logs / "bags"), "--out", str(logs / "report"), "--apply"]) == 0
    assert "depth_scale@sensor:camera: (r - " in (logs / "report" / "apply" / "corrected.yaml").read_text()
    report = json.loads((logs / "report" / "report.json").read_text())
    assert report["verdict"] == "effect" and report["effects"][0]["family"] == "depth_scale"
    assert abs(report["effects"][0]["parameters"]["a"]["value"] - 0.012) < 1e-3
    read = read_reading_file(logs / "bags" / "a.readings.npz")
    assert len(read.reading) == 199 and read.reference[0] == 0.4
    same = [str(logs / "bags" / "a.readings.npz"), "--held-out", str(logs / "bags" / "a.readings.npz")]
    assert run(["diagnose", *same, "--out", str(logs / "again")]) == 3


@pytest.mark.parametrize(
    "key, value, message",
    [("unit", "s", "depth is in one of"), ("quantity", "colour", "quantity"), ("reading", "q", "not known")],
)
def test_bad_mappings_name_the_key(logs: Path, key: str, value: str, message: str) -> None:
    content = {**MAPPING, "readings": {**MAPPING["readings"], key: value}}
    (logs / "bad.yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(InputError, match=message) as caught:
        import_any(logs / "bad.yaml", logs, None)
    assert "recordings[0].readings" in str(caught.value) or "readings" in str(caught.value)


@pytest.mark.parametrize("key", ["files", "parts"])
def test_a_source_that_is_not_there_is_named(logs: Path, key: str) -> None:
    (logs / "bad.yaml").write_text(yaml.safe_dump({**MAPPING, key: {"nobody": "x.csv"}}))
    with pytest.raises(InputError, match=rf"recordings\[0\]\.{key}: no source \['nobody'\]; there are"):
        import_any(logs / "bad.yaml", logs, None)


def test_a_column_that_yaml_takes_for_yes_is_asked_for_in_quotes(logs: Path) -> None:
    content = {
        **MAPPING,
        "sources": {"log": {**MAPPING["sources"]["log"], "columns": {"d": True, "z": "depth"}}},
    }
    (logs / "bad.yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(InputError, match="in quotes"):
        import_any(logs / "bad.yaml", logs, None)


def test_whole_millimetres_repeat_by_chance_and_copies_do_not() -> None:
    """A depth camera's millimetres at four distances: two recordings share values, not their order."""

    def made(seed: int) -> ReadingRecording:
        true = np.repeat([0.4, 0.7, 1.0, 1.3], 100)
        read = np.round(1.012 * true + 3e-3 * true * np.random.default_rng(seed).standard_normal(400), 3)
        return ReadingRecording(f"wall{seed}", "made", f"{seed:064x}", "depth", "camera", true, read, true)

    fit, other = made(1), made(2)
    assert np.isin(other.reading, fit.reading).mean() > 0.9 and shared_readings(fit, other) == 0.0
    part = replace(fit, reading=fit.reading[120:300], reference=fit.reference[120:300], time=fit.time[:180])
    for same in (replace(fit, name="copy"), replace(part, name="part")):
        assert shared_readings(fit, same) > 0.5
        with pytest.raises(InputError, match="hold out what was not fitted"):
            reading_roles([fit], [same])
