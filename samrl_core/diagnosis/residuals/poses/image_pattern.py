"""Whether what a chain of poses leaves depends on where in the image the target stood, as a lens makes it.

A lens whose model is off bends the corners of a target, and its pose with them, by where it stands in the
image. Views at random hide that: from one to the next it scatters as noise does, and raises what is taken for
noise. A polynomial of the place in the image tells them apart: noise has none.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import f as fisher

from samrl_core.diagnosis.residuals.poses.pose_trial import CHANNELS, PoseTrial

DEGREE = 3  # of the polynomial: radial and tangential terms of a lens are of second and third order
VIEWS_A_TERM = 3  # fewer views than so many times its terms tell nothing
FAR_APART = 5.0  # standard deviations beyond which a detection is a mistake
CHANCE = 1e-6  # of such a pattern in noise, all channels together
SHIFTS = 60  # in time, of which each shows what errors that last explain by chance
BY_SHIFTS = 1.5  # times the most of them


def find_image_pattern(trial: PoseTrial) -> str:
    """What follows from the place in the image beyond the detector's lasting errors, in words; else empty.

    By Fisher's test of the polynomial against a constant, channel by channel. Errors of a stream that last
    over neighbouring views follow a slow path through the image by chance: shifted in time, they do as well.
    """
    left, _ = trial.left_in_noise
    kept = np.all(np.abs(left) < FAR_APART, axis=1)
    x, y, z = trial.seen_position[kept].T
    terms = _terms(x / z, y / z)
    count, rank = len(left[kept]), int(np.linalg.matrix_rank(terms))
    if rank < 2 or count < VIEWS_A_TERM * rank:
        return ""
    stated = trial.recording.tolerances
    lasting = np.array([stated.detection_position] * 3 + [stated.detection_rotation] * 3)
    found: tuple[float, str] | None = None
    for k, channel in enumerate(CHANNELS):
        values = left[kept, k]
        fitted = terms @ np.linalg.lstsq(terms, values, rcond=None)[0]
        rest = values - fitted
        whole = float(np.sum((values - values.mean()) ** 2))
        share = 1.0 - float(rest @ rest) / max(whole, 1e-300)
        if trial.recording.timed and share < BY_SHIFTS * _by_shifts(values, terms):
            continue
        chance = explained_by_chance(share, rank - 1, count - rank)
        noise = float(np.median(trial.sigma[channel]))
        does = float(np.std(fitted)) * noise
        if chance * len(CHANNELS) < CHANCE and does > lasting[k] and (found is None or share > found[0]):
            amount = f"{1e3 * does:.1f} {'mm' if trial.units[channel] == 'm' else 'mrad'}"
            found = share, f"{share:.0%} of what the chain leaves in {channel} ({amount})"
    if found is None:
        return ""
    return (
        f"{trial.name}: {found[1]} follows from where in the image the target stood: a lens whose model is"
        " off (principal point, distortion)? Calibrate the camera's intrinsics"
    )


def _terms(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Monomials (N, T) of the place in the image up to `DEGREE`, each of about unit size."""
    size = max(float(np.max(np.hypot(u, v))), 1e-6)
    u, v = u / size, v / size
    return np.stack([u**i * v**j for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)], axis=1)


def _by_shifts(values: np.ndarray, terms: np.ndarray) -> float:
    """The most that terms (N, T) explain of values (N,) shifted in time: of errors that last, and no lens."""
    basis = np.linalg.svd(terms, full_matrices=False)[0][:, : np.linalg.matrix_rank(terms)]
    centred = values - values.mean()
    shifts = np.linspace(0.1, 0.9, SHIFTS) * len(values)
    explained = [float(np.sum((basis.T @ np.roll(centred, round(shift))) ** 2)) for shift in shifts]
    return max(explained) / max(float(centred @ centred), 1e-300)


def explained_by_chance(share: float, terms: int, freedom: float) -> float:
    """Chance that noise lets so many terms explain such a share, by Fisher's distribution."""
    if freedom < 1.0:
        return 1.0
    return float(fisher.sf(share / terms / (max(1.0 - share, 1e-12) / freedom), terms, freedom))
