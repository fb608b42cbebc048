"""Servo machines that were refused or misnamed, each by its smallest case."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.effects import EFFECTS
from samrl_core.diagnosis.effects.drive.controller_gain import EFFECT as CONTROLLER_GAIN
from samrl_core.diagnosis.effects.drive.controller_gain import ClippedGain
from samrl_core.diagnosis.effects.drive.torque_rate_limit import EFFECT as RATE_LIMIT
from samrl_core.diagnosis.effects.drive_torque import turn_widths, usual_turns
from samrl_core.diagnosis.effects.form import Place
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.equations import _controller_residual, integrated_terms
from samrl_core.diagnosis.residuals.laws.control_law import squared_rounding_error
from samrl_core.diagnosis.residuals.laws.follow_command import sure_part
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.residuals.signals.rounding import rounding_noise
from samrl_core.diagnosis.residuals.signals.signal_band import SignalBand
from samrl_core.diagnosis.residuals.signals.signal_noise import quantum
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.contenders import Contender, plain_first
from samrl_core.diagnosis.selection.hypothesis import Evidence, hypothesis
from samrl_core.diagnosis.selection.on_held_out import held_out_gains
from samrl_core.diagnosis.selection.selection import Selection
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis import worlds
from tests.diagnosis.controllers.kinds import POSITION_SERVO, VELOCITY_DRIVE, VOLTAGE_SERVO
from tests.diagnosis.controllers.machines import Differs, Machine
from tests.diagnosis.controllers.machines import worlds as machines
from tests.diagnosis.test_diagnose import diagnosed
from tests.diagnosis.worlds import LIFT, TURN

if TYPE_CHECKING:
    from samrl_core.diagnosis.selection.hypothesis import Fit

SWING = Place("joint:swing", (0,))


def recorded(machine: Machine, seconds: float = 3.0) -> list[ArmRecording]:
    """A machine as described."""
    return machines(machine, [Differs()], 1, seconds)[0]


def trial_of(recording: ArmRecording) -> Trial:
    return Trial(recording, RigidArm(recording.arm))


# -- what is in the law -------------------------------------------------------------------------------------


def test_a_punch_is_no_part_of_the_stiffness() -> None:
    recording = recorded(replace(POSITION_SERVO, records="standstill"))[0]
    trial = trial_of(recording)
    (form,) = CONTROLLER_GAIN.forms(trial, SWING)
    assert form.amplitudes == ("eK", "eD", "eP")
    law = trial.motion.described_law
    assert np.unique(np.abs(law.punch)) == pytest.approx([0.0, 0.02])
    rows = form.columns(trial, {})["controller", 0]
    sure = sure_part(trial.motion, np.stack([law.spring, law.punch]))
    assert rows[0] == pytest.approx(-trial.motion.reduce(sure[0])[:, 0])
    assert rows[2] == pytest.approx(-trial.motion.reduce(sure[1])[:, 0])


def test_a_velocity_gain_scales_the_position_loop_around_it() -> None:
    """u = kv (kp e + ...) + ki int(kp e + ...): with kv 20 % up, K = kv kp is, and kp is not."""
    trial = trial_of(recorded(VELOCITY_DRIVE)[0])
    (form,) = CONTROLLER_GAIN.forms(trial, SWING)
    found = form.parameters(trial, {}, np.array([0.2, 0.2]))
    assert found == pytest.approx({"eK": 0.0, "eD": 0.2})
    law = trial.motion.described_law
    terms = np.stack([law.spring + law.stiff_integral, law.damper - law.stiff_integral])
    missing = trial.motion.reduce(-0.2 * sure_part(trial.motion, terms).sum(axis=0))[:, 0]
    assert 0.2 * form.columns(trial, {})["controller", 0].sum(axis=0) == pytest.approx(missing, abs=1e-9)


def test_a_reading_at_the_last_of_its_step_may_lie_beyond_a_punch() -> None:
    """A twentieth of the step lies beyond the dead band, and there the logged torque lacks the punch."""
    controller = POSITION_SERVO.described().controller
    assert controller is not None
    band, punch, step = 0.002, 0.02, 0.0004
    error = np.array([[band - 0.45 * step]])
    squared = squared_rounding_error(controller, error, np.array([step]))
    assert squared[0, 0] == pytest.approx(0.05 * punch**2, rel=0.8)
    assert squared_rounding_error(controller, error - 0.2 * step, np.array([step]))[0, 0] == 0.0


@pytest.mark.parametrize("length", [1, 40])
def test_errors_of_a_reading_ring_as_wide_as_their_variance(length: int) -> None:
    """Errors of single samples, and such as a slow axis keeps for 0.3 s, band-limited, have the variance that
    is stated: at their lobes too.
    """
    band, rng = SignalBand(125.0, 25.0, 4.0, dynamic=True), np.random.default_rng(3)
    wrong, held = np.zeros((500, 1), dtype=bool), np.ones((500, 1), dtype=bool)
    drawn = np.zeros((500, 400))
    for begin in range(100, 440, 60):
        held[begin] = False
        wrong[begin : begin + length] = True
        drawn[begin : begin + length] = 0.2 * rng.normal(size=400)
    seen = np.mean(band.reduce(drawn) ** 2, axis=1)
    stated = band.reduce_variance(np.where(wrong, 0.04, 0.0), held)[:, 0]
    loud = stated > 1e-6
    assert np.count_nonzero(loud) > 55  # lobes beside the peaks
    assert seen[loud] == pytest.approx(stated[loud], rel=0.4)


def test_states_are_not_shifted_to_a_lag_at_which_a_law_is_less_noisy() -> None:
    """Differences of positions are in the law and in the speed that a back-EMF takes: least at a lag."""
    rng, sent = np.random.default_rng(5), np.sin(np.arange(800) / 40.0)[:, None]
    speed_noise = np.gradient(0.01 * rng.normal(size=(800, 1)), axis=0)

    def law(lag: int) -> SimpleNamespace:
        return SimpleNamespace(total=np.roll(sent - speed_noise, lag, axis=0))

    motion = SimpleNamespace(
        asked=sent + speed_noise,
        limit=lambda: np.array([9.0]),
        law=law,
        rate=250.0,
        enabled=np.ones((800, 1)),
    )
    assert _controller_residual(cast(RecordedMotion, motion))[1] == 0
    # A torque that was made of the very reading two samples ago takes that reading's noise off.
    motion.asked = np.roll(sent - speed_noise, 2, axis=0) + 1e-4 * rng.normal(size=(800, 1))
    assert _controller_residual(cast(RecordedMotion, motion))[1] == 2


# -- noise --------------------------------------------------------------------------------------------------


def test_a_computed_torque_is_as_noisy_as_its_law() -> None:
    """30 N m/rad of 2e-5 rad and 1 N m s/rad of 2e-3 rad/s; held over a period of the log it is no less."""
    machine = replace(POSITION_SERVO, about={**POSITION_SERVO.about, "period_s": 0.004})
    trial = trial_of(recorded(machine)[0])
    assert trial.motion.computed
    expected = np.hypot(30.0 * 2e-5, 1.0 * 2e-3)
    assert trial.motion.noise.commanded_effort[0] == pytest.approx(expected, rel=0.15)


def test_the_fast_part_of_an_integral_of_noise_is_in_the_likelihood() -> None:
    trial = trial_of(recorded(VELOCITY_DRIVE)[0])
    walk = integrated_terms(trial.motion)[1][0]  # N m per root second
    assert walk == pytest.approx(6.0 * 2e-3 * np.sqrt(0.002 + 0.001), rel=0.2)
    span = trial.motion.time[-1] - trial.motion.time[0]
    beyond = walk * np.sqrt(2.0 * span / (np.pi**2 * 60))
    assert trial.sigma["controller"].min() >= beyond


@pytest.mark.parametrize("read", ["finely", "in counts"])
def test_a_slow_axis_keeps_the_error_of_a_rounded_log(read: str) -> None:
    """Differences of neighbours hardly show it; of a drive that reads the log's counts there is none."""
    slower = {name: lambda t, p=path: p(0.1 * t) for name, path in POSITION_SERVO.paths.items()}
    step = 4e-3
    servo = replace(
        POSITION_SERVO, records="standstill", paths=slower, resolution=step * (read == "in counts")
    )
    recording = recorded(servo)[0]
    position = recording.states.position
    assert position is not None
    counts = np.round(position / step) * step
    trial = trial_of(replace(recording, states=replace(recording.states, position=counts)))
    sigma = trial.sigma["controller"][:, 0]
    ratio = np.sqrt(np.mean((trial.residual["controller"][:, 0] / sigma) ** 2))
    motion, most = trial.motion, 30.0 * step / np.sqrt(12.0)
    assert motion.asked is not None
    found = rounding_noise(motion, motion.described_law.total - motion.asked)[0]
    if read == "finely":
        assert ratio < 1.1 and sigma.max() == pytest.approx(most, rel=0.5)
        assert found == pytest.approx(most, rel=0.2)
    else:
        assert found < 0.5 * most


def without_speed(recording: ArmRecording) -> ArmRecording:
    """The same, as a log that has positions alone."""
    return replace(recording, states=replace(recording.states, velocity=None))


def test_noise_of_a_speed_that_nobody_recorded_is_taken_from_the_torque() -> None:
    """That of differences does not add up; the drive's own reading of 0.02 rad/s does, each millisecond."""
    recording = recorded(VELOCITY_DRIVE)[0]
    given = recording.commanded_effort
    assert given is not None and given.effort is not None
    read = 1.5 * 0.02 * np.random.default_rng(3).standard_normal(given.effort.shape)
    noisy = replace(recording, commanded_effort=replace(given, effort=given.effort + read))
    walk = integrated_terms(trial_of(without_speed(noisy)).motion)[1][0]
    sensor = 0.002 * 8.0 / 1.5  # of the torque, which might be the drive's as well
    assert walk == pytest.approx(6.0 * np.hypot(0.02, sensor) * np.sqrt(0.001), rel=0.15)


def test_a_drive_may_read_its_speed_later_than_positions_say() -> None:
    """What a speed 0.3 ms old makes, by damping and integral, is tolerated where nobody recorded it."""
    recording = recorded(VELOCITY_DRIVE)[0]
    motion = trial_of(recording).motion
    assert motion.raw_velocity is not None
    older = 3e-4 * np.gradient(motion.full_velocity, 1.0 / motion.rate, axis=0)
    torque = motion.reduce(1.5 * older + 6.0 * np.cumsum(older, axis=0) / motion.rate)
    left = {}
    for name, log in {"recorded": recording, "not": without_speed(recording)}.items():
        trial = trial_of(log)
        time, late = trial.motion.t, np.interp(trial.motion.t, motion.t, torque[:, 0])
        assert motion.t[0] <= time[0] and time[-1] <= motion.t[-1]
        trial.equations.residual["controller"][:, 0] = 20.0 * late
        likelihood = Likelihood([trial])
        y = likelihood.y.copy()
        y[likelihood.blocks[0, "dynamics", 0]] = 0.0
        left[name] = np.linalg.norm(y - likelihood.tolerated(y, 2.0)) / np.linalg.norm(y)
    assert left["not"] < 0.1 < left["recorded"]


def test_a_rate_limit_does_not_explain_the_noise_of_a_computed_torque() -> None:
    time = np.arange(0.0, 3.0, 0.004)
    rng = np.random.default_rng(5)
    still = np.full((len(time), 1), 0.8)
    states = JointSignal(
        time, still + 2e-4 * rng.standard_normal(still.shape), 2e-3 * rng.standard_normal(still.shape)
    )
    arm = POSITION_SERVO.described()
    trial = trial_of(ArmRecording("rest", "", "", arm, states, JointSignal(time, still, 0.0 * still), None))
    (form,) = RATE_LIMIT.forms(trial, SWING)
    lost = form.columns(trial, {"R": 0.1})["dynamics", 0]
    assert np.std(lost) < 0.1 * np.std(trial.motion.u)


@pytest.mark.parametrize("step", [9.5874e-5, 2 * np.pi / 4096])
def test_a_step_is_found_under_the_digits_of_a_log(step: float) -> None:
    """Digits round a fast move's 160 steps by more than a fiftieth of one, reckoned from the smallest."""
    time = 0.008 * np.arange(2000)
    read = np.round((1.2 * np.sin(1.3 * time) + 0.3 * np.sin(4.0 * time)) / step) * step
    assert quantum(np.round(read, 6)[:, None])[0] == pytest.approx(step, rel=1e-5)
    noisy = read + 0.2 * step * np.random.default_rng(1).standard_normal(read.shape)
    assert quantum(noisy[:, None])[0] == 0.0


# -- speeds -------------------------------------------------------------------------------------------------


def test_speeds_are_those_of_all_recordings() -> None:
    a, b = worlds.record(worlds.plant(), "AB")
    together = arm_trials([a, b], [])[0]
    alone = np.max([trial_of(r).fastest for r in (a, b)], axis=0)
    assert all(np.array_equal(t.fastest, alone) for t in together)


def test_searches_begin_at_turns_as_wide_as_the_speeds() -> None:
    assert turn_widths(0.06) == (0.002, 0.006, 0.02)
    assert turn_widths(0.3)[-1] == pytest.approx(0.18)
    trial = trial_of(worlds.record(worlds.plant(), "A")[0])
    trial.fastest = np.full(3, 6.0)
    assert usual_turns(trial, (0,)) == pytest.approx((0.005, 0.09, 0.24))


def test_a_friction_that_turns_slowly_is_coulombs() -> None:
    library = {"coulomb_friction", "friction_asymmetry", "viscous_friction", "stribeck_friction"}
    diagnosis = diagnosed(4, library, coulomb={TURN: 0.8}, coulomb_velocity={TURN: 0.1})
    assert diagnosis.verdict == "effect", diagnosis.reasons
    assert [e.name for e in diagnosis.effects] == ["coulomb_friction@joint:turn"]
    assert diagnosis.effects[0].parameters["Fc"].value == pytest.approx(0.8, rel=0.05)


def test_a_limit_that_held_out_motion_does_not_reach_is_named_where_it_explains_all() -> None:
    """The held-out task runs at softer gains and asks for less."""
    diagnosis = diagnosed(9, {"torque_saturation", "coulomb_friction", "payload"}, effort_limit={LIFT: 9.0})
    assert diagnosis.verdict == "effect", diagnosis.reasons
    assert [e.name for e in diagnosis.effects] == ["torque_saturation@joint:lift"]


# -- choice and verdict -------------------------------------------------------------------------------------


def test_a_drop_that_only_mends_the_shape_of_a_sign_is_no_stribeck_friction() -> None:
    plain, falling = (
        SimpleNamespace(place="joint:turn", effect=SimpleNamespace(family=family, contains=contains))
        for family, contains in (("coulomb_friction", ()), ("stribeck_friction", ("coulomb_friction",)))
    )

    def contender(h: SimpleNamespace, left: float) -> Contender:
        return Contender(cast("Fit", SimpleNamespace(hypotheses=[h])), left)

    mended = [contender(falling, 0.053), contender(plain, 0.06)]
    assert plain_first(mended) == mended[::-1]
    for there in (
        [contender(falling, 0.02), contender(plain, 0.1)],
        [contender(falling, 0.0), contender(plain, 0.01)],
    ):
        assert plain_first(there) == there


def test_held_out_recordings_tell_an_effect_from_a_fit_to_noise() -> None:
    """What they win by a friction of the right size, of none, and of the wrong sign."""
    a, c = worlds.world(3, "A", coulomb={TURN: 0.3}), worlds.world(4, "A", coulomb={TURN: 0.3})
    likelihood, held_out = (Likelihood(worlds.trials(r)) for r in (a, c))
    (effect,) = (e for e in EFFECTS if e.family == "coulomb_friction")
    (place,) = (p for p in effect.places(likelihood.trials[0]) if p.name == "joint:turn")
    form = effect.forms(likelihood.trials[0], place)[0]
    h = hypothesis(likelihood, effect, form, form.shapes[1])
    assert h is not None
    fit = Evidence(likelihood).fit([h])
    gain, expected = held_out_gains(held_out, fit, 2.0)
    assert expected > 100.0 and gain == pytest.approx(expected, rel=0.3)
    wrong = replace(fit, amplitudes=(-fit.amplitudes[0],))
    assert held_out_gains(held_out, wrong, 2.0)[0] < -expected


def test_a_gap_is_at_least_what_an_effect_explains_of_it() -> None:
    """Of 2800 nat that an effect wins, tolerances could swallow all but 180: 195 that stay are 7 %."""
    chosen = cast("Fit", SimpleNamespace(log_evidence=2800.0))
    found = Selection(chosen, (), (), 12.0, 180.0, 195.0, 110.0, 42.0, 9.0, held_out_gain=1450.0)
    assert found.unexplained == pytest.approx(195.0 / 2800.0)
    assert found.held_out_unexplained == pytest.approx(42.0 / 1450.0)


# -- limits of the output -----------------------------------------------------------------------------------


def clipped_trial(voltage_limit: float) -> Trial:
    about = {**VOLTAGE_SERVO.about, "voltage_limit": [voltage_limit], "integral": [0.0]}
    return trial_of(recorded(replace(VOLTAGE_SERVO, about=about))[1])


def test_a_gain_is_weighed_against_the_limit_only_where_the_output_reaches_it() -> None:
    assert [f.name for f in CONTROLLER_GAIN.forms(clipped_trial(12.0), SWING)] == ["gains"]
    assert [f.name for f in CONTROLLER_GAIN.forms(clipped_trial(1.5), SWING)] == ["gains", "clipped"]


def test_what_a_lower_gain_leaves_before_a_limit() -> None:
    """Within the limit (1/k - 1) of what was delivered, and beyond it the limit less k times the spring."""
    trial = clipped_trial(1.5)
    _, form = CONTROLLER_GAIN.forms(trial, SWING)
    assert isinstance(form, ClippedGain)
    motion, factor = trial.motion, 0.7
    spring, limit = motion.described_law.spring[:, 0], motion.limit()[0]
    row = form.lacks(trial, factor)[:, 0]
    free, both = np.abs(spring) < limit, factor * np.abs(spring) >= limit
    delivered = (trial.delivered_torque + motion.back_emf_loss)[:, 0]
    assert row[free] == pytest.approx((1.0 / factor - 1.0) * delivered[free])
    assert np.any(both) and row[both] == pytest.approx(0.0)
    between = ~free & ~both
    assert np.any(between)
    assert row[between] == pytest.approx((np.sign(spring) * limit - factor * spring)[between])
