"""What logs add to the torques that were sent is no cause: their noise, and when a voltage is stamped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.cell.types.arm_description import ArmDescription, Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.cell.types.controllers import controller_from
from samrl_core.diagnosis.diagnose import library
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence, hypothesis
from tests.diagnosis import worlds

WHEEL = """<robot name="wheel"><link name="base"/><link name="disc"><inertial><mass value="2"/>
<inertia ixx="0.01" iyy="0.01" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="turn" type="continuous"><parent link="base"/><child link="disc"/><axis xyz="0 0 1"/>
<limit effort="4" velocity="20"/></joint></robot>"""
CONSTANT, GEAR, RESISTANCE, INERTIA, STEP_S = 0.03, 20.0, 2.0, 0.02, 0.001


def test_noise_that_a_log_adds_to_sent_torques_is_no_filter_of_theirs() -> None:
    """A filter takes it off, and it is in the drive's residual: hundreds of nat for nothing."""
    rng = np.random.default_rng(5)
    noisy = []
    for recording in worlds.world(3, "AB"):
        sent = recording.commanded_effort
        assert sent is not None and sent.effort is not None
        more = 0.004 * np.std(sent.effort, axis=0) + 0.3
        effort = sent.effort + more * rng.standard_normal(sent.effort.shape)
        noisy.append(replace(recording, commanded_effort=replace(sent, effort=effort)))
    trials = worlds.trials(noisy)
    likelihood = Likelihood(trials)
    evidence, found = Evidence(likelihood), []
    for effect in library(["command_low_pass", "command_delay"]):
        for place in effect.places(trials[0]):
            for form in effect.forms(trials[0], place):
                if form.name.startswith("effort"):
                    made = (hypothesis(likelihood, effect, form, shape) for shape in form.shapes)
                    found += [evidence.fit([h]).log_evidence for h in made if h is not None]
    assert max(found) < 5.0


def spin(late_s: float, seed: int) -> ArmRecording:
    """A disc on a geared motor that voltages turn to and fro; they are stamped late."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 10.0, STEP_S)
    hertz, phases = rng.uniform(0.2, 2.0, 5), rng.uniform(0.0, 6.0, 5)
    volts = np.sum(4.0 * np.sin(2 * np.pi * hertz[:, None] * time + phases[:, None]), axis=0)
    kn = CONSTANT * GEAR
    angle, speed, read = 0.0, 0.0, np.empty(len(time))
    for k, volt in enumerate(volts.tolist()):
        read[k] = angle
        speed = (INERTIA * speed + STEP_S * kn / RESISTANCE * volt) / (INERTIA + STEP_S * kn**2 / RESISTANCE)
        angle += STEP_S * speed
    some = slice(100, -100, 4)
    logged = np.interp(time + late_s, time, volts)[some, None] * kn / RESISTANCE
    position = read[some, None] + 2e-5 * rng.standard_normal((len(time[some]), 1))
    about = {
        "type": "voltage_motor", "joints": ["turn"], "torque_constant": [CONSTANT],
        "resistance": [RESISTANCE], "gear_ratio": [GEAR], "rotor_inertia": [0.0],
        "voltage_limit": [48.0], "period_s": 0.001,
    }  # fmt: skip
    arm = ArmDescription(
        "tool_arm",
        ("turn",),
        WHEEL,
        controller_from(about, "turn"),
        None,
        Tolerances(
            mass=0.005,
            inertia=0.005,
            coulomb_friction=5e-4,
            viscous_friction=5e-4,
            motor_constant=0.002,
            stamp=0.002,
        ),
    )
    return ArmRecording(
        f"run {seed}", f"run{seed}", "", arm, JointSignal(time[some], position), None,
        JointSignal(time[some], effort=logged),
    )  # fmt: skip


def test_a_voltage_that_is_stamped_late_moves_what_it_gives_alone() -> None:
    """Not what the motor's speed takes off it, which is read with the motion: that looked like inertia."""
    trials, _ = arm_trials([spin(0.002, 1), spin(0.002, 2)], [])
    likelihood = Likelihood(trials)
    assert likelihood.deficit(likelihood.y, 2.0) < 5.0
