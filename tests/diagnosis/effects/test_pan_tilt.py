"""A load on a pan-tilt: its moment shows, its mass hardly does."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.diagnose import library
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.hypothesis import Evidence
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

LOAD, AT = 0.12, (0.06, 0.0, 0.03)  # [kg], [m] in the plate's frame


def urdf(load: float) -> str:
    """A pan whose tilt is a centimetre off, and a load fixed to the plate."""
    body = (
        '<link name="{0}"><inertial><origin xyz="{1}"/><mass value="{2}"/>'
        '<inertia ixx="{3}" iyy="{3}" izz="{3}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
    turn = (
        '<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><origin xyz="{}"/>'
        '<axis xyz="{}"/><limit lower="-3" upper="3" effort="5" velocity="9"/></joint>'
    )
    parts = [
        '<link name="base"/>',
        body.format("bracket", "0.004 0 0.02", 0.11, 7e-5),
        body.format("plate", "0.035 0 0.012", 0.19, 1e-4),
        turn.format("pan", "base", "bracket", "0 0 0.04", "0 0 1"),
        turn.format("tilt", "bracket", "plate", "0.01 0 0.045", "0 1 0"),
    ]
    if load:
        parts.append(body.format("load", " ".join(map(str, AT)), load, 1e-7))
        parts.append('<joint name="screw" type="fixed"><parent link="plate"/><child link="load"/></joint>')
    return f'<robot name="head">{"".join(parts)}</robot>'


def recording(seed: int) -> ArmRecording:
    """Link-side torques of the loaded head under two sums of sines, and the description without the load."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 12.0, 0.004)
    hertz, phase = rng.uniform(0.2, 1.5, (4, 2)), rng.uniform(0.0, 6.0, (4, 2))
    turns = 2.0 * np.pi * hertz * time[:, None, None] + phase
    q, dq = 0.2 * np.sin(turns).sum(axis=1), 0.2 * (2 * np.pi * hertz * np.cos(turns)).sum(axis=1)
    ddq = -0.2 * ((2 * np.pi * hertz) ** 2 * np.sin(turns)).sum(axis=1)
    names = ("pan", "tilt")
    true = RigidArm(ArmDescription("tool_arm", names, urdf(LOAD), None))
    effort = true.inverse_dynamics(q, dq, ddq) + 0.002 * rng.standard_normal(q.shape)
    states = JointSignal(time, q, dq + 0.002 * rng.standard_normal(q.shape), effort=effort)
    about = ArmDescription("tool_arm", names, urdf(0.0), None)
    return ArmRecording("head", "head.npz", "", about, states, None, None)


def test_the_mass_is_that_of_a_point_with_its_moment() -> None:
    """It was 0.001 kg, 6 m away: the mass alone makes a thousandth of the torque that its moment makes."""
    trial = Trial(made := recording(1), RigidArm(made.arm))
    (effect,) = library(["payload"])
    evidence = Evidence(Likelihood([trial]))
    whole = next(h for h in evidence.screen([effect]) if len(h.mean) == 10)
    sizes = whole.form.parameters(trial, {}, evidence.fit([whole]).amplitudes[0])
    assert sizes["mass"] == pytest.approx(LOAD, rel=0.25)
    assert [sizes[f"com_{axis}"] for axis in "xz"] == pytest.approx([AT[0], AT[2]], rel=0.25)
