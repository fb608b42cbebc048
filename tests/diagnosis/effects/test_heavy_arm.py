"""What is usual on an arm goes with the arm: a load of 30 kg is nothing much to one of a tonne."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.diagnose import library
from samrl_core.diagnosis.effects.load.payload import usual_mass
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.hypothesis import Evidence
from samrl_core.diagnosis.selection.search import best_singles
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

LOAD, AT = 32.0, 0.15  # [kg], [m] before the flange


def urdf(scale: float, load: float) -> str:
    """Three axes with links of 300, 250 and 120 kg and a metre long, times a scale of mass."""
    body = (
        '<link name="{0}"><inertial><origin xyz="{1}"/><mass value="{2}"/>'
        '<inertia ixx="{3}" iyy="{3}" izz="{3}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
    turn = (
        '<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><origin xyz="{}"/>'
        '<axis xyz="{}"/><limit lower="-3" upper="3" effort="{}" velocity="2"/></joint>'
    )
    parts = [
        '<link name="base"/>',
        body.format("column", "0.1 0 0.1", 300 * scale, 25 * scale),
        body.format("upper", "0 0 0.5", 250 * scale, 30 * scale),
        body.format("fore", "0.4 0 0", 120 * scale, 12 * scale),
        turn.format("a", "base", "column", "0 0 0.6", "0 0 1", 11000 * scale),
        turn.format("b", "column", "upper", "0.3 0 0", "0 1 0", 12000 * scale),
        turn.format("c", "upper", "fore", "0 0 1.1", "0 1 0", 7000 * scale),
    ]
    if load:
        parts.append(body.format("load", f"{AT} 0 0", load, 1e-6))
        parts.append('<joint name="grip" type="fixed"><parent link="fore"/><child link="load"/></joint>')
    return f'<robot name="arm">{"".join(parts)}</robot>'


def recording(load: float) -> ArmRecording:
    """Link-side torques of the loaded arm under sums of sines, and its description without the load."""
    rng, time = np.random.default_rng(3), np.arange(0.0, 10.0, 0.01)
    hertz, phase = rng.uniform(0.1, 0.5, (4, 3)), rng.uniform(0.0, 6.0, (4, 3))
    turns = 2.0 * np.pi * hertz * time[:, None, None] + phase
    q, dq = 0.15 * np.sin(turns).sum(axis=1), 0.15 * (2 * np.pi * hertz * np.cos(turns)).sum(axis=1)
    ddq = -0.15 * ((2 * np.pi * hertz) ** 2 * np.sin(turns)).sum(axis=1)
    names = ("a", "b", "c")
    true = RigidArm(ArmDescription("tool_arm", names, urdf(1.0, load), None))
    effort = true.inverse_dynamics(q, dq, ddq) + 4.0 * rng.standard_normal(q.shape)
    states = JointSignal(time, q, dq + 2e-4 * rng.standard_normal(q.shape), effort=effort)
    about = ArmDescription("tool_arm", names, urdf(1.0, 0.0), None)
    return ArmRecording("arm", "arm.npz", "", about, states, None, None)


def test_a_heavy_arms_load_is_weighed() -> None:
    """Of a judge's 32.3 kg at 0.15 m 22.4 kg at 0.29 m were told: a prior of 1 kg cost them 512 nat."""
    trial = Trial(made := recording(LOAD), RigidArm(made.arm))
    evidence = Evidence(Likelihood([trial]))
    (best,) = best_singles(evidence, evidence.screen(library(["payload"])))
    h, size = best.hypotheses[0], best.amplitudes[0]
    found = h.form.parameters(trial, h.shape, size)
    assert found["mass"] == pytest.approx(LOAD, rel=0.06)
    assert found["com_x"] == pytest.approx(AT, abs=0.03)


@pytest.mark.parametrize(("scale", "usual"), [(1.0, 33.5), (18.0 / 670.0, 1.0), (0.4 / 670.0, 0.1)])
def test_a_load_is_usual_by_what_the_arm_weighs(scale: float, usual: float) -> None:
    """Of an industrial arm, a cobot and an arm of hobby servos."""
    about = ArmDescription("tool_arm", ("a", "b", "c"), urdf(scale, 0.0), None)
    made = recording(0.0)
    trial = Trial(ArmRecording("arm", "", "", about, made.states, None, None), RigidArm(about))
    assert usual_mass(trial) == pytest.approx(usual, rel=1e-3)
