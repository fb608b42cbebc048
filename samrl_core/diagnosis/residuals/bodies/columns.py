"""What the motion of a body does per unit error of the nominal model: tolerances and effects alike."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.bodies.body_trial import BodyTrial
from samrl_core.diagnosis.residuals.bodies.segment import Segment
from samrl_core.diagnosis.residuals.equations import Columns

LEAST_INCLINE = 0.05  # tangent of the angle from which on a slope makes things roll
ONE_WAY = 0.95  # of the way that is gone straight on


def scale(trial: BodyTrial) -> Columns:
    """Per fraction by which accelerations seem smaller: a longer unit of length, or a faster clock."""
    friction = trial.constants.friction
    return trial.accelerated(lambda s: -np.broadcast_to(s.nominal(friction), s.velocity.shape)[None])


def gravity_tilt(trial: BodyTrial) -> Columns:
    """Per radian by which gravity is turned about each of two axes across it, friction's load included."""
    axes = across(trial)

    def field(s: Segment) -> np.ndarray:
        return np.stack([_under(trial, s, np.cross(axis, s.gravity)) for axis in axes])

    return trial.accelerated(field)


def support_tilt(trial: BodyTrial) -> Columns:
    """Per radian by which the support's normal is turned about two axes across it."""
    return _support_turned(trial, _across(np.asarray(_support_normal(trial))))


def _support_turned(trial: BodyTrial, axes: tuple[np.ndarray, np.ndarray]) -> Columns:
    def field(s: Segment) -> np.ndarray:
        if not s.slides:
            return np.zeros((2, *s.velocity.shape))
        out = []
        for axis in axes:
            turned = np.cross(axis, s.normal)
            pushed = -(turned * (s.normal @ s.gravity) + s.normal * (turned @ s.gravity))
            out.append(s.share * (pushed + trial.constants.friction * (turned @ s.gravity) * s.direction))
        return np.stack(out)

    return trial.accelerated(field)


def frame_tilt(trial: BodyTrial) -> Columns:
    """Per radian by which the track's frame leans, and gravity with the support in it, about two axes."""
    gravity = gravity_tilt(trial)
    return (
        gravity if trial.recording.support is None else _sum(gravity, _support_turned(trial, across(trial)))
    )


def friction(trial: BodyTrial) -> Columns:
    """Per unit of the coefficient."""
    return trial.accelerated(lambda s: -(s.share * s.load * s.direction)[None])


def friction_by_speed(trial: BodyTrial) -> Columns:
    """Per unit of the coefficient and metre per second."""
    return trial.accelerated(
        lambda s: -(s.share * s.load * np.linalg.norm(s.velocity, axis=1, keepdims=True) * s.direction)[None]
    )


def restitution(trial: BodyTrial) -> Columns:
    """Per unit of the coefficient."""
    return trial.rebounded(lambda i: -i.before)


def center(trial: BodyTrial) -> Columns:
    """Per metre by which the centre of mass lies farther along each axis of the tracked frame."""
    return trial.displaced(lambda s: -np.moveaxis(s.turned, -1, 0))


def inertia(trial: BodyTrial) -> Columns:
    """Per relative error of the first two moments of inertia, the third held: only ratios show."""
    return trial.turned(lambda r: r.inertia)


def rolling(trial: BodyTrial) -> Columns:
    """Per unit of inertia over mass and squared radius of what rolls."""
    mu = trial.constants.friction
    return trial.accelerated(
        lambda s: -(float(s.slides) * s.share * np.broadcast_to(s.nominal(mu), s.velocity.shape))[None]
    )


def unstated_rolling(trial: BodyTrial) -> Columns:
    """Per share of the pull along the support that turns the body instead, and per unit of friction."""
    pull = trial.accelerated(
        lambda s: -np.broadcast_to(float(s.slides) * s.tangential(s.gravity), s.velocity.shape)[None]
    )
    braked = friction(trial)
    return {key: np.concatenate([rows, braked[key]]) for key, rows in pull.items()}


def may_roll(trial: BodyTrial) -> bool:
    """Whether it is on an incline, of a shape that rolls or none, and nobody stated that it rolls."""
    support = trial.recording.support
    if support is None or support.rolls or trial.recording.body.shape == "box":
        return False
    pulls = [float(np.linalg.norm(s.tangential(s.gravity))) / s.load for s in trial.segments if s.slides]
    return max(pulls, default=0.0) > LEAST_INCLINE


def across_the_way(trial: BodyTrial) -> np.ndarray:
    """The one of `across` (2,) about which gravity would lean along the mean motion."""
    axes = across(trial)
    way = np.sum(trial.ways, axis=0)
    gravity = np.asarray(trial.recording.gravity, dtype=float)
    lean = np.array([np.cross(axis, gravity) @ way for axis in axes])
    size = float(np.linalg.norm(lean))
    return lean / size if size > 0 else np.array([1.0, 0.0])


def goes_one_way(trial: BodyTrial) -> bool:
    """Whether all fitted motions across gravity have about the same direction, of every recording."""
    up = -np.asarray(trial.recording.gravity, dtype=float)
    up = up / np.linalg.norm(up)
    ways = trial.ways - np.outer(trial.ways @ up, up)
    whole = float(np.sum(np.linalg.norm(ways, axis=1)))
    return whole > 0 and float(np.linalg.norm(np.sum(ways, axis=0))) > ONE_WAY * whole


def along(columns: Columns, weights: np.ndarray) -> Columns:
    """Columns (p, N) as one, weighed (p,)."""
    return {key: (weights @ rows)[None] for key, rows in columns.items()}


def across(trial: BodyTrial) -> tuple[np.ndarray, np.ndarray]:
    """Two unit axes across gravity: the track's x (or y, if it is x) laid across it, and left of that."""
    return _across(-np.asarray(trial.recording.gravity, dtype=float))


def _sum(one: Columns, other: Columns) -> Columns:
    return {key: rows + other[key] for key, rows in one.items()}


def _across(up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    up = up / np.linalg.norm(up)
    along = np.eye(3)[0 if abs(up[0]) < 0.9 else 1]
    first = along - up * (along @ up)
    first = first / np.linalg.norm(first)
    return first, np.cross(up, first)


def _support_normal(trial: BodyTrial) -> tuple[float, float, float]:
    assert trial.recording.support is not None
    return trial.recording.support.normal


def _under(trial: BodyTrial, s: Segment, change: np.ndarray) -> np.ndarray:
    """Acceleration (n, 3) by a change (3,) of gravity."""
    load = -float(s.normal @ change)
    braked = s.share * trial.constants.friction * load * s.direction
    return np.broadcast_to(s.tangential(change), s.velocity.shape) - braked
