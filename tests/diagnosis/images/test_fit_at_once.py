"""All numbers of a correction fitted to images at once: together they bring the camera back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.cell.types.pose import Pose
from samrl_core.studies.fit_at_once import fit_at_once

BEFORE_CAMERA = np.array([0.0, 0.0, 0.35, 1.0])  # what it looks at [m]


@pytest.mark.slow
def test_a_wrong_hand_eye_is_made_up_for(recordings: list[ImageRecording]) -> None:
    """In the nominal cell, a calibration that is 9 mm and 1.5 degrees off, from 6 s of images.

    More than half of what it does to where the tool sees things goes. Not all of it: what looks alike (bases,
    depth, lens) takes a share each, which is what the fit is there to show beside a diagnosis.
    """
    true = recordings[0]
    off = Pose.from_rpy(np.array([0.006, -0.005, 0.004]), (0.02, -0.015, 0.01))
    stated = replace(true, camera_in_flange=true.camera_in_flange @ off)
    found = fit_at_once([stated])
    assert found.camera_in_flange is not None and found.tool_base_in_camera_base is not None
    before = seen_from_tool(true, stated.camera_in_flange, bases_of(stated))
    after = seen_from_tool(true, found.camera_in_flange, found.tool_base_in_camera_base)
    wanted = seen_from_tool(true, true.camera_in_flange, bases_of(true))
    left = np.linalg.norm(after - wanted, axis=1)
    off_before = np.linalg.norm(before - wanted, axis=1)
    assert off_before.min() > 0.008
    assert (left < 0.5 * off_before).all(), left


def bases_of(recording: ImageRecording) -> Pose:
    """The tool arm's base in the camera arm's."""
    return recording.camera_base_in_world.inverse() @ recording.tool_base_in_world


def seen_from_tool(recording: ImageRecording, camera_in_flange: Pose, bases: Pose) -> np.ndarray:
    """Points (N, 3) before the camera in the tool arm's base, at every tenth image [m]."""
    from samrl_core.cell.robots.arm_model import ArmModel
    from samrl_core.cell.robots.cells import cell_named

    arm = ArmModel(cell_named(recording.cell).camera_arm, Pose.from_matrix(np.eye(4)), None)
    points = []
    for time in recording.time[5:-5:10]:
        flange = arm.flange_in_base(recording.joints_at("camera", float(time)))
        points.append((bases.inverse() @ flange @ camera_in_flange).matrix() @ BEFORE_CAMERA)
    return np.array(points)[:, :3]
