"""From which size on an effect is seen: half of the errors of that size reach the evidence of a name."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.effects import EFFECTS, POSE_EFFECTS
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.kinds.poses.poses import Poses, split_poses
from samrl_core.diagnosis.report.seen_from import seen_from, size
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.tolerances import recording_columns, tolerance_columns
from samrl_core.diagnosis.result import Diagnosis, LeastSize
from samrl_core.diagnosis.selection.hypothesis import Evidence
from samrl_core.diagnosis.verdict.least_sizes import least_sizes, pick_last
from tests.diagnosis import worlds
from tests.diagnosis.controllers import machines
from tests.diagnosis.controllers.kinds import VOLTAGE_MOTOR
from tests.diagnosis.poses.pose_worlds import PoseWorld, record
from tests.diagnosis.report import samples

NEEDED, DRAWS = 8.0, 400


def test_half_of_the_errors_of_the_least_size_reach_what_a_name_needs() -> None:
    """Residuals drawn from noise, tolerances and the error; evidence with whole covariance matrices."""
    trials, _ = Poses().trials([split_poses(record(PoseWorld(seconds=8.0)))[0]], [])
    likelihood = Likelihood(trials)
    evidence = Evidence(likelihood, 1.0)
    effects = [e for e in POSE_EFFECTS if e.family == "hand_eye"]
    told = {s.parameter: s for s in least_sizes(evidence, evidence.screen(effects), NEEDED)}
    (h,) = evidence.screen(effects)[:1]
    noise = np.concatenate([trials[0].sigma[c][:, j] for _, c, j in likelihood.blocks])
    count = len(likelihood.y)

    def stacked(columns: dict) -> np.ndarray:
        rows = {b: columns[b[1:]] for b in likelihood.blocks if b[1:] in columns}
        out = np.zeros((len(next(iter(rows.values()))), count))
        for block, values in rows.items():
            out[:, likelihood.blocks[block]] = values
        return (out / noise).T

    parts = [*tolerance_columns(trials[0], 1.0), *recording_columns(trials[0])]
    u = np.concatenate([std * stacked(columns) for columns, std in parts], axis=1)
    x = stacked(h.form.columns(trials[0], h.shape))
    tolerated = np.eye(count) + u @ u.T
    wide = tolerated + (x * h.spread**2) @ x.T
    more = np.linalg.inv(tolerated) - np.linalg.inv(wide)
    cost = 0.5 * (np.linalg.slogdet(wide)[1] - np.linalg.slogdet(tolerated)[1])
    cost += np.log(h.tried) + h.cost
    rng = np.random.default_rng(0)
    drawn = rng.standard_normal((DRAWS, count)) + rng.standard_normal((DRAWS, u.shape[1])) @ u.T

    def named(size: float) -> float:
        y = drawn + size * x[:, 0]
        return float(np.mean(0.5 * np.einsum("ij,ij->i", y @ more, y) - cost >= NEEDED))

    size = told["x"].stated[1]
    # Noise adds half a nat for each of six amplitudes, so that it is rather more than half.
    assert named(0.5 * size) < 0.1 and 0.4 < named(size) < 0.85 and named(1.5 * size) > 0.95
    assert told["x"].exact[1] < size


@pytest.mark.parametrize(
    ("ends", "unit", "shown"),
    [
        ((-0.0022, 0.0022), "m", "± 0.0022 m"),
        ((-0.41, 0.68), "1", "-0.41 or 0.68"),
        ((-0.41, float("nan")), "1", "-0.41"),
        ((0.31, 0.31), "N m", "0.31 N m"),
        ((5200.0, float("nan")), "N m/rad", "5.2e+03 N m/rad or less"),
        ((float("nan"), float("nan")), "s", "–"),
    ],
)
def test_sizes_are_written_down_and_up(ends: tuple[float, float], unit: str, shown: str) -> None:
    assert size(ends, unit) == shown


def test_what_may_be_one_of_two_things_is_seen_from_the_size_of_the_later_one() -> None:
    """A supply shows from half of a motor's error, both are the drive's gain, and half of it was told."""
    runs = machines.worlds(VOLTAGE_MOTOR, [machines.Differs()], 1, 1.5)[0]
    trials, _ = arm_trials(runs[:1], [])
    evidence = Evidence(Likelihood(trials), 4.0)
    pool = evidence.screen([e for e in EFFECTS if e.family == "actuator_gain"])
    (both,), *each = (
        least_sizes(evidence, some, NEEDED)
        for some in (pool, *([h for h in pool if h.form.thing == thing] for thing in ("motor", "supply")))
    )
    (motor,), (supply,) = each
    assert supply.stated[1] < 0.9 * motor.stated[1]
    assert both == motor
    unseen = replace(supply, stated=(float("nan"), float("nan")))
    assert pick_last([[unseen], [supply]]) == [supply]


@pytest.mark.slow
def test_an_arms_no_gap_says_from_which_friction_on_there_is_one() -> None:
    """A third of that size passes, three times of it is named; a delay's and a spring's size are shapes."""
    library = {"coulomb_friction", "command_delay", "joint_elasticity"}

    def diagnosed(**fields: Any) -> Diagnosis:
        a, b, c = worlds.world(5, **fields)
        return diagnose([a, b], [c], DiagnosisSettings(library=library, simulate=False))[0]

    sound = diagnosed()
    assert sound.verdict == "no_gap", sound.reasons
    told = {(s.effect, s.parameter): s.stated for s in sound.least_sizes}
    friction = told["coulomb_friction@joint:lift", "Fc"][1]
    assert diagnosed(coulomb={worlds.LIFT: friction / 3.0}).verdict == "no_gap"
    (named,) = diagnosed(coulomb={worlds.LIFT: 3.0 * friction}).effects
    assert named.name == "coulomb_friction@joint:lift"
    delay, stiffness = told["command_delay@joint:lift", "T"], told["joint_elasticity@joint:lift", "K"]
    assert math.isnan(delay[0]) and 0.0 < delay[1] < 0.01
    assert math.isnan(stiffness[1]) and stiffness[0] > 100.0  # seen from there on downwards


def test_a_size_whose_sign_turns_with_the_track_has_no_minus_behind_its_sign() -> None:
    assert size((0.011, -0.011), "rad") == size((-0.011, 0.011), "rad") == "± 0.011 rad"


def test_effects_at_many_joints_are_one_row() -> None:
    """From the joint that shows it first to the one that shows it last."""
    nan = float("nan")
    sizes = (
        LeastSize("coulomb_friction@joint:a", "Fc", "N m", (nan, 2.0), (nan, 0.1)),
        LeastSize("coulomb_friction@joint:b", "Fc", "N m", (nan, 0.3), (nan, 0.1)),
        LeastSize("coulomb_friction@joint:c", "Fc", "N m", (nan, nan), (nan, nan)),
        LeastSize("payload@arm:tool", "mass", "kg", (-0.12, 0.12), (-0.01, 0.01)),
    )
    load, friction = seen_from(replace(samples.diagnosis("no_gap"), least_sizes=sizes))
    assert load.short == "payload mass ± 0.12 kg"
    assert friction.stated == "0.3 (b) to 2 N m (a), not seen at c" and friction.exact == "0.1 N m"
    assert friction.effect == "Coulomb friction at any of 3 joints"
