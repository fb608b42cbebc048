"""Steps of an encoder are noise that is slow where the joint is slow."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmController, ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.cell.types.drive_law import DriveLaw
from samrl_core.diagnosis.residuals.coarse_readings import widen_where_coarse
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis.controllers.test_passive_joint import LENGTH, MASS, URDF, G

RATE_HZ, SECONDS = 500.0, 12.0
FRICTION = 0.01  # [N m], as stated
JOINT = f'<axis xyz="0 1 0"/><limit effort="0.5" velocity="20"/><dynamics friction="{FRICTION}" damping="0"/>'
SWINGS = ((0.4, 0.9), (0.15, 2.3), (0.05, 6.1))  # [rad], [rad/s]


def turned(counts: float, dither: float = 0.0) -> Trial:
    """A rod on a motor that obeys its model, read in so many counts per turn, with noise [counts] before."""
    time = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    angle = sum(a * np.sin(w * time) for a, w in SWINGS)
    acceleration = sum(-a * w**2 * np.sin(w * time) for a, w in SWINGS)
    speed = sum(a * w * np.cos(w * time) for a, w in SWINGS)
    torque = MASS * LENGTH**2 / 3 * acceleration + 0.5 * MASS * G * LENGTH * np.sin(angle)
    torque += FRICTION * np.sign(speed)
    step = 2.0 * np.pi / counts
    noise = dither * np.random.default_rng(1).standard_normal(len(time))
    read = step * np.round(angle / step + noise)[:, None]
    law = ArmController(("pivot",), np.zeros(1), np.zeros(1), law=DriveLaw(open_loop=True))
    arm = ArmDescription("tool_arm", ("pivot",), URDF.replace('<axis xyz="0 1 0"/>', JOINT), law)
    sent = JointSignal(time, effort=torque[:, None])
    return Trial(ArmRecording("run", "run", "", arm, JointSignal(time, read), None, sent), RigidArm(arm))


@pytest.mark.parametrize("counts", [4096.0, 16384.0])
def test_an_exact_joint_has_no_more_than_noise_where_it_turns_back(counts: float) -> None:
    """Where friction may hold, samples count less; that raised what is slow in rounding, and made a gap."""
    trial = turned(counts)
    left = Likelihood([trial]).whitened()
    speed = np.abs(trial.motion.dq[:, 0])
    slow = speed < np.quantile(speed, 0.2)
    assert np.sqrt(np.mean(left[slow] ** 2)) < 2.0  # 3.8 at 4096 counts before
    assert np.sqrt(np.mean(left**2)) < 1.2


def test_noise_of_a_step_or_more_makes_rounding_white() -> None:
    dithered = turned(4096.0, dither=1.5)
    sigma, mass = dithered.sigma["dynamics"], dithered.mass
    assert widen_where_coarse(sigma, dithered.motion, mass, dithered.color["dynamics"]) is sigma
