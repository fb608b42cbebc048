"""What the nominal model of each kind of recording leaves open."""

from __future__ import annotations

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.bodies.body_trial import BodyTrial
from samrl_core.diagnosis.residuals.bodies.nominal import tolerance_columns as columns_of_bodies
from samrl_core.diagnosis.residuals.bodies.nominal import unknown_columns as unknown_of_bodies
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial
from samrl_core.diagnosis.residuals.images.nominal import tolerance_columns as columns_of_images
from samrl_core.diagnosis.residuals.images.nominal import unknown_columns as unknown_in_images
from samrl_core.diagnosis.residuals.nominal import recording_columns as own_columns_of_arm
from samrl_core.diagnosis.residuals.nominal import tolerance_columns as columns_of_arm
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.poses.nominal import tolerance_columns as columns_of_poses
from samrl_core.diagnosis.residuals.poses.nominal import unknown_columns as unknown_in_poses
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial
from samrl_core.diagnosis.residuals.readings.reading_trial import ReadingTrial
from samrl_core.diagnosis.residuals.readings.reading_trial import tolerance_columns as columns_of_readings
from samrl_core.diagnosis.residuals.trial import Trial


def tolerance_columns(trial: Observed, widened: float = 1.0) -> list[tuple[Columns, float]]:
    """Regressors (one row each) and standard deviations; the same list for every recording of one system.

    `widened` times the stated tolerances.
    """
    if isinstance(trial, Trial):
        return columns_of_arm(trial, widened)
    if isinstance(trial, PoseTrial):
        return columns_of_poses(trial, widened)
    if isinstance(trial, ReadingTrial):
        return columns_of_readings(trial, widened)
    if isinstance(trial, BodyTrial):
        return columns_of_bodies(trial, widened)
    if isinstance(trial, ImageTrial):
        return columns_of_images(trial, widened)
    raise InputError(f"recordings of kind {trial.kind!r} state no tolerances")


def recording_columns(trial: Observed) -> list[tuple[Columns, float]]:
    """The same of what differs from recording to recording."""
    return own_columns_of_arm(trial) if isinstance(trial, Trial) else []


def unknown_columns(trial: Observed) -> np.ndarray:
    """Mask over the columns: what nobody stated and the recordings themselves gave."""
    if isinstance(trial, PoseTrial):
        return unknown_in_poses(trial)
    if isinstance(trial, BodyTrial):
        return unknown_of_bodies(trial)
    if isinstance(trial, ImageTrial):
        return unknown_in_images(trial)
    return np.zeros(len(tolerance_columns(trial)), dtype=bool)
