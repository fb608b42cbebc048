"""Series that hold their time beside their numbers, as structs of MATLAB's timeseries do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.io import savemat

from samrl_ros.log_import.draft.any_draft import draft_any
from tests.recordings.logs.made_logs import urdf_of

TIME = np.arange(0.0, 1.5, 0.008)
ANGLE = np.column_stack([np.sin(2.0 * TIME), np.cos(3.0 * TIME)])


def test_the_time_of_a_series_is_its_clock(tmp_path: Path) -> None:
    path = tmp_path / "run.mat"
    series = {
        name: {"Name": name, "Time": TIME[:, None], "Data": numbers}
        for name, numbers in (("position", ANGLE), ("torque", 2.0 * ANGLE))
    }
    savemat(path, {"log": series})
    draft = draft_any([path], urdf_of(("shoulder", "elbow")), None)
    (source,) = draft.sources.values()
    assert source["time"] == {"column": "log.position.Time", "unit": "s"}
    assert not any("rate" in question for question in draft.questions)
