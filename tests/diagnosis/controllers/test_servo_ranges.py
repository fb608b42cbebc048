"""What denied the right cause on small machines: ranges of large arms, straight springs, wrong ties."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.effects.drive.torque_saturation import EFFECT as SATURATION
from samrl_core.diagnosis.effects.friction.position_dependent_friction import EFFECT as WAVES
from samrl_core.diagnosis.effects.load.base_tilt import EFFECT as BASE_TILT
from samrl_core.diagnosis.effects.sensor.encoder_eccentricity import EFFECT as ECCENTRICITY
from samrl_core.diagnosis.effects.transmission.gear_ripple import EFFECT as RIPPLE
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.nominal import tolerance_columns
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.contenders import Contender, denied_by_motion
from samrl_core.diagnosis.selection.hypothesis import hypothesis, implausible
from samrl_core.diagnosis.selection.selection import Selection
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from samrl_core.diagnosis.verdict.confidence import probabilities
from samrl_core.diagnosis.verdict.rules import VerdictSettings, _moves_closer, _moves_wrongly
from tests.diagnosis import worlds
from tests.diagnosis.controllers.kinds import POSITION_SERVO, STEPPER, VOLTAGE_MOTOR
from tests.diagnosis.controllers.machines import Differs, Machine
from tests.diagnosis.controllers.machines import worlds as machines

if TYPE_CHECKING:
    from samrl_core.diagnosis.selection.hypothesis import Fit
    from samrl_core.diagnosis.verdict.how_far import HowFar

SLIDE = """<robot name="slide"><link name="base"/><link name="table"><inertial><mass value="2"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="swing" type="prismatic"><parent link="base"/><child link="table"/><axis xyz="1 0 0"/>
<limit lower="-3" upper="3" effort="6" velocity="10"/></joint></robot>"""


def trial_of(recording: ArmRecording) -> Trial:
    return Trial(recording, RigidArm(recording.arm))


def recorded(machine: Machine, seconds: float = 3.0) -> ArmRecording:
    return machines(machine, [Differs()], 1, seconds)[0][0]


@pytest.mark.parametrize("machine", [STEPPER, POSITION_SERVO])
def test_the_tolerance_of_a_stamp_passes_the_law_as_a_late_command_does(machine: Machine) -> None:
    """A pole's spring softens with its angle and a dead band is none: a late command acts through both."""
    trial = trial_of(recorded(machine))
    command, stamp = trial.motion.command, 0.5 / trial.motion.rate
    assert command is not None and command.position is not None and command.velocity is not None
    late = [trial.motion.delayed(x, stamp) for x in (command.position, command.velocity)]
    lost = trial.motion.law_change(JointSignal(command.time, late[0], late[1], None, command.effort))
    expected = trial.motion.reduce(lost)[:, 0] / stamp
    found = [c[key][0] for c, _ in tolerance_columns(trial) for key in c if key[0] == "dynamics"]
    assert any(np.allclose(row, expected, atol=1e-9 * np.abs(expected).max()) for row in found)


def test_a_limit_that_only_a_later_recording_reaches_is_searched_for() -> None:
    """The first recording was slow and drew a tenth of the second's torque: its own was the search's end."""
    hanging = {
        "slow": lambda t: 0.5 * np.pi + 0.02 * np.sin(2.0 * t),
        "lively": POSITION_SERVO.paths["lively"],
    }
    trials, _ = arm_trials(machines(replace(POSITION_SERVO, paths=hanging), [Differs()], 1, 3.0)[0], [])
    drawn = [float(np.max(np.abs(t.motion.u))) for t in trials if t.motion.u is not None]
    for order in (trials, trials[::-1]):
        (place,) = SATURATION.places(order[0])
        for form in SATURATION.forms(order[0], place):
            assert form.refine["L"][1] > 1.2 * max(drawn)
            assert any(0.9 * max(drawn) < shape["L"] <= 1.3 * max(drawn) for shape in form.shapes)
    assert drawn[0] < 0.5 * drawn[1]


def test_a_bench_that_leans_by_three_degrees_is_plausible() -> None:
    likelihood = Likelihood(worlds.trials(worlds.world(3, "A")))
    trial = likelihood.trials[0]
    (place,) = BASE_TILT.places(trial)
    h = hypothesis(likelihood, BASE_TILT, BASE_TILT.forms(trial, place)[0], {})
    assert h is not None
    assert not implausible(h, trial, np.array([0.02, 0.06]))
    assert implausible(h, trial, np.array([0.02, 0.5]))


@pytest.mark.parametrize("logs_speed", [True, False])
def test_an_eccentric_encoder_errs_in_the_speed_that_brakes_the_motor_too(logs_speed: bool) -> None:
    """A reading with a small error changes the equations by the error's columns, back-EMF included."""
    machine = replace(VOLTAGE_MOTOR, speed_log=2e-3 if logs_speed else 0.0)
    recording = recorded(machine)
    states = recording.states
    assert states.position is not None
    size, order = 1e-4, 4.0
    wave = size * np.sin(order * states.position)
    speed = states.velocity
    if speed is not None:
        speed = speed + size * order * np.cos(order * states.position) * speed
    wrong = replace(recording, states=replace(states, position=states.position + wave, velocity=speed))
    right, erring = trial_of(recording), trial_of(wrong)
    (form,) = ECCENTRICITY.forms(right, right_place := ECCENTRICITY.places(right)[0])
    assert right_place.joints == (0,)
    change = (erring.residual["dynamics"] - right.residual["dynamics"])[:, 0]
    predicted = size * form.columns(right, {"k": order})["dynamics", 0][0]
    inner = slice(20, -20)
    assert np.std((change - predicted)[inner]) < 0.15 * np.std(change[inner])


def test_waves_of_friction_are_searched_over_the_travel_of_a_slide() -> None:
    """Twice within a travel of 0.3 m is an order of 42 per metre."""
    time = np.arange(0.0, 6.0, 0.004)
    position = 0.15 * np.sin(1.5 * time)[:, None]
    arm = replace(POSITION_SERVO.described(), urdf=SLIDE)
    states = JointSignal(time, position, 0.225 * np.cos(1.5 * time)[:, None])
    trial = trial_of(ArmRecording("slide", "", "", arm, states, JointSignal(time, position), None))
    for form in WAVES.forms(trial, WAVES.places(trial)[0]):
        orders = [shape["k"] for shape in form.shapes]
        assert min(abs(np.log(k / (4 * np.pi / 0.3))) for k in orders) < 0.2, form.name
        low, high = form.refine["k"]
        assert low < 2 * np.pi / 0.3 and (form.name == "torque" or high > 8 * np.pi / 0.3)
    # A torque that repeats three times within the travel is ripple, where no turn tells the teeth's number.
    (torque,) = [form for form in WAVES.forms(trial, WAVES.places(trial)[0]) if form.name == "torque"]
    ripples = RIPPLE.forms(trial, RIPPLE.places(trial)[0])
    assert torque.refine["k"][1] == pytest.approx(6 * np.pi / 0.3, rel=0.01)
    for form in ripples:
        assert form.refine["N"][0] < 6 * np.pi / 0.3
        assert all(shape["N"] > 0.99 * 6 * np.pi / 0.3 for shape in form.shapes)


def contender(name: str, motion: float | None, limit: bool = False) -> Contender:
    effect = SimpleNamespace(limits_motion=limit)
    fit = SimpleNamespace(hypotheses=[SimpleNamespace(name=name, effect=effect)])
    return Contender(cast("Fit", fit), 0.1, motion)


def test_a_rival_that_moves_the_simulation_away_is_no_candidate() -> None:
    first, worse, better = contender("right", 0.4), contender("wrong", 2.0), contender("also", 0.7)
    assert denied_by_motion([first, worse, better]) == {"wrong"}
    assert denied_by_motion([contender("right", 0.95), worse]) == frozenset()  # it confirms nobody
    assert denied_by_motion([contender("right", None), worse]) == frozenset()
    fits = [
        cast("Fit", SimpleNamespace(log_evidence=e, hypotheses=[SimpleNamespace()])) for e in (15.0, 18.0)
    ]
    assert probabilities(fits)[1] > 0.8
    assert probabilities(fits, denied=[1]).tolist() == [1.0, 0.0]


def test_a_limit_that_moves_nothing_closer_is_no_candidate() -> None:
    """A backlash was tied with a limit at a tenth of the torque, with which the simulation diverged."""
    first, doubtful = contender("right", 0.4), contender("right", 0.95)
    for left, beside_right, beside_doubtful in ((2.0, True, True), (0.9, True, False), (0.4, False, False)):
        limit = contender("limit", left, limit=True)
        assert denied_by_motion([first, limit]) == ({"limit"} if beside_right else set())
        assert denied_by_motion([doubtful, limit]) == ({"limit"} if beside_doubtful else set())
    assert denied_by_motion([doubtful, contender("limit", None, limit=True)]) == frozenset()


def test_what_another_wins_more_stays_unexplained() -> None:
    """Also where that one is refused for its motion: tolerances swallow most of the excess there."""
    fit = cast("Fit", SimpleNamespace(log_evidence=760.0))
    found = Selection(fit, (), (), 12.0, 50.0, 0.5, 0.0, 0.0, 25.0)
    assert found.unexplained < 0.01
    assert replace(found, most=1300.0).unexplained == pytest.approx(540.0 / 1300.0)
    assert replace(found, most=760.0).unexplained < 0.01


def test_a_limit_must_show_where_held_out_motion_is_wrong() -> None:
    def far(nominal: float, motion: float | None) -> HowFar:
        return cast("HowFar", SimpleNamespace(gap=SimpleNamespace(nominal=nominal), motion=motion))

    settings = VerdictSettings()
    assert _moves_wrongly(far(353.0, 0.0), settings)
    assert not _moves_wrongly(far(1.4, 0.0), settings)  # the motion does not reach the limit
    assert not _moves_wrongly(far(353.0, None), settings)


def test_what_moves_the_simulation_much_closer_is_not_passed_over() -> None:
    """A slow filter named a dead band by its torque: 19 % of the motion's gap went, 69 % with the filter."""

    def far(nominal: float, margin: float) -> HowFar:
        gap = SimpleNamespace(nominal=nominal, margin=margin, runner_up_effect="command_low_pass@joint:x")
        return cast("HowFar", SimpleNamespace(gap=gap, motion=0.19))

    settings = VerdictSettings()
    assert _moves_closer(far(34.0, -0.5), settings) == "command_low_pass@joint:x"
    assert _moves_closer(far(34.0, -0.1), settings) is None
    assert _moves_closer(far(1.4, -0.5), settings) is None  # a gap within tolerances tells nothing
