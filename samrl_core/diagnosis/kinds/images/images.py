"""Recordings of a cell's camera: images against the scene that the model knows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from samrl_core.cell.types.image_recording import LEAST_FRAMES, ImageRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects import IMAGE_EFFECTS
from samrl_core.diagnosis.export.recalibration import Recalibration
from samrl_core.diagnosis.kinds.images.image_corrections import recalibration
from samrl_core.diagnosis.kinds.images.image_suspects import image_suspicions
from samrl_core.diagnosis.kinds.images.light_advice import advise_on_light
from samrl_core.diagnosis.kinds.images.next_images import next_images
from samrl_core.diagnosis.kinds.kind import Kind
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial, prepared
from samrl_core.diagnosis.residuals.images.least_deviations import least_deviations
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.result import NextExperiment
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, Hypothesis
from samrl_core.diagnosis.selection.whole_sizes import find_whole_sizes
from samrl_core.diagnosis.verdict.how_far import HowFar

LEAST_ROWS = 40  # of depth, of a recording that tells of a camera
_SAME_M, _SAME_RAD = 1e-6, 1e-6


class Images(Kind[ImageRecording]):
    """Colour, depth and mask of one camera, moved by one arm, with the tool of the other in sight."""

    effects = IMAGE_EFFECTS
    elsewhere: ClassVar[dict[str, str]] = {
        "depth_dropout": "depth is compared where there is some",
        "rolling_shutter": "frames are compared as if all rows were exposed at once",
        "kinematic_error": "needs recorded poses; in images it is seen as hand-eye, bases or joint zeros",
    }
    shown_by = "recorded images"
    nothing = "no tile of the images can be compared with the model's scene"
    chance = 0.01

    def alike(self, recordings: Sequence[ImageRecording]) -> tuple[list[ImageRecording], list[str]]:
        first = recordings[0]
        for other in recordings[1:]:
            if other.intrinsics != first.intrinsics:
                raise InputError(
                    f"{other.name} has {other.intrinsics}, {first.name} {first.intrinsics}; diagnose one"
                    " camera at one resolution at a time"
                )
            if (other.task, other.cell, other.camera) != (first.task, first.cell, first.camera):
                raise InputError(
                    f"{other.name} is of {other.task} in {other.cell}, {first.name} of {first.task} in"
                    f" {first.cell}; diagnose one scene at a time"
                )
            for name in ("camera_in_flange", "camera_base_in_world", "tool_base_in_world"):
                a, b = getattr(first, name), getattr(other, name)
                if np.linalg.norm(a.position - b.position) > _SAME_M or a.angle_to(b) > _SAME_RAD:
                    raise InputError(
                        f"{other.name} and {first.name} state different calibrations ({name}); diagnose"
                        " recordings of one calibration"
                    )
        return list(recordings), []

    def trials(
        self, fit: Sequence[ImageRecording], held_out: Sequence[ImageRecording]
    ) -> tuple[list[Observed], list[Observed]]:
        made = prepared([*fit, *held_out], len(fit))
        return list(made[: len(fit)]), list(made[len(fit) :])

    def notes(self, trials: Sequence[Observed]) -> list[str]:
        """Frames that were compared, and tiles that show what the model does not know."""
        out = []
        for trial in trials:
            assert isinstance(trial, ImageTrial)
            out.append(
                f"{trial.name}: {len(trial.frames)} of {len(trial.recording.time)} images are compared"
            )
            if len(trial.residual.get("depth", ())) < LEAST_ROWS:
                out.append(
                    f"{trial.name}: hardly any tile has depth on table or object that model and mask agree on"
                )
            for channel, count in trial.outliers.items():
                total = len(trial.residual[channel])
                if count > 0.02 * total:
                    out.append(
                        f"{trial.name}: {count} of {total} tiles of {channel} stand apart from all others"
                        " (things that the model does not know) and hardly count"
                    )
        return out

    def system(self, trial: Observed) -> str:
        assert isinstance(trial, ImageTrial)
        return trial.recording.camera

    def cut(self, recording: ImageRecording) -> tuple[ImageRecording, ImageRecording]:
        return split_images(recording, 0.5)

    def doubts(self, evidence: Evidence, chosen: Fit | None, least: float) -> list[str]:
        return image_suspicions(evidence, chosen, least)

    def show_sooner(self, evidence: Evidence, pool: Sequence[Hypothesis], needed: float) -> list[str]:
        light = any(h.effect.family == "lighting" for h in pool)
        return advise_on_light(evidence, needed) if light else []

    def next_experiment(
        self, likelihood: Likelihood, fits: Sequence[Fit], names: Sequence[str], seed: int
    ) -> tuple[NextExperiment | None, str]:
        return next_images(likelihood, fits, names)

    def correction(
        self, evidence: Evidence, chosen: Fit, far: HowFar, sure: bool, rng: np.random.Generator
    ) -> Recalibration | None:
        if not sure:
            return None
        whole = find_whole_sizes(evidence, chosen)
        return recalibration(whole, [t for t in evidence.likelihood.trials if isinstance(t, ImageTrial)])

    def information(self, likelihood: Likelihood, fit: Fit) -> dict[str, dict[str, float]]:
        """Noise of tiles, with the object's pose, light and paint open."""
        trials = [t for t in likelihood.trials if isinstance(t, ImageTrial)]
        out = {}
        for h in fit.hypotheses:
            deviations = least_deviations(trials, h.regressors.blocks, len(h.spread))
            out[h.name] = h.form.parameters(trials[0], h.shape, deviations)
        return out


def split_images(
    recording: ImageRecording, held_out_share: float = 0.3
) -> tuple[ImageRecording, ImageRecording]:
    """First part to fit, last part to hold out.

    Raises:
        InputError: too few images to hold any out.
    """
    count = len(recording.time)
    kept = round((1.0 - held_out_share) * count)
    if min(kept, count - kept) < LEAST_FRAMES:
        least = round(LEAST_FRAMES / min(held_out_share, 0.5)) + 2
        raise InputError(f"{recording.name} has {count} images; at least {least} are needed to hold any out")
    return recording.part(np.arange(kept)), recording.part(np.arange(kept, count))
