"""Views whose turns are not the arm's: a board seen from another corner in many of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose_recording import PoseRecording, PoseTrack
from samrl_core.diagnosis.kinds.poses.poses import Poses
from samrl_core.diagnosis.residuals.poses.solve import closing_error
from tests.diagnosis.poses.pose_worlds import PoseWorld, record

VIEWS = 15


def recorded(turned: tuple[int, ...]) -> PoseRecording:
    """Pairs at rest with nothing stated; in some views the board is turned about its own axes."""
    whole = replace(record(PoseWorld(at_rest=True, seconds=8.0)), camera_in_flange=None, base_in_base=None)
    quat = whole.seen.quat_xyzw[:VIEWS].copy()
    for k in turned:
        other = Rotation.from_euler("zx", [np.pi, 0.2 * k])
        quat[k] = (Rotation.from_quat(quat[k]) * other).as_quat()
    return replace(whole, seen=PoseTrack(whole.seen.time[:VIEWS], whole.seen.position[:VIEWS], quat))


def test_a_chain_closes_on_the_views_that_agree() -> None:
    assert closing_error(recorded((2, 5, 6, 9, 12))) < 0.005


def test_many_views_that_turn_otherwise_are_told() -> None:
    kind = Poses()
    trials, _ = kind.trials([recorded((2, 5, 6, 9, 12))], [])
    assert any("5 of 15 poses turn otherwise" in note for note in kind.notes(trials))


def test_nothing_is_left_out_where_all_agree() -> None:
    kind = Poses()
    trials, _ = kind.trials([recorded(())], [])
    assert not any("turn otherwise" in note for note in kind.notes(trials))
