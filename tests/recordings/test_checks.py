"""Recordings that cannot be diagnosed are refused with value, limit and remedy; odd ones are noted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.recordings import check_recording, no_motion, still_joints
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

DEGREES = 180 / np.pi
Change = Callable[..., ArmRecording]


def cut(signal: JointSignal | None, keep: np.ndarray) -> JointSignal:
    assert signal is not None
    parts = {q: getattr(signal, q) for q in ("position", "velocity", "acceleration", "effort")}
    return JointSignal(signal.time[keep], **{q: v[keep] for q, v in parts.items() if v is not None})


def test_a_sound_recording_has_no_notes(motion: ArmRecording) -> None:
    assert check_recording(motion) == ()


def test_ten_samples(motion: ArmRecording) -> None:
    few = replace(motion, states=cut(motion.states, np.arange(600) < 10))
    with pytest.raises(InputError, match=r"10 samples over 0\.045 s; needed are 200"):
        check_recording(few)


def test_half_a_second(motion: ArmRecording) -> None:
    short = replace(motion, states=replace(motion.states, time=motion.states.time / 6))
    with pytest.raises(InputError, match=r"600 samples over 0\.499 s"):
        check_recording(short)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_runs_that_are_not_finite(motion: ArmRecording, with_states: Change, value: float) -> None:
    assert motion.states.effort is not None
    effort = motion.states.effort.copy()
    effort[100:121, 3] = value
    effort[300, 3] = value
    with pytest.raises(
        InputError, match=r"states effort of panda_joint4 .* 0\.5000 to 0\.6000 s \(22 numbers in 2 runs"
    ):
        check_recording(with_states(motion, effort=effort))


def test_time_that_stands_still(motion: ArmRecording, with_states: Change) -> None:
    time = motion.states.time.copy()
    time[50] = time[49]
    with pytest.raises(InputError, match="must increase"):
        check_recording(with_states(motion, time=time))


def test_no_motion(motion: ArmRecording, with_states: Change) -> None:
    assert motion.states.position is not None
    noise = np.random.default_rng(0).normal(size=(600, 7)) * 2e-5
    still = with_states(motion, position=motion.states.position[0] + noise, velocity=None)
    assert still_joints(still) == motion.arm.joints
    assert "no joint moves" in no_motion(still)
    with pytest.raises(InputError, match=r"no joint moves.*samrl excite"):
        check_recording(still)


def test_joints_at_rest_are_named(motion: ArmRecording, with_states: Change) -> None:
    assert motion.states.position is not None and motion.states.velocity is not None
    position, velocity = motion.states.position.copy(), motion.states.velocity.copy()
    position[:, 6], velocity[:, 6] = 0.5, 0.0
    notes = check_recording(with_states(motion, position=position, velocity=velocity))
    assert any("panda_joint7 do not move" in note for note in notes)


def test_gaps_and_changing_rates_are_named(motion: ArmRecording) -> None:
    keep = np.ones(600, dtype=bool)
    keep[200:260] = False
    keep[400:] = np.arange(200) % 4 == 0
    notes = check_recording(replace(motion, states=cut(motion.states, keep)))
    assert any("gaps above 0.2 s, the longest 0.305 s from 0.995 s" in note for note in notes)
    assert any("changes its rate: 50 Hz" in note and "200 Hz" in note for note in notes)


def test_channels_without_common_time(motion: ArmRecording) -> None:
    assert motion.command is not None
    later = replace(motion, command=replace(motion.command, time=motion.command.time + 1.7e9))
    with pytest.raises(InputError, match="share no time"):
        check_recording(later)


def test_a_channel_that_ends_early_is_named(motion: ArmRecording) -> None:
    early = replace(motion, command=cut(motion.command, np.arange(600) < 300))
    assert any("command covers only" in note for note in check_recording(early))


@pytest.mark.parametrize("velocity_too", [True, False])
def test_degrees_for_radians(motion: ArmRecording, with_states: Change, velocity_too: bool) -> None:
    s = motion.states
    assert s.position is not None and s.velocity is not None
    velocity = s.velocity * (DEGREES if velocity_too else 1)
    with pytest.raises(InputError, match=r"limits are .* rad; divided by 57\.3 .* degrees"):
        check_recording(with_states(motion, position=s.position * DEGREES, velocity=velocity))


def test_velocity_in_degrees(motion: ArmRecording, with_states: Change) -> None:
    assert motion.states.velocity is not None
    with pytest.raises(InputError, match=r"57\.\d+ times the derivative .* deg/s"):
        check_recording(with_states(motion, velocity=motion.states.velocity * DEGREES))


def test_velocity_of_the_wrong_sign(motion: ArmRecording, with_states: Change) -> None:
    assert motion.states.velocity is not None
    with pytest.raises(InputError, match="wrong sign"):
        check_recording(with_states(motion, velocity=-motion.states.velocity))


def test_velocity_of_something_else_is_suspected(motion: ArmRecording, with_states: Change) -> None:
    assert motion.states.velocity is not None
    notes = check_recording(with_states(motion, velocity=motion.states.velocity[:, ::-1].copy()))
    assert any("is not the derivative of its position" in note for note in notes)


def test_stamps_that_nearly_repeat_are_no_other_velocity(motion: ArmRecording) -> None:
    """Noise of a reading over nearly no time would be any velocity."""
    s = motion.states
    assert s.position is not None and s.velocity is not None
    time = s.time.copy()
    time[1::2] = time[0::2] + 1e-7  # two readings in a row each 10 ms
    position = s.position + np.random.default_rng(0).normal(size=s.position.shape) * 2e-5
    notes = check_recording(replace(motion, states=replace(s, time=time, position=position)))
    assert not any("is not the derivative" in note for note in notes), notes


def test_an_arm_that_swings_is_not_suspected(motion: ArmRecording) -> None:
    """Where it is slowest it turns back, so that its effort is not gravity's."""
    time = np.arange(2000) * 0.002
    rate = 2 * np.pi * (2.0 + 0.1 * np.arange(7))
    start = motion.states.position
    assert start is not None
    q = start[0] + 0.3 * np.sin(rate * time[:, None])
    dq = 0.3 * rate * np.cos(rate * time[:, None])
    ddq = -0.3 * rate**2 * np.sin(rate * time[:, None])
    tau = RigidArm(motion.arm).inverse_dynamics(q, dq, ddq)
    swing = replace(motion, states=JointSignal(time, q, dq, None, tau), command=None, commanded_effort=None)
    assert not [note for note in check_recording(swing) if "gravity" in note]


def test_command_in_degrees(motion: ArmRecording) -> None:
    assert motion.command is not None and motion.command.position is not None
    command = replace(motion.command, position=motion.command.position * DEGREES)
    with pytest.raises(InputError, match="the command in degrees"):
        check_recording(replace(motion, command=command))


@pytest.mark.parametrize(("factor", "what"), [(1000.0, "in mN m"), (0.001, "in kN m")])
def test_effort_off_by_a_thousand(
    motion: ArmRecording, with_states: Change, factor: float, what: str
) -> None:
    assert motion.states.effort is not None
    with pytest.raises(InputError, match=what):
        check_recording(with_states(motion, effort=motion.states.effort * factor))


def test_a_sensor_gain_of_thirty_percent_is_no_unit(motion: ArmRecording, with_states: Change) -> None:
    assert motion.states.effort is not None
    assert check_recording(with_states(motion, effort=motion.states.effort * 1.3)) == ()


def test_effort_turned_around_or_unrelated_is_suspected(motion: ArmRecording, with_states: Change) -> None:
    assert motion.states.effort is not None
    notes = check_recording(with_states(motion, effort=-motion.states.effort))
    assert any("sign of the effort" in note for note in notes)
    noise = np.random.default_rng(0).normal(size=(600, 7))
    notes = check_recording(with_states(motion, effort=noise))
    assert any("wrong URDF" in note for note in notes)


def test_a_urdf_of_other_masses_is_suspected(motion: ArmRecording) -> None:
    assert motion.arm.urdf is not None
    import re

    heavier = re.sub(r'<mass value="([\d.]+)"', lambda m: f'<mass value="{6 * float(m[1])}"', motion.arm.urdf)
    notes = check_recording(replace(motion, arm=replace(motion.arm, urdf=heavier)))
    assert any("times the gravity torque" in note for note in notes)


def test_millimetres_of_a_slide(motion: ArmRecording) -> None:
    from samrl_core.cell.types.arm_description import ArmDescription

    urdf = (
        '<robot name="s"><link name="a"/><link name="b"><inertial><mass value="1"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
        '<joint name="x" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/>'
        '<limit lower="-0.5" upper="0.5" effort="10" velocity="1"/></joint></robot>'
    )
    time = np.arange(400) * 0.01
    slide = ArmRecording(
        "slide",
        "",
        "",
        ArmDescription("tool_arm", ("x",), urdf, None),
        JointSignal(time, 300 * np.sin(time)[:, None]),
        None,
        None,
    )
    with pytest.raises(InputError, match="as if it were in mm"):
        check_recording(slide)
