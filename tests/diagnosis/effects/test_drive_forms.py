"""Forms that the simulator does not have: what their formula says, and that a fit returns what was put in."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.diagnosis.diagnose import library
from samrl_core.diagnosis.effects import Effect
from samrl_core.diagnosis.effects.drive.torque_saturation import EFFECT as SATURATION
from samrl_core.diagnosis.effects.drive.torque_saturation import DriveClip, unknown_torque
from samrl_core.diagnosis.effects.form import Shape
from samrl_core.diagnosis.residuals.basis_functions import bristle, travel
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence, hypothesis
from tests.diagnosis import worlds
from tests.diagnosis.cases import find_form


def disturbed(effect: Effect, place: str, name: str, shape: Shape, amplitudes: np.ndarray) -> Likelihood:
    """A nominal arm's recordings with an effect's own prediction added to their residuals."""
    trials = worlds.trials(worlds.world(3, "AB"))
    for trial in trials:
        form = find_form(effect, trial, place, name)
        for (channel, joint), rows in form.columns(trial, shape).items():
            trial.equations.residual[channel][:, joint] += amplitudes @ rows
    return Likelihood(trials)


@pytest.mark.parametrize(
    "family, joint, name, shape, amplitudes, expected",
    [
        (
            "torque_sensor_error", "lift", "warm-up", {"T": 4.0}, (0.05, 1.0, -0.6),
            {"g": 0.05, "b": 1.0, "w": -0.6, "T": 4.0},
        ),
        (
            "torque_sensor_error", "lift", "gain and drift", {}, (0.05, 1.0, 0.05),
            {"g": 0.05, "b": 1.0, "d": 0.05},
        ),
        (
            "thermal_friction", "turn", "by its work", {"T": 3.0, "vw": 0.2, "v": 0.005}, (0.3, 0.8),
            {"Finf": 0.3, "F0": 1.1, "T": 3.0, "vw": 0.2},
        ),
        (
            "thermal_friction", "turn", "by its path", {"path": 1.5, "v": 0.005}, (0.3, 0.8),
            {"Finf": 0.3, "F0": 1.1, "path": 1.5},
        ),
        (
            "friction_asymmetry", "turn", "offset ahead", {"v": 0.05, "b": 0.03}, (0.8,),
            {"mean": 0.8, "difference": -0.8 * np.tanh(0.6)},
        ),
        (
            "friction_asymmetry", "turn", "offset behind", {"v": 0.05, "b": 0.03}, (0.8,),
            {"mean": 0.8, "difference": 0.8 * np.tanh(0.6)},
        ),
        (
            "stribeck_friction", "turn", "rational", {"v": 0.004, "vs": 0.12}, (0.3, 0.6),
            {"Fc": 0.3, "drop": 0.6, "vs": 0.12},
        ),
    ],
)  # fmt: skip
def test_what_is_put_in_comes_out(
    family: str,
    joint: str,
    name: str,
    shape: Shape,
    amplitudes: tuple[float, ...],
    expected: dict[str, float],
) -> None:
    place = f"joint:{joint}"
    (effect,) = library([family])
    likelihood = disturbed(effect, place, name, shape, np.array(amplitudes))
    trial, evidence = likelihood.trials[0], Evidence(likelihood)
    form = find_form(effect, trial, place, name)
    found = form.parameters(trial, shape, np.array(amplitudes))
    assert {k: found[k] for k in expected} == pytest.approx(expected)
    starts = [hypothesis(likelihood, effect, form, start) for start in form.shapes]
    fits = [evidence.fit([h]) for h in starts if h is not None]
    fit = evidence.refine(max(fits, key=lambda f: f.log_evidence), 0, 60)
    h = fit.hypotheses[0]
    again = form.parameters(trial, h.shape, fit.amplitudes[0])
    assert {k: again[k] for k in expected} == pytest.approx(expected, rel=0.15)


def test_a_sensor_that_reads_a_tenth_is_no_gain_error() -> None:
    """All friction of a joint without load would be a gain of -0.9."""
    (effect,) = library(["torque_sensor_error"])
    trial = worlds.trials(worlds.world(3, "A"))[0]
    for name, rest in (("gain and bias", (0.0,)), ("warm-up", (0.0, 0.0)), ("gain and drift", (0.0, 0.0))):
        form = find_form(effect, trial, "joint:lift", name)
        assert not form.is_admissible(trial, form.shapes[0], np.array([-0.9, *rest]))
        assert form.is_admissible(trial, form.shapes[0], np.array([-0.1, *rest]))


def test_a_friction_that_drives_somewhere_in_the_turn_is_none() -> None:
    (effect,) = library(["position_dependent_friction"])
    trial = worlds.trials(worlds.world(3, "A"))[0]

    def possible(level: float, wave: float) -> bool:
        amplitudes = np.array([level, wave, 0.0, 0.0, 0.0])
        form = find_form(effect, trial, "joint:turn", "friction everywhere")
        return form.is_admissible(trial, {"k": 6.0}, amplitudes)

    assert possible(0.5, 0.4)
    assert not possible(0.1, 0.4), "negative over most of the turn"
    assert not possible(0.5, 0.01), "constant: Coulomb's"


def test_a_friction_that_drives_the_joint_one_way_is_none() -> None:
    """A drive's offset alone has a lesser level below zero: no friction has, whatever the model states."""
    (effect,) = library(["friction_asymmetry"])
    trial = worlds.trials(worlds.world(3, "A"))[0]
    form = find_form(effect, trial, "joint:lift", "levels")
    assert form.is_admissible(trial, {"v": 0.005}, np.array([0.8, 0.5]))
    assert form.is_admissible(trial, {"v": 0.005}, np.array([0.8, -0.5]))
    assert not form.is_admissible(trial, {"v": 0.005}, np.array([0.0, -2.5])), "an offset of the drive"
    assert not form.is_admissible(trial, {"v": 0.005}, np.array([0.5, 2.5])), "drives one way"


def test_encoder_noise_does_not_turn_a_stiff_bristle_over() -> None:
    rate, rng = 1000.0, np.random.default_rng(0)
    time = np.arange(0.0, 4.0, 1.0 / rate)
    position, velocity = 0.2 * np.sin(time), 0.2 * np.cos(time)
    exact = bristle(position, 5e-5)
    along = bristle(travel(velocity + 1e-3 * rng.standard_normal(len(time)), rate), 5e-5)
    read = bristle(position + 2e-4 * rng.standard_normal(len(time)), 5e-5)
    assert np.std(along - exact) < 0.1 < np.std(read - exact)


def test_a_limit_below_what_the_drives_torque_may_be_off_by_is_none() -> None:
    """A brake that grabs at times was named a limit of 0.02 N m on a drive of 39 N m."""
    trial = worlds.trials(worlds.world(3, "A"))[0]
    form = find_form(SATURATION, trial, "joint:turn", "drive")
    assert isinstance(form, DriveClip)
    known = unknown_torque(trial, 0)
    assert known == pytest.approx(0.004 * 40.0)
    trial.motion.sure_torque[::2, 0] = 0.0  # half of the time nothing is asked for: it is not in its limit
    asked = trial.motion.sure_torque[:, 0]
    assert np.mean(np.abs(asked) > 0.9 * known) < 0.75
    assert not form.is_possible(trial, {"L": 0.9 * known})
    assert form.is_possible(trial, {"L": 1.1 * known})


def test_what_nothing_drives_has_no_friction_by_its_load() -> None:
    """A pendulum on a driven arm transmits its friction alone: the model's load there is the residual."""
    (effect,) = library(["load_dependent_friction"])
    trials = worlds.trials(worlds.world(3, "AB"))
    joint = trials[0].recording.arm.joints.index("lift")
    form = find_form(effect, trials[0], "joint:lift", "")
    likelihood = Likelihood(trials)
    assert hypothesis(likelihood, effect, form, form.shapes[0]) is not None
    for trial in trials:
        assert trial.motion.u is not None
        trial.motion.u[:, joint] = 0.0
    assert hypothesis(likelihood, effect, form, form.shapes[0]) is None
