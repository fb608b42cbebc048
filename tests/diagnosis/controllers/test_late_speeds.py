"""A late logged velocity: motion by positions, and the law by what its torque says that it damps."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.kinds.arms import Arms
from samrl_core.diagnosis.recordings import split
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.null_simulations import simulate_null_recordings
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis.controllers import late_speeds as machine

run = cache(machine.swing)


def of(damps_reported: bool, delay_s: float = 0.0) -> tuple[ArmRecording, list[str]]:
    """As the diagnosis takes it, and its notes."""
    (found,), notes = Arms().alike([machine.record(run(damps_reported, delay_s))])
    return found, notes


def seen(recording: ArmRecording, channel: str) -> float:
    """Root mean square of a residual in units of its own noise."""
    trial = Trial(recording, RigidArm(recording.arm))
    return float(np.sqrt(np.mean((trial.residual[channel] / trial.sigma[channel]) ** 2)))


@pytest.mark.parametrize("delay_s", [0.0, 0.005])
@pytest.mark.parametrize("damps_reported", [True, False])
def test_the_torque_says_which_velocity_the_law_damps(damps_reported: bool, delay_s: float) -> None:
    """A late command adds three times the filter's own torque, and passes for none."""
    found, (note,) = of(damps_reported, delay_s)
    assert found.states.velocity is None
    assert found.arm.controller is not None
    lag = float(found.arm.controller.law.velocity_lag)
    assert (found.states.filtered_velocity is not None) == damps_reported
    assert lag == pytest.approx(machine.LAG_S if damps_reported else 0.0, abs=2e-4)
    assert "ms behind the positions" in note
    assert ("the law damps the logged one" in note) == damps_reported


@pytest.mark.parametrize("damps_reported", [True, False])
def test_a_sound_machine_shows_no_gap_of_motion(damps_reported: bool) -> None:
    """With the logged velocity the inertia's torque is late, and the friction's turns."""
    as_logged = machine.record(run(damps_reported))
    found, _ = of(damps_reported)
    assert seen(as_logged, "dynamics") > 15.0
    assert seen(found, "dynamics") < 3.5  # a torque is held for a period, which the stamps' tolerance allows
    assert seen(found, "controller") < 1.2


def test_the_law_is_simulated_with_the_filter() -> None:
    """Against an integration of its own: what the loop asks for, and the motion nearer than without."""
    true, (found, _) = run(True), of(True)
    errors = []
    for about in (found.arm, machine.record(true).arm):
        told = JointSignal(true.time, true.command[:, None], true.command_speed[:, None])
        start = true.position[:1], true.velocity[:1]
        done = ClosedLoop(LoopModel(about)).rollout(told, *start, [PlantParameters()], true.time[-1])
        errors.append(float(np.std(done.position[0, :, 0] - true.position)))
        if about is found.arm:
            assert about.controller is not None
            lag = float(about.controller.law.velocity_lag)
            damped = machine.low_passed(done.velocity[0, :, 0], lag)
            wanted = machine.STIFFNESS * (true.command - done.position[0, :, 0])
            wanted = wanted + machine.DAMPING * (true.command_speed - damped)
            np.testing.assert_allclose(done.commanded_effort[0, :, 0], wanted, atol=1e-9)
    assert errors[0] < 0.3 * errors[1]


@pytest.mark.parametrize("damps_reported", [True, False])
def test_without_a_recorded_torque_the_motion_says_it(damps_reported: bool) -> None:
    logged = replace(machine.record(run(damps_reported)), commanded_effort=None)
    (found,), (note,) = Arms().alike([logged])
    assert (found.states.filtered_velocity is not None) == damps_reported
    assert "explains the motion better" in note
    assert seen(found, "dynamics") < 1.5


def test_what_was_found_stays_with_the_recording() -> None:
    """Halves of it, and a second look at it."""
    found, _ = of(True)
    first, last = split(found, 0.5)
    again, notes = Arms().alike([first, last])
    assert notes == []
    assert all(r.states.filtered_velocity is not None for r in again)
    assert [len(r.states.filtered_velocity) for r in again] == [len(r.states) for r in again]


def test_worlds_without_an_effect_are_logged_as_the_machine_is() -> None:
    found, _ = of(True)
    trial = Trial(found, RigidArm(found.arm))
    made = simulate_null_recordings([trial], PlantParameters(), np.random.default_rng(0))
    assert made is not None
    assert made[0].states.velocity is None
    assert seen(made[0], "controller") < 1.2


def test_no_filter_is_found_without_one() -> None:
    true = run(False)
    sound = machine.record(true)
    honest = JointSignal(sound.states.time, sound.states.position, true.velocity[::2, None])
    kept, notes = Arms().alike([replace(sound, states=honest)])
    assert notes == []
    assert kept[0].states.velocity is not None
