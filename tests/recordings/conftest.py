"""Recordings of the Panda along a smooth path, efforts from its own inverse dynamics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.robots.panda.spec import PANDA
from samrl_core.cell.types.arm_description import ArmController, ArmDescription, NominalTool, Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

JOINTS = PANDA.joint_names
TOOL = NominalTool(0.78, np.array([0.0, 0.0, 0.06]), np.diag([1e-3, 1e-3, 5e-4]))


@pytest.fixture(scope="session")
def panda() -> ArmDescription:
    tolerances = Tolerances(mass=0.05)
    controller = ArmController(
        JOINTS,
        PANDA.controller.stiffness,
        PANDA.controller.damping,
        effort_limit=PANDA.limits.effort,
        armature=PANDA.armature,
    )
    return ArmDescription("tool_arm", JOINTS, PANDA.urdf.read_text(), controller, TOOL, tolerances)


@pytest.fixture(scope="session")
def _panda_motion(panda: ArmDescription) -> ArmRecording:
    time = np.arange(600) * 0.005
    rate = 2 * np.pi * (0.4 + 0.1 * np.arange(7))
    q = PANDA.home + 0.2 * np.sin(rate * time[:, None])
    dq = 0.2 * rate * np.cos(rate * time[:, None])
    ddq = -0.2 * rate**2 * np.sin(rate * time[:, None])
    tau = RigidArm(panda).inverse_dynamics(q, dq, ddq)
    return ArmRecording(
        "motion",
        "motion.mcap",
        "0" * 64,
        panda,
        JointSignal(time, q, dq, None, tau),
        JointSignal(time - 0.004, q + 0.01, dq, ddq, np.zeros_like(q)),
        JointSignal(time, effort=tau),
        ((0.5, "reach"), (1.25, "hold")),
    )


@pytest.fixture
def motion(_panda_motion: ArmRecording) -> ArmRecording:
    return _panda_motion


@pytest.fixture
def with_states() -> Callable[..., ArmRecording]:
    """A recording with quantities of its states replaced."""

    def make(recording: ArmRecording, **changes: np.ndarray | None) -> ArmRecording:
        return replace(recording, states=replace(recording.states, **changes))

    return make


@pytest.fixture(scope="session")
def shared_data() -> Path:
    folder = Path(__file__).resolve().parents[2].parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the recordings of real machines are not here")
    return folder
