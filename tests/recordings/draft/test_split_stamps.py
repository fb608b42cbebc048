"""Times in two columns, and frames counted where some were lost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from samrl_core.common.errors import InputError
from samrl_ros.log_import.any_importer import import_any
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.importer import ImportedRecording

COUNT = 600
INDEX = np.delete(np.arange(COUNT), [40, 41, 250, 333])  # of samples; four were lost
ANGLE = np.sin(0.02 * INDEX) + 0.2


def draft_of(path: Path, header: str, rows: list[str]) -> Draft:
    path.write_text("\n".join([header, *rows]) + "\n")
    return draft_any([path], None, None)


@pytest.mark.parametrize(
    ("seconds", "rest", "key", "step"),
    [
        ("time_sec", "time_usec", "microseconds", 4_000),
        ("stamp_secs", "stamp_nsecs", "nanoseconds", 4_000_000),
        ("tv_sec", "tv_usec", "microseconds", 4_000),
        ("ZeitInSec", "ZeitInNanoSec", "nanoseconds", 4_000_000),  # KUKA Sunrise's DataRecorder
    ],
)
def test_a_stamp_in_two_columns_is_one_clock(
    tmp_path: Path, seconds: str, rest: str, key: str, step: int
) -> None:
    """The rest alone was taken: it starts anew every second, and most rows were left out."""
    whole = 1_000_000 if key == "microseconds" else 1_000_000_000
    at = 1605186000 * whole + 900 * step + step * INDEX
    rows = [f"{t // whole},{t % whole},{q:.6f}" for t, q in zip(at, ANGLE, strict=True)]
    draft = draft_of(tmp_path / "egm.csv", f"{seconds},{rest},q1", rows)
    assert draft.sources["states"]["time"] == {"column": seconds, key: rest}
    assert not any("starts anew" in question for question in draft.questions)


def test_microseconds_are_added_to_whole_seconds(tmp_path: Path) -> None:
    at = 900 * 4_000 + 4_000 * INDEX
    rows = [f"{7 + t // 1_000_000},{t % 1_000_000},{q:.6f}" for t, q in zip(at, ANGLE, strict=True)]
    (tmp_path / "egm.csv").write_text("\n".join(["s,us,q", *rows]) + "\n")
    time = {"column": "s", "microseconds": "us"}
    mapping: dict[str, Any] = {
        "joints": ["j"],
        "sources": {"log": {"file": "egm.csv", "time": time, "columns": {"q": "q"}}},
        "channels": {"states": {"position": ["q"]}},
        "recordings": [{"name": "one"}],
    }
    file = tmp_path / "mapping.yaml"
    file.write_text(yaml.safe_dump(mapping))
    (made,) = import_any(file, tmp_path, None).made
    assert isinstance(made, ImportedRecording)
    steps = np.diff(made.recording.states.time)
    np.testing.assert_allclose(steps, 0.004 * np.diff(INDEX), atol=1e-9)
    time["nanoseconds"] = "us"
    file.write_text(yaml.safe_dump(mapping))
    with pytest.raises(InputError, match="the rest of a second is one of them"):
        import_any(file, tmp_path, None)


def test_the_same_time_in_two_units_is_no_split_stamp(tmp_path: Path) -> None:
    rows = [f"{k},{1_000_000 * k},{q:.6f}" for k, q in zip(INDEX, ANGLE, strict=True)]
    draft = draft_of(tmp_path / "log.csv", "t_s,t_us,q1", rows)
    assert set(draft.sources["states"]["time"]) == {"column", "unit"}


def test_frames_that_were_lost_keep_their_time(tmp_path: Path) -> None:
    """Rows at even steps would move all that follows a lost frame."""
    rows = [f"{k},{q:.6f},{0.02 * np.cos(0.02 * k) * 400:.6f}" for k, q in zip(INDEX, ANGLE, strict=True)]
    draft = draft_of(tmp_path / "film.csv", "frame,q1,dq1", rows)
    assert draft.sources["states"]["time"] == {"column": "frame", "rate_hz": 400.0}
    asked = "\n".join(draft.questions)
    assert "is the rate 400 Hz?" in asked
