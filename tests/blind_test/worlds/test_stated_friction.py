"""Arms whose models state friction: it holds joints, is stated in the URDF, and logs lose messages."""

import numpy as np
import pytest

from samrl_core.blind_test.engines.dry_friction import DryFriction
from samrl_core.blind_test.worlds.nominal import nominal_arm
from samrl_core.blind_test.worlds.plan import ForgeSettings, plan_worlds
from samrl_core.blind_test.worlds.stated_friction import encoders, state_friction
from samrl_core.blind_test.worlds.world import make_world
from samrl_core.cell.robots.joint_dynamics import joint_dynamics


def test_joints_that_move_one_another_stop_together_or_are_opposed():
    """Each rests below its level or slides against all of it."""
    rng, levels = np.random.default_rng(8), np.array([2.0, 1.0, 0.5, 0.2])
    half = rng.normal(size=(4, 4))
    yielding = 1e-3 * (half @ half.T + 1.0 * np.eye(4))
    rested = 0
    for _ in range(30):
        friction, free = DryFriction(levels), 1e-3 * rng.normal(size=4)
        held = friction.stop_together([0, 1, 2, 3], free, yielding)
        moved = free - yielding @ held
        rests = np.abs(moved) < 1e-9
        rested += np.count_nonzero(rests)
        assert np.all(np.abs(held) <= levels)
        np.testing.assert_allclose(held[~rests], (levels * np.sign(moved))[~rests], atol=1e-6)
    assert 10 < rested < 110


def test_an_encoder_counts_and_its_speed_is_late():
    """A ramp is read in whole steps, its speed in the mean."""
    read = encoders(2, 0.001, 5)
    rows = [read(k * 1e-3, np.array([0.3, -0.7]) * k * 1e-3, np.zeros(2)) for k in range(500)]
    speeds = np.array([v for _, v in rows])
    assert speeds[1] == pytest.approx([0.3, -0.7], rel=0.8) and abs(speeds[1, 0]) < 0.3
    assert speeds[200:].mean(axis=0) == pytest.approx([0.3, -0.7], rel=1e-2)


@pytest.mark.parametrize(
    "engine",
    [
        pytest.param({"mujoco": 1, "pinocchio": 0}, marks=pytest.mark.slow),
        pytest.param({"mujoco": 0, "pinocchio": 1}, marks=pytest.mark.thorough),
    ],
)
def test_a_world_states_what_its_arm_sticks_by(engine):
    """Between moves an encoder keeps its count; held-out C of the oracle sticks as the model says."""
    settings = ForgeSettings(
        seed=3, single=0, none=1, outside=0, double=0, duration_s=5.0, stated_friction=True, **engine
    )
    (item,) = plan_worlds(settings)
    recordings, label, oracle = make_world(item)
    stated = joint_dynamics(recordings["A"].arm)
    spec = nominal_arm(item.arm).spec
    assert stated.friction == pytest.approx(state_friction(spec, item.seed, True).dry, rel=1e-3)
    # Within tolerances, here of twice at most.
    assert label["background"]["coulomb_nm"] == pytest.approx(
        stated.friction, abs=0.0021 * spec.limits.effort.max()
    )
    states = recordings["C"].states
    still = np.diff(states.position, axis=0) == 0.0
    assert still.mean() > 0.02
    assert len(oracle.nominal_states) and np.isfinite(oracle.nominal_states.velocity).all()
