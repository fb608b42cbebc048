"""A size that is reported is all of the error, not what of it lies beyond its own tolerance."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.diagnosis.effects import IMAGE_EFFECTS
from samrl_core.diagnosis.residuals.images.frames import chosen_frames, compared_size
from samrl_core.diagnosis.residuals.images.image_trial import ImageConstants, ImageTrial
from samrl_core.diagnosis.residuals.images.nominal import tolerance_columns
from samrl_core.diagnosis.residuals.images.scene import ImageScene
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence
from samrl_core.diagnosis.selection.whole_sizes import find_whole_sizes
from samrl_core.diagnosis.verdict.confidence import estimates

CORRELATION = 2.0


@pytest.fixture(scope="module")
def trial(recordings: list[ImageRecording]) -> ImageTrial:
    """Six frames whose residuals are a hand-eye beyond tolerance in noise, and nothing else."""
    scene = ImageScene(recordings[0], compared_size(recordings[0].intrinsics)[0])
    frames = chosen_frames(scene, recordings[0])[::4]
    made = ImageTrial(recordings[0], ImageConstants(scene, np.eye(4), {}), frames)
    rng, error = np.random.default_rng(3), np.array([0.001, -0.002, 0.001, 0.011, -0.004, 0.007])
    columns, residual = made.column("hand_eye"), {}
    for channel in made.channels:
        caused = error @ columns.get((channel, 0), np.zeros((6, len(made.sigma[channel]))))
        noise = made.sigma[channel][:, 0] * rng.standard_normal(len(made.sigma[channel]))
        residual[channel] = (caused + noise)[:, None]
    made.__dict__["residual"] = residual
    return made


def test_whole_sizes_are_those_of_effect_and_tolerance_fitted_together(trial: ImageTrial) -> None:
    """Against the posterior of all amplitudes and all tolerances with whole matrices."""
    likelihood = Likelihood([trial])
    evidence = Evidence(likelihood, CORRELATION)
    effects = [e for e in IMAGE_EFFECTS if e.family == "hand_eye"]
    h = evidence.screen(effects)[0]
    found = find_whole_sizes(evidence, fit := evidence.fit([h]))

    own = h.form.columns(trial, h.shape)
    effect = [({key: rows[[k]] for key, rows in own.items()}, width) for k, width in enumerate(h.spread)]
    parts = [*tolerance_columns(trial), *effect]
    design = np.zeros((len(likelihood.y), len(parts)))
    for k, (columns, width) in enumerate(parts):
        for (channel, _), rows in columns.items():
            design[likelihood.blocks[0, channel, 0], k] = width * rows[0] / trial.sigma[channel][:, 0]
    posterior = np.linalg.inv(design.T @ design / CORRELATION + np.eye(len(parts)))
    sizes = posterior @ design.T @ likelihood.y / CORRELATION
    together = np.zeros((6, len(parts)))
    together[:, :6] = np.diag([width for _, width in parts[:6]])  # the first tolerances are the hand-eye's
    together[:, -6:] = np.diag(h.spread)
    known = np.sqrt(np.diag(together @ posterior @ together.T))
    assert (np.abs(found.amplitudes[0] - together @ sizes) < 0.01 * known).all()
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), known, rtol=0.01)
    assert np.sqrt(found.covariance[3, 3]) < 0.6 * np.sqrt(fit.covariance[3, 3])
    turn = estimates(evidence, fit, 0, np.random.default_rng(0))["rx"]
    assert turn.ci95[0] < 0.011 < turn.ci95[1]
    assert turn.ci95[1] - turn.ci95[0] < 1.6 * trial.recording.tolerances.camera_rotation
