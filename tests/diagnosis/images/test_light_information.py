"""What images tell of a lamp: of its strength nothing but against known colours, whatever the views."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.diagnosis.residuals.images.expected import expected_scene, still_recording
from samrl_core.diagnosis.residuals.images.rows import Rows
from samrl_core.studies.light_information import (
    KNOWN,
    PAINTS,
    deviations,
    expected_frames,
    light_columns,
)

TASK = "peg_insertion"
VIEWS = 4


@pytest.fixture(scope="module")
def rows() -> Rows:
    scene = expected_scene(
        still_recording(TASK, DEFAULT_CELL, task_named(TASK).start_joints(cell_named(DEFAULT_CELL)))
    )
    return light_columns(scene, expected_frames(scene, VIEWS))


def test_strength_is_a_sum_of_paints_and_direction_is_not(rows: Rows) -> None:
    paints = np.concatenate([rows.columns[name] for name in PAINTS]).T / rows.shape[:, None]

    def beside(name: str) -> float:
        """Share of a column that no paint does."""
        column = rows.columns[name][0] / rows.shape
        made = paints @ np.linalg.lstsq(paints, column, rcond=None)[0]
        return float(np.linalg.norm(column - made) / np.linalg.norm(column))

    assert beside("strength") < 1e-6
    assert beside("azimuth") > 0.1
    # A lamp beside the room's light makes lit faces brighter than others: no paint does, another place may.
    assert beside("one lamp of several") > 0.01
    azimuth, elevation, lamp = (rows.columns[n][0] for n in ("azimuth", "elevation", "one lamp of several"))
    assert max(abs(np.corrcoef(a, b)[0, 1]) for a, b in ((azimuth, elevation), (azimuth, lamp))) < 0.9


def test_a_card_tells_the_strength_that_free_colours_do_not(rows: Rows) -> None:
    free, stated, card = (deviations(rows, known)["strength"] for known in KNOWN.values())
    assert free > 100.0
    assert card < 0.06 < 0.08 < stated < 0.1
    # Where the light comes from shows without any known colour.
    assert np.degrees(deviations(rows, KNOWN["colours free"])["azimuth"]) < 30.0
