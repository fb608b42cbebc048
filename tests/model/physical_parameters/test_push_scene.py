"""The model of a push against closed forms, and its slopes against differences."""

from __future__ import annotations

import numpy as np
import pushes
import pytest
import torch

from samrl_core.common.errors import InputError
from samrl_core.model.physical_parameters.push_scene import NAMES, START, PushScene
from samrl_core.model.physical_parameters.sensitivity import sensitivity, trajectory


def test_blade_and_disc_obey_newton() -> None:
    """Together (F - mu m g) / (M + m); let go, the disc slows by mu g."""
    mass, friction, force = 0.6, 0.35, 7.0
    scene = PushScene(pushes.DISC, pushes.drive(force, 0.24, 0.4), pushes.CONTACT)
    states = trajectory(scene, pushes.theta(mass, friction)).numpy()
    speed = states[:, scene.model.start_state(1).q.shape[1] + 1]  # of the disc, after the blade's

    def pace(first: float, last: float) -> float:
        a, b = (round(t / scene.model.scene.step_s) for t in (first, last))
        return (speed[b] - speed[a]) / ((b - a) * scene.model.scene.step_s)

    together = (force - friction * mass * 9.81) / (pushes.ARM_MASS + mass)
    assert pace(0.16, 0.23) == pytest.approx(together, rel=0.02)
    assert pace(0.25, 0.29) == pytest.approx(-friction * 9.81, rel=0.02)


def test_slopes_are_those_of_the_whole_trajectory() -> None:
    """Against central differences, through impact, push, release and rest."""
    scene = PushScene(pushes.DISC, pushes.drive(7.0, 0.16, 0.4), pushes.CONTACT)
    at = pushes.theta(0.6, 0.35)
    found = sensitivity(scene, at)
    states, jacobian = found.states, found.jacobian
    assert torch.equal(states, trajectory(scene, at))
    places = slice(0, 2)  # of blade and disc
    for i, h in enumerate([1e-6] * START + [1e-8]):  # the latency is none of the trajectory's
        step = torch.zeros_like(at)
        step[i] = h
        difference = (trajectory(scene, at + step) - trajectory(scene, at - step)) / (2 * h)
        expected = difference[:, places].numpy()
        scale = max(float(np.abs(expected).max()), 1e-3)
        np.testing.assert_allclose(
            jacobian[:, places, i].numpy(), expected, atol=1e-3 * scale, err_msg=str(i)
        )


def test_what_cannot_show_does_not() -> None:
    """A round disc pushed at its middle: its inertia moves nothing, its mass moves a lot."""
    scene = PushScene(pushes.DISC, pushes.drive(7.0, 0.16, 0.4), pushes.CONTACT)
    jacobian = sensitivity(scene, pushes.theta(0.6, 0.35)).jacobian
    of = {name: float(jacobian[-1, 1, i].abs()) for i, name in enumerate(NAMES)}
    assert of["inertia_ratio"] < 1e-3 * of["mass"] and of["blade_friction"] < 0.02 * of["mass"]
    assert of["mass"] > 0.02 and of["table_friction"] > 0.01


def test_no_substep_is_refused() -> None:
    with pytest.raises(InputError, match="substeps"):
        PushScene(pushes.DISC, pushes.drive(7.0, 0.1, 0.2), pushes.PushContactSettings(substeps=0))
