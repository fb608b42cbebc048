"""An `Estimate` as samrl_msgs/ModelState, there and back."""

from __future__ import annotations

from typing import Any

import numpy as np
from samrl_msgs.msg import ModelState

from samrl_core.cell.tasks.task import Task
from samrl_core.model.real2sim.real2sim import Estimate
from samrl_ros.conversions import from_message
from samrl_ros.conversions import to_message as convert


def to_message(estimate: Estimate, task: Task, episode: int, step: int) -> ModelState:
    """The estimate with the episode and step that asked for it."""
    message = ModelState(header=convert.header(estimate.stamp_ns, "world"), episode=episode, step=step)
    message.task = task.name
    message.names = list(estimate.names)
    message.units = [spec.unit for spec in task.parameters()]
    message.values = estimate.values.tolist()
    message.covariance = estimate.covariance.ravel().tolist()
    message.color_names = list(estimate.color_names)
    message.colors = estimate.colors.ravel().tolist()
    message.color_covariance = estimate.color_variance.ravel().tolist()
    message.loss_before, message.loss_after = float(estimate.loss_before), float(estimate.loss_after)
    message.color_loss_before = float(estimate.color_loss_before)
    message.color_loss_after = float(estimate.color_loss_after)
    message.emd_before, message.emd_after = float(estimate.emd_before), float(estimate.emd_after)
    message.iterations = int(estimate.iterations)
    message.why_stopped = estimate.why_stopped
    message.converged = bool(estimate.converged)
    return message


def from_state(message: Any) -> Estimate:
    """Back to an `Estimate`."""
    size = len(message.names)
    return Estimate(
        names=tuple(message.names),
        values=np.array(message.values),
        covariance=np.array(message.covariance).reshape(size, size),
        color_names=tuple(message.color_names),
        colors=np.array(message.colors).reshape(-1, 3),
        color_variance=np.array(message.color_covariance).reshape(-1, 3),
        stamp_ns=from_message.stamp_ns(message),
        loss_before=message.loss_before,
        loss_after=message.loss_after,
        color_loss_before=message.color_loss_before,
        color_loss_after=message.color_loss_after,
        emd_before=message.emd_before,
        emd_after=message.emd_after,
        iterations=int(message.iterations),
        why_stopped=message.why_stopped,
        converged=bool(message.converged),
    )
