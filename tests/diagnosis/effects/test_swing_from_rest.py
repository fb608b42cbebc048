"""A link on a soft spring begins at rest in most logs: noise at the log's end is no kick."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.diagnose import library
from samrl_core.diagnosis.effects.transmission.joint_elasticity import SwingingLink
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis.cases import find_form

MASS, REACH, STIFFNESS = 4.0, 0.4, 1500.0  # [kg], [m], [N m/rad]: it swings at 7 Hz
ARM = f"""<robot name="rod"><link name="base"/><link name="rod"><inertial>
<origin xyz="{REACH} 0 0"/><mass value="{MASS}"/>
<inertia ixx="0.02" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="lift" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="70" velocity="3"/></joint></robot>"""


def test_a_log_that_begins_at_rest_begins_without_a_swing() -> None:
    """It rang by 1.1 mrad: accelerations of a log's first sample are those of its noise."""
    rng, time = np.random.default_rng(2), np.arange(0.0, 6.0, 0.002)
    eased = np.clip((time - 1.5) / 2.0, 0.0, 1.0) ** 3
    q = 0.6 * eased + 4e-5 * rng.standard_normal(len(time))
    about = ArmDescription("tool_arm", ("lift",), ARM, None)
    states = JointSignal(time, q[:, None], effort=np.zeros((len(time), 1)))
    recording = ArmRecording("rod", "", "", about, states, None, None)
    trial = Trial(recording, RigidArm(about))
    (effect,) = library(["joint_elasticity"])
    form = find_form(effect, trial, "joint:lift", "swinging")
    assert isinstance(form, SwingingLink)
    twist = form.twist(trial, {"K": STIFFNESS, "d": 4.0})
    sagged = -MASS * 9.81 * REACH / STIFFNESS
    assert np.max(np.abs(twist[time < 1.0] - sagged)) < 0.04 * abs(sagged)
