"""One metric of a gap, the same for nominal, named and true effect: RMS over all channels in tolerances."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from samrl_core.cell.types.arm_description import ArmController, ArmDescription
from samrl_core.common.errors import InputError

RESAMPLES = 400  # of a bootstrap
CORNER = 10.0  # [rad/s] ASSUMPTION: of a loop that states only one of its gains, or none
QUANTITIES = ("position", "velocity", "effort", "commanded_effort")


def channel_scales(
    arm: ArmDescription, effort_limit: np.ndarray, tolerated: Mapping[str, np.ndarray] | None = None
) -> dict[str, np.ndarray]:
    """What counts as one unit of gap per channel (J,): what a torque within tolerance can do to it.

    effort, commanded_effort [N m]: root sum of squares of the tolerated torque offset and Coulomb friction.
    position [rad]: the deflection that this torque causes against the controller's stiffness.
    velocity [rad/s]: that deflection times the controller's corner frequency, stiffness over damping.

    A motor's back-EMF damps as well. Where a loop has no stiffness or no damping, its corner is taken to be
    `CORNER`. Where a joint has neither, nothing bounds what a torque does: then `tolerated` says which errors
    of position and velocity machines within tolerance show in as long a simulation.

    Raises:
        InputError: no controller, or limits and gains that are not positive and finite.
    """
    if arm.controller is None:
        raise InputError(
            f"{arm.role} has no described controller; the gap metric needs stiffness and damping"
        )
    stiffness, damping = loop_gains(arm.controller)
    limit = np.asarray(effort_limit, float)
    checked = [("effort limit", limit)]
    if tolerated is None:
        stiffness = np.where((stiffness == 0) & (damping > 0), damping * CORNER, stiffness)
        damping = np.where(damping == 0, stiffness / CORNER, damping)
        checked += [("stiffness", stiffness), ("damping", damping)]
    for name, values in checked:
        if not (np.isfinite(values).all() and (values > 0).all()):
            raise InputError(f"{name} of {arm.role} is {values}, must be finite and > 0 for the gap metric")
    known = arm.tolerances
    torque = limit * np.hypot(np.asarray(known.torque_offset), np.asarray(known.coulomb_friction))
    if not (torque > 0).all():
        raise InputError("torque offset and Coulomb friction tolerances are both zero; the metric needs one")
    errors = tolerated or {"position": torque / stiffness, "velocity": torque / damping}
    return {**errors, "effort": torque, "commanded_effort": torque}


def loop_gains(controller: ArmController) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness (J,) [N m/rad] and damping (J,) [N m s/rad] of a loop, a motor's back-EMF with the latter."""
    back_emf = controller.law.of_joints("back_emf", len(controller.joints))
    return np.asarray(controller.stiffness, float), np.asarray(controller.damping, float) + back_emf


def runs_away(controller: ArmController) -> bool:
    """Whether nothing holds some joint near its log: an input without a law, or a joint without gains."""
    stiffness, damping = loop_gains(controller)
    return controller.law.open_loop or bool(np.any((stiffness == 0) & (damping == 0)))


def gap_metric(
    measured: Mapping[str, np.ndarray], simulated: Mapping[str, np.ndarray], scales: Mapping[str, np.ndarray]
) -> float:
    """Root mean square of (measured - simulated) / scale, every channel, joint and sample weighing the same.

    Channels are (N, J); those that any of the three lacks are left out, and so are samples that are not
    finite in the measurement. A simulation that is not finite has an infinite gap.

    Raises:
        InputError: no common channel, or shapes that differ.
    """
    total, count = 0.0, 0
    for name in QUANTITIES:
        if name not in measured or name not in simulated or name not in scales:
            continue
        real, model = np.asarray(measured[name], float), np.asarray(simulated[name], float)
        if real.shape != model.shape:
            raise InputError(f"{name} was measured as {real.shape} but simulated as {model.shape}")
        seen = np.isfinite(real)
        if not np.isfinite(model[seen]).all():
            return float("inf")
        error = ((real - model) / np.asarray(scales[name], float))[seen]
        total, count = total + float(error @ error), count + error.size
    if not count:
        raise InputError("measurement and simulation have no channel in common")
    return float(np.sqrt(total / count))


def shrink(nominal: float, with_effect: float) -> float:
    """Share of the gap that is gone: 1 - after / before; never below -1, so that one failure cannot rule."""
    if nominal <= 0:
        return 0.0
    return max(-1.0, 1.0 - with_effect / nominal)


def bootstrap_shrink(sums: np.ndarray, rng: np.random.Generator) -> tuple[float, float]:
    """95 % interval of the shrink by a block bootstrap (Kuensch 1989).

    Args:
        sums: (K, 2) squared errors before and after, of each block of samples that count as one.
        rng: draws the blocks.
    """
    totals = sums[rng.integers(len(sums), size=(RESAMPLES, len(sums)))].sum(axis=1)
    low, high = np.quantile([shrink(np.sqrt(b), np.sqrt(a)) for b, a in totals], [0.025, 0.975])
    return float(low), float(high)
