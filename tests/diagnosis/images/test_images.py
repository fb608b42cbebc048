"""Images against the rendered scene: columns against differences, refusals, and effects that are named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.cell.types.observation import Frame
from samrl_core.cell.types.pose import Pose, rotation_vector
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.diagnose import diagnose
from samrl_core.diagnosis.effects.images.base_to_base import EFFECT as BASE
from samrl_core.diagnosis.effects.images.depth_scale import EFFECT as DEPTH_SCALE
from samrl_core.diagnosis.effects.images.encoder_offset import EFFECT as ZERO
from samrl_core.diagnosis.effects.images.hand_eye import EFFECT as HAND_EYE
from samrl_core.diagnosis.kinds.images.images import Images, split_images
from samrl_core.diagnosis.kinds.images.next_images import next_images
from samrl_core.diagnosis.residuals.images.frames import chosen_frames, compared_size
from samrl_core.diagnosis.residuals.images.image_trial import DEPTH_NOISE_PER_Z2, prepared
from samrl_core.diagnosis.residuals.images.object_pose import solved_object
from samrl_core.diagnosis.residuals.images.rows import frame_rows
from samrl_core.diagnosis.residuals.images.scene import ImageScene
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence
from samrl_core.diagnosis.verdict.how_far import HowFar


def test_columns_are_what_a_moved_camera_changes(recordings: list[ImageRecording]) -> None:
    """Rows before and after a small step, against the columns."""
    recording, step = recordings[0], np.array([0.002, 0.001, -0.0015])
    scene = ImageScene(recording, compared_size(recording.intrinsics)[0])
    frames = chosen_frames(scene, recording)
    pose = solved_object(scene, frames[:8], recording.tolerances, DEPTH_NOISE_PER_Z2)
    twist = np.concatenate([step, [0.004, -0.002, 0.003]])
    turned = Pose(twist[:3], rotation_vector(twist[3:]).quat_xyzw).matrix()
    for channel, agreement in (("depth", 0.95), ("mask", 0.85)):
        seen, expected = [], []
        for frame in frames[::6]:
            moved = replace(frame, view=replace(frame.view, camera=frame.view.camera @ turned))
            before, after = (frame_rows(scene, f, pose, DEPTH_NOISE_PER_Z2)[channel] for f in (frame, moved))
            keys = [list(zip(r.tile, np.round(r.shape, 9), strict=True)) for r in (before, after)]
            same = len(keys[0]) == len(keys[1]) and np.array_equal(before.tile, after.tile)
            if same:
                seen.append(before.value - after.value)
                expected.append(np.einsum("p,pn->n", twist, before.columns["hand_eye"]))
        assert seen, "no frame keeps its tiles"
        a, b = np.concatenate(seen), np.concatenate(expected)
        assert np.corrcoef(a, b)[0, 1] > agreement, channel


@pytest.mark.slow
def test_a_nominal_cell_leaves_little(recordings: list[ImageRecording]) -> None:
    """Another renderer's images of the nominal cell, within a millimetre of depth and a pixel of outline."""
    (trial,) = prepared(recordings[:1], 1)
    assert {"depth", "mask", "color"} <= set(trial.channels)
    assert float(np.sqrt(np.mean(trial.residual["depth"] ** 2))) < 0.001
    assert abs(float(np.median(trial.residual["mask"]))) < 0.3


def test_bad_images_are_refused(recordings: list[ImageRecording]) -> None:
    first = recordings[0]
    with pytest.raises(InputError, match="6 needed"):
        first.part(np.arange(1))
    with pytest.raises(InputError, match="shape"):
        replace(first, depth=first.depth[:, :64])
    with pytest.raises(InputError, match="is in 0 of"):
        prepared([replace(first, mask=np.zeros_like(first.mask))], 1)
    with pytest.raises(InputError, match="at least"):
        split_images(first.part(np.arange(8)))
    k = first.intrinsics
    other = replace(recordings[1], intrinsics=Intrinsics(k.width, k.height, 2 * k.fx, k.fy, k.cx, k.cy))
    with pytest.raises(InputError, match="one resolution"):
        Images().alike([first, other])


@pytest.mark.thorough
def test_nothing_is_named_in_a_nominal_cell(recordings: list[ImageRecording]) -> None:
    found, _ = diagnose(recordings[:1], recordings[1:])
    assert found.verdict == "no_gap", [e.name for e in found.effects]


@pytest.mark.slow
def test_a_fitted_hand_eye_corrects_the_calibration(recordings: list[ImageRecording]) -> None:
    """What `--apply` writes lies nearer to the camera than what was stated."""
    true = recordings[0].camera_in_flange
    turn = np.array([0.004, -0.003, 0.005])
    stated = true @ Pose(np.array([0.004, -0.003, 0.003]), rotation_vector(turn).quat_xyzw)
    trials = prepared([replace(recordings[0], camera_in_flange=stated)], 1)
    evidence = Evidence(Likelihood(trials))
    fitted = max((evidence.fit([h]) for h in evidence.screen([HAND_EYE])), key=lambda f: f.log_evidence)
    far, rng = HowFar(None, ()), np.random.default_rng(0)
    assert Images().correction(evidence, fitted, far, False, rng) is None
    found = Images().correction(evidence, fitted, far, True, rng)
    assert found is not None
    (transform,) = found.transforms
    assert transform.calibration == ("hand_eye", "camera_in_flange")
    assert found.cell.camera_in_flange is transform.found and not found.cell.numbers
    before, after = (
        np.linalg.norm(p.position - true.position) + 0.35 * p.angle_to(true)
        for p in (transform.stated, transform.found)
    )
    assert after < 0.5 * before


@pytest.mark.slow
def test_a_fitted_depth_corrects_the_images(recordings: list[ImageRecording]) -> None:
    """Depth by what `--apply` writes is the depth from before it was spoilt."""
    first = recordings[0]
    spoilt = (1.03 * first.depth + 0.006).astype(np.float32)
    trials = prepared([replace(first, depth=spoilt)], 1)
    evidence = Evidence(Likelihood(trials))
    fitted = max((evidence.fit([h]) for h in evidence.screen([DEPTH_SCALE])), key=lambda f: f.log_evidence)
    found = Images().correction(evidence, fitted, HowFar(None, ()), True, np.random.default_rng(0))
    assert found is not None and found.cell.effects == ("depth_scale@sensor:camera",)
    frame = Frame(0, first.color[0], spoilt[0], first.mask[0])
    mended = found.cell.frame(frame, first.intrinsics).depth
    near = np.isfinite(first.depth[0])
    assert np.median(np.abs(spoilt[0] - first.depth[0])[near]) > 0.012
    assert np.median(np.abs(mended - first.depth[0])[near]) < 0.002


@pytest.mark.slow
def test_what_no_motion_splits_is_said(recordings: list[ImageRecording]) -> None:
    """The last joint's zero and the hand-eye turn the camera alike; a base does not."""
    (trial,) = prepared(recordings[:1], 1)
    likelihood = Likelihood([trial])
    evidence = Evidence(likelihood)
    fits = [evidence.fit([h]) for h in evidence.screen([HAND_EYE, ZERO, BASE])]
    last = f"encoder_offset@joint:{trial.joints['camera'][-1]}"
    hand_eye, base = "hand_eye@sensor:camera", "base_to_base@cell"
    none, one = next_images(likelihood, fits, [hand_eye, last])
    assert none is None and "no motion of the camera splits" in one and "0.0 degrees" in one
    none, several = next_images(likelihood, fits, [hand_eye, base])
    assert none is None and "samrl excite --set camera" in several
