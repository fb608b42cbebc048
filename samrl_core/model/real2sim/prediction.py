"""What an estimate becomes while the tool moves, between two images: the belief before the next update.

The process model of an extended Kalman filter: the mean follows eq. 3, the covariance its Jacobian, taken
over one standard deviation of the belief because contact bends it; what the model does not know grows with
what moves and with what contact holds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from samrl_core.cell.calibration.seen_error import SeenError
from samrl_core.cell.tasks.start import checked_tip
from samrl_core.cell.tasks.task import ParameterSpec
from samrl_core.model.real2sim.real2sim import Estimate
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics


@dataclass(frozen=True)
class PredictionSettings:
    """How far the prediction is trusted."""

    longest_step: float = 0.010  # the tool's way is cut into actions no longer than this [m]
    still: float = 1e-4  # a tool that moved less has moved nothing [m]
    model_error: float = 0.3  # standard deviation, of the predicted change [-]
    largest_spread: float = 1.0  # differences reach at most so far, in scales of the parameters [-]
    held_error: float = 0.05  # standard deviation of what contact holds, in scales of the parameters [-]
    jump: float = 6.0  # farther from each other, in scales, two ends are different things that may happen [-]
    most: int = 3  # predictions at most
    moved: float = 5e-4  # a body that was to go farther has been moved by contact [m]
    other_spread: float = 2.0  # standard deviation of the less likely ones, in scales [-]


@dataclass(frozen=True)
class CameraErrors:
    """How the error of what the camera shows changes while the camera moves, standard deviations."""

    per_metre: float = 0.004  # of the camera's way [m/m]
    per_radian: float = 0.003  # of its turn [m/rad]

    def beside(self, seen: SeenError) -> CameraErrors:
        """The same where a correction of the cell is not known exactly."""
        return CameraErrors(
            float(np.hypot(self.per_metre, seen.per_metre)), float(np.hypot(self.per_radian, seen.per_radian))
        )


def predictions(
    dynamics: TaskDynamics,
    specs: tuple[ParameterSpec, ...],
    estimate: Estimate,
    tip_before: np.ndarray,
    tip_after: np.ndarray,
    settings: PredictionSettings | None = None,
) -> tuple[Estimate, ...]:
    """What the estimate may be after the tool's tip has moved straight from one position to another.

    What stands on edge falls or stands: where a deviation within the belief ends far from the mean's end, or
    the mean went far, that end and "it stayed" are given too. An image decides (`likeliest`).

    Args:
        dynamics: of the estimate's task.
        specs: `Task.parameters`, for scales and bounds.
        estimate: at `tip_before`.
        tip_before: (3,) in the tool arm's base frame, when the estimate's image was taken [m].
        tip_after: (3,) now [m].
        settings: how far the prediction is trusted.

    Returns:
        Estimates with other values and covariance, that of the mean first; the given one where nothing moved.

    Raises:
        InputError: a tip is not three finite numbers.
        SolveError: the model could not follow.
    """
    s = settings or PredictionSettings()
    way = checked_tip(tip_after) - checked_tip(tip_before)
    distance = float(np.linalg.norm(way))
    if distance < s.still:
        return (estimate,)
    scale = np.array([p.scale for p in specs])
    spread = np.minimum(np.sqrt(np.diag(estimate.covariance)), s.largest_spread * scale)
    spread = np.maximum(spread, 1e-6 * scale)
    count = len(scale)
    # What the camera shows beside its place moves nothing.
    varied = np.diag(spread)[[p.kind != "camera" for p in specs]]
    starts = np.vstack([np.zeros((1, count)), varied, -varied]) + estimate.values
    state = dynamics.start(starts, tip_before)
    steps = max(1, math.ceil(distance / s.longest_step - 1e-9))
    action = torch.from_numpy(way / steps).expand(len(starts), 3)
    with torch.no_grad():
        for _ in range(steps):
            state = dynamics.forward(state, action)
    ends = np.array([dynamics.read(q)[0] for q in state.q.numpy()])
    stays = np.array([p.kind != "state" for p in specs])
    ends[:, stays] = starts[:, stays]
    jacobian = np.eye(count)
    up, down = np.split(ends[1:], 2)
    acting = np.flatnonzero(varied.any(axis=0))
    jacobian[:, acting] = (up - down).T / (2 * spread[acting])
    change = ends[0] - estimate.values
    # What keeps its own error is untouched; what does not is held by contact, as well as the model knows it.
    held = np.clip(np.abs(1.0 - np.diag(jacobian)), 1e-6, 1.0)
    unknown = (s.model_error * change) ** 2 + (s.held_error * scale * held) ** 2
    covariance = jacobian @ estimate.covariance @ jacobian.T + np.diag(unknown)
    lower, upper = np.array([p.lower for p in specs]), np.array([p.upper for p in specs])
    # A disc that turns over jumps from one end of its range to the other: no deviation exceeds half of it.
    shrink = np.minimum(1.0, 0.5 * (upper - lower) / np.sqrt(np.diag(covariance)))
    covariance = shrink[:, None] * 0.5 * (covariance + covariance.T) * shrink
    found = [replace(estimate, values=np.clip(ends[0], lower, upper), covariance=covariance)]
    for other in (estimate.values, *ends[1:]):
        far = all(np.abs((other - one.values) / scale).max() > s.jump for one in found)
        if far and len(found) < s.most:
            # Where it fell to says nothing new of its size or of the camera: both stay as well known.
            loose = np.where(np.outer(stays, stays), estimate.covariance, 0.0)
            loose += np.diag(np.where(stays, 0.0, s.other_spread * scale) ** 2)
            found.append(replace(estimate, values=np.clip(other, lower, upper), covariance=loose))
    return tuple(found)


def moved_by_contact(
    before: Estimate,
    after: Estimate,
    specs: tuple[ParameterSpec, ...],
    settings: PredictionSettings | None = None,
) -> bool:
    """Whether the tool was to move a body between an estimate and the prediction from it.

    Of a target whose place, x, y and z, is estimated beside the camera's shift; else False.
    """
    s, place = settings or PredictionSettings(), _place(specs)
    if place.sum() != sum(p.kind == "camera" for p in specs) or not place.any():
        return False
    return bool(np.abs((after.values - before.values)[place]).max() > s.moved)


def camera_kept(before: Estimate, after: Estimate, specs: tuple[ParameterSpec, ...]) -> Estimate:
    """An update by an image of what contact has moved, with the camera's shift as it was before.

    A contact slides, rolls and tips otherwise than the model has it, step by step to the same side, and a
    tool that sits askew in the hand covers other parts of the target. Both would pass for an error of the
    camera, which does not move meanwhile. So its shift is considered and not estimated (Schmidt 1966): the
    body lies where the image shows it, less that shift.

    Args:
        before: what was believed before the image.
        after: the update from it.
        specs: `Task.parameters`, with a place and a camera's shift (`moved_by_contact`).
    """
    place, camera = _place(specs), np.array([p.kind == "camera" for p in specs])
    lower, upper = np.array([p.lower for p in specs]), np.array([p.upper for p in specs])
    shown = np.eye(len(specs))  # place and shift of an estimate to where the image shows the body, and back
    shown[np.ix_(place, camera)] = np.eye(3)
    values = shown @ after.values
    values[camera] = before.values[camera]
    covariance = shown @ after.covariance @ shown.T
    covariance[camera] = covariance[:, camera] = 0.0
    covariance[np.ix_(camera, camera)] = before.covariance[np.ix_(camera, camera)]
    back = 2.0 * np.eye(len(specs)) - shown
    values, covariance = np.clip(back @ values, lower, upper), back @ covariance @ back.T
    return replace(after, values=values, covariance=0.5 * (covariance + covariance.T))


def _place(specs: tuple[ParameterSpec, ...]) -> np.ndarray:
    return np.array([p.kind == "state" and p.unit == "m" for p in specs])


def loosened_by(estimate: Estimate, specs: tuple[ParameterSpec, ...], seen: SeenError) -> Estimate:
    """An estimate before any image, where the correction of the cell's camera is not known exactly.

    Only parameters of `camera_specs` hold such an error; without them it goes into what they are wrong by.
    """
    camera = [k for k, p in enumerate(specs) if p.kind == "camera"]
    if not camera:
        return estimate
    covariance = estimate.covariance.copy()
    covariance[np.ix_(camera, camera)] += seen.position
    return replace(estimate, covariance=covariance)


def seen_from_elsewhere(
    estimate: Estimate, specs: tuple[ParameterSpec, ...], way: float, turn: float, settings: CameraErrors
) -> Estimate:
    """The estimate after the camera moved: what it shows beside its place is another error there.

    Wider, never wider than before the first image, towards which it goes back: a process that forgets
    (Uhlenbeck and Ornstein 1930).

    Args:
        estimate: before.
        specs: `Task.parameters`.
        way: of the camera [m].
        turn: of the camera [rad].
        settings: how fast the error changes.
    """
    camera = np.array([p.kind == "camera" for p in specs])
    if not camera.any():
        return estimate
    spread = (settings.per_metre * way) ** 2 + (settings.per_radian * turn) ** 2
    prior = np.array([p.scale for p in specs]) ** 2
    kept = np.where(camera, np.sqrt(prior / (prior + spread)), 1.0)
    nominal = np.array([p.nominal for p in specs])
    covariance = estimate.covariance * np.outer(kept, kept) + np.diag(prior * (1.0 - kept**2))
    return replace(estimate, values=nominal + kept * (estimate.values - nominal), covariance=covariance)


def likeliest(updates: Sequence[Estimate]) -> Estimate:
    """Of the updates from several predictions by one image, that which explains it best.

    By eq. 6 with the colours as they were before: each update has painted what it takes the image to show,
    and one that shows a face that was never visible may take any colour. Several are made with `compared`.
    """
    losses = [one.loss_known for one in updates]
    return updates[int(np.argmin([loss if math.isfinite(loss) else math.inf for loss in losses]))]
