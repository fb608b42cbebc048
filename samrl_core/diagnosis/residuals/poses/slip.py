"""Whether something moved while poses were recorded: one transform differs from one view on, or steadily."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from samrl_core.diagnosis.residuals.poses.image_pattern import explained_by_chance
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial

LEAST_VIEWS = 6  # on either side
GRID = 40  # moments at which a slip is looked for first
FAR_APART = 6.0  # typical deviations that a view counts at most: a mistake is no slip
MISTAKEN, MOST_MISTAKES = 0.4, 0.15  # weight of a view that is one, and their share up to which they are told
EXPLAINED = 0.5  # of what the chain leaves, by one change of one transform
CHANCE = 1e-6  # of it in noise
LARGE = 3.0  # times the stated lasting errors of the detector
ROUNDS = 4
WHAT = {"camera": "the camera", "base": "the target or a base", "target": "the target on its flange"}


def find_slip(trial: PoseTrial) -> str:
    """Since when one transform of the chain differs, which, and by how much, in words; else empty.

    One that changes evenly from the first view to the last explains more by that than by any one moment.
    The moment and the transform whose change explains most are looked for; constants that differ all along
    are out of it. Mistakes of a detector have no transform in common, and explain little together.
    """
    count = len(trial.seen_position)
    if count < 2 * LEAST_VIEWS:
        return ""
    left, columns = trial.left_in_noise
    typical = 1.4826 * np.median(np.abs(left), axis=0)
    u, strength, _ = np.linalg.svd(columns.reshape(len(columns), -1).T, full_matrices=False)
    basis = u[:, strength > 1e-9 * strength[0]]
    clipped = np.clip(left, -FAR_APART * typical, FAR_APART * typical).reshape(-1)
    noise = trial.noise.at(trial.views)
    links = {name: trial.at_target(twists) / noise for name, twists in trial.links.items()}
    tried = _explained_since(clipped, basis, links)
    # Even clipped, a few gross mistakes leave as much as a slip: they count by how far they are from it.
    begin, weight = max(tried, key=tried.__getitem__), np.ones(clipped.size)
    for _ in range(ROUNDS):
        weight = _weights(clipped, np.hstack([basis, _since(links[tried[begin][1]], begin)]), weight, count)
    if (weight < MISTAKEN).mean() > MOST_MISTAKES:
        weight = np.ones(clipped.size)  # so many may be left out that what fits the others is found
    values, basis = clipped * weight, np.linalg.qr(basis * weight[:, None])[0]
    links = {key: link * weight.reshape(count, -1) for key, link in links.items()}
    tried = _explained_since(values, basis, links)
    begin = max(tried, key=tried.__getitem__)
    share, name = tried[begin]
    values, design = values - basis @ (basis.T @ values), _since(links[name], begin)
    steady, drifting = max(
        (_explained(values, basis, _over_time(link, trial)), k) for k, link in links.items()
    )
    if steady > share:
        share, name, design = steady, drifting, _over_time(links[drifting], trial)
    change, rest = _robust_fit(design - basis @ (basis.T @ design), values, count)
    alike = _samples_that_count_as_one(rest) if trial.recording.timed else 1.0
    # The moment and the transform were looked for, which takes as many terms again.
    chance = explained_by_chance(share, 12, 6 * count / alike - basis.shape[1] - 12)
    stated = trial.recording.tolerances
    size = np.linalg.norm(change[:3]), np.linalg.norm(change[3:])
    small = size[0] < LARGE * stated.detection_position and size[1] < LARGE * stated.detection_rotation
    if share < EXPLAINED or chance * len(tried) > CHANCE or small:
        return ""
    if steady == share:
        return (
            f"{trial.name}: {WHAT[name]} moves steadily as time passes, by {1e3 * size[0]:.1f} mm and"
            f" {1e3 * size[1]:.1f} mrad from the first view to the last: an odometry or a map that drifts, or"
            " what gives way under load"
        )
    return (
        f"{trial.name}: from {trial.chain.time[begin]:g} s (or row) on {WHAT[name]} sits elsewhere, by"
        f" {1e3 * size[0]:.1f} mm and {1e3 * size[1]:.1f} mrad, than before: it slipped or was pushed;"
        " diagnose both parts by themselves, as `rows` or `time_range` in a mapping cuts them"
    )


def _explained_since(
    values: np.ndarray, basis: np.ndarray, links: Mapping[str, np.ndarray]
) -> dict[int, tuple[float, str]]:
    """The share of what a basis leaves that a change of one link explains, and which, by its first view."""
    count = next(iter(links.values())).shape[1]
    values = values - basis @ (basis.T @ values)

    def explains(begin: int) -> tuple[float, str]:
        return max((_explained(values, basis, _since(link, begin)), name) for name, link in links.items())

    step = max(1, (count - 2 * LEAST_VIEWS) // GRID)
    tried = {k: explains(k) for k in range(LEAST_VIEWS, count - LEAST_VIEWS + 1, step)}
    near = max(tried, key=tried.__getitem__)
    return tried | {
        k: explains(k)
        for k in range(max(near - step, LEAST_VIEWS), min(near + step, count - LEAST_VIEWS) + 1)
        if k not in tried
    }


def _weights(values: np.ndarray, design: np.ndarray, weight: np.ndarray, views: int) -> np.ndarray:
    """Roots of Cauchy weights (M,), one for each view, about the fit of a design with the weights before."""
    found = np.linalg.lstsq(design * weight[:, None], values * weight, rcond=1e-6)[0]
    left = (values - design @ found).reshape(views, -1)
    size = np.sqrt(np.mean(left**2, axis=1))
    level = max(float(np.median(size)), 1e-9)
    return np.repeat(1.0 / np.sqrt(1.0 + (size / (2.5 * level)) ** 2), left.shape[1])


def _since(link: np.ndarray, begin: int) -> np.ndarray:
    """Columns (6 N, 6) of a link's twists (6, N, 6) that are there from one view on."""
    out = link.copy()
    out[:, :begin] = 0.0
    return out.reshape(6, -1).T


def _over_time(link: np.ndarray, trial: PoseTrial) -> np.ndarray:
    """Columns (6 N, 6) of a link's twists (6, N, 6) that grow from 0 to 1 over the recording."""
    time = trial.chain.time - trial.chain.time[0]
    return (link * (time / time[-1])[None, :, None]).reshape(6, -1).T


def _explained(values: np.ndarray, basis: np.ndarray, design: np.ndarray) -> float:
    """Share of the values (M,) that a design (M, 6) explains beside a basis (M, K)."""
    free = design - basis @ (basis.T @ design)
    found = np.linalg.lstsq(free, values, rcond=1e-6)[0]
    return 1.0 - float(np.sum((values - free @ found) ** 2)) / max(float(values @ values), 1e-300)


def _robust_fit(design: np.ndarray, values: np.ndarray, views: int) -> tuple[np.ndarray, np.ndarray]:
    """Amplitudes (6,), and what is left (views, 6)."""
    weight = np.ones(len(values))
    for _ in range(ROUNDS):
        weight = _weights(values, design, weight, views)
    found = np.linalg.lstsq(design * weight[:, None], values * weight, rcond=1e-6)[0]
    return found, (values - design @ found).reshape(views, -1)


def _samples_that_count_as_one(left: np.ndarray) -> float:
    """Integrated autocorrelation time of channels (N, C), the mean, each up to where it first is negative."""
    out = []
    for rest in (left - left.mean(axis=0)).T:
        power = np.abs(np.fft.rfft(rest, 2 * len(rest))) ** 2
        correlation = np.fft.irfft(power)[: len(rest)]
        correlation = correlation / max(float(correlation[0]), 1e-300)
        negative = np.flatnonzero(correlation < 0.0)
        out.append(1.0 + 2.0 * float(np.sum(correlation[1 : negative[0] if len(negative) else len(rest)])))
    return float(np.mean(out))
