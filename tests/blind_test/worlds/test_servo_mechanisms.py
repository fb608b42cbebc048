"""Equations written out by hand are those of the URDF that is handed out with them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from samrl_core.blind_test.servo_worlds.links import scaled, urdf, with_point
from samrl_core.blind_test.servo_worlds.mechanisms import Mechanism, mechanisms

ALL = mechanisms(np.random.default_rng(3))


@pytest.mark.parametrize("mechanism", ALL, ids=lambda m: m.name)
@pytest.mark.parametrize("altered", [False, True])
def test_equations_are_those_of_the_urdf(mechanism: Mechanism, altered: bool) -> None:
    links = mechanism.links
    if altered:
        links = (*links[:-1], with_point(scaled(links[-1], 1.1, 0.004, 0.9), 0.3, 0.2))
    count, rng = len(links), np.random.default_rng(1)
    model = pin.buildModelFromXML(urdf(mechanism.name, links, [1.0] * count, [1.0] * count))
    model.gravity.linear = np.array([0.7, -0.4, -9.7])
    data = model.createData()
    motion = mechanism.motion(links)
    for _ in range(5):
        q, v = rng.uniform(-1, 1, count), rng.uniform(-2, 2, count)
        mass, bias = motion(q.tolist(), v.tolist(), model.gravity.linear)
        upper = np.triu(pin.crba(model, data, q))
        assert np.allclose(mass, upper + np.triu(upper, 1).T, atol=1e-7)
        assert np.allclose(bias, pin.nonLinearEffects(model, data, q, v), atol=1e-6)
    assert model.names[1:].tolist() == [link.joint for link in links]
