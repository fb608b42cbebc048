"""From which size on an effect is seen: half of the errors of that size reach the evidence of a name."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.diagnosis.effects import POSE_EFFECTS
from samrl_core.diagnosis.kinds.poses.poses import Poses, split_poses
from samrl_core.diagnosis.report import words
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.tolerances import recording_columns, tolerance_columns
from samrl_core.diagnosis.selection.hypothesis import Evidence
from samrl_core.diagnosis.selection.least_sizes import least_sizes
from tests.diagnosis.poses.pose_worlds import PoseWorld, record

NEEDED, DRAWS = 8.0, 400


def test_half_of_the_errors_of_the_least_size_reach_what_a_name_needs() -> None:
    """Residuals drawn from noise, tolerances and the error; evidence with whole covariance matrices."""
    trials, _ = Poses().trials([split_poses(record(PoseWorld(seconds=8.0)))[0]], [])
    likelihood = Likelihood(trials)
    evidence = Evidence(likelihood, 1.0)
    effects = [e for e in POSE_EFFECTS if e.family == "hand_eye"]
    told = {s.parameter: s for s in least_sizes(evidence, effects, NEEDED)}
    (h,) = evidence.screen(effects)[:1]
    noise = np.concatenate([trials[0].sigma[c][:, j] for _, c, j in likelihood.blocks])
    count = len(likelihood.y)

    def stacked(columns: dict) -> np.ndarray:
        rows = {b: columns[b[1:]] for b in likelihood.blocks if b[1:] in columns}
        out = np.zeros((len(next(iter(rows.values()))), count))
        for block, values in rows.items():
            out[:, likelihood.blocks[block]] = values
        return (out / noise).T

    parts = [*tolerance_columns(trials[0], 1.0), *recording_columns(trials[0])]
    u = np.concatenate([std * stacked(columns) for columns, std in parts], axis=1)
    x = stacked(h.form.columns(trials[0], h.shape))
    tolerated = np.eye(count) + u @ u.T
    wide = tolerated + (x * h.spread**2) @ x.T
    more = np.linalg.inv(tolerated) - np.linalg.inv(wide)
    cost = 0.5 * (np.linalg.slogdet(wide)[1] - np.linalg.slogdet(tolerated)[1])
    cost += np.log(h.tried) + h.cost
    rng = np.random.default_rng(0)
    drawn = rng.standard_normal((DRAWS, count)) + rng.standard_normal((DRAWS, u.shape[1])) @ u.T

    def named(size: float) -> float:
        y = drawn + size * x[:, 0]
        return float(np.mean(0.5 * np.einsum("ij,ij->i", y @ more, y) - cost >= NEEDED))

    size = told["x"].stated[1]
    # Noise adds half a nat for each of six amplitudes, so that it is rather more than half.
    assert named(0.5 * size) < 0.1 and 0.4 < named(size) < 0.85 and named(1.5 * size) > 0.95
    assert told["x"].exact[1] < size


@pytest.mark.parametrize(
    ("ends", "unit", "shown"),
    [
        ((-0.0022, 0.0022), "m", "± 0.0022 m"),
        ((-0.41, 0.68), "1", "-0.41 or 0.68"),
        ((-0.41, float("nan")), "1", "-0.41"),
        ((float("nan"), float("nan")), "s", "–"),
    ],
)
def test_sizes_are_written_down_and_up(ends: tuple[float, float], unit: str, shown: str) -> None:
    assert words.least(ends, unit) == shown
