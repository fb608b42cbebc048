"""What a fit finds, what it leaves open, and what it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pushes
import pytest

from samrl_core.common.errors import InputError
from samrl_core.model.physical_parameters.identifiability import (
    combinations_of,
    describe_parameters,
    parameters_of,
)
from samrl_core.model.physical_parameters.identify import IdentifySettings, identify
from samrl_core.model.physical_parameters.least_squares import LeastSquaresSettings
from samrl_core.model.physical_parameters.push_record import Disc, PushRecord
from samrl_core.model.physical_parameters.push_scene import NAMES

MASS, FRICTION = 0.7, 0.35


@pytest.fixture(scope="module")
def two() -> list[PushRecord]:
    return [pushes.made_push(MASS, FRICTION, force, seed=i) for i, force in enumerate((6.0, 8.0))]


@pytest.mark.thorough
@pytest.mark.parametrize("share", [0.5, 1.5])
def test_two_pushes_give_mass_and_friction(two: list[PushRecord], share: float) -> None:
    """From 50 % off to within the interval, which is a narrow one."""
    found = identify(two, pushes.DISC, share * MASS, pushes.SETTINGS)
    mass, friction = found.parameter("mass"), found.parameter("table_friction")
    assert found.why_stopped == "converged" and found.explained
    assert found.mass_path[0] == pytest.approx(share * MASS)
    assert mass.value == pytest.approx(MASS, rel=0.05)
    assert mass.lower < MASS < mass.upper and mass.half_width < 0.08
    assert friction.lower < FRICTION < friction.upper
    assert mass.determined and friction.determined


def test_what_a_push_cannot_show_is_said(two: list[PushRecord]) -> None:
    """Inertia and the blade's friction stay the priors'."""
    found = identify(two[:1], pushes.DISC, 1.2 * MASS, pushes.SETTINGS)
    for name in ("inertia_ratio", "blade_friction"):
        assert not found.parameter(name).determined
    assert found.parameter("inertia_ratio").value == pytest.approx(1.0, rel=0.02)


@pytest.mark.thorough
def test_a_second_push_goes_on_where_the_first_ended(two: list[PushRecord]) -> None:
    first = identify(two[:1], pushes.DISC, 0.5 * MASS, pushes.SETTINGS)
    both = identify(two, pushes.DISC, 0.5 * MASS, pushes.SETTINGS, first)
    assert both.why_stopped == "converged"
    assert both.mass_path[0] == pytest.approx(first.parameter("mass").value)
    mass, before = both.parameter("mass"), first.parameter("mass")
    assert mass.value == pytest.approx(MASS, rel=0.05) and mass.lower < MASS < mass.upper
    assert mass.half_width < before.half_width


def test_without_the_slide_only_a_combination_is_known() -> None:
    """A push that is watched only while the blade is at the disc: is it heavy, or rough?"""
    short = pushes.made_push(MASS, FRICTION, 7.0, push_s=0.16, total_s=0.18)
    found = identify([short], pushes.DISC, 1.2 * MASS, pushes.SETTINGS)
    best, worst = found.combinations
    assert best.mass_power > 0.2 and best.friction_power > 0.2  # about their product, the force of friction
    assert worst.mass_power * worst.friction_power < 0
    assert worst.std > 5 * best.std


def test_a_disc_that_stays_is_not_weighed(two: list[PushRecord]) -> None:
    rng = np.random.default_rng(3)
    still = [replace(p, seen=0.053 + 0.001 * rng.standard_normal(len(p.seen))) for p in two]
    found = identify(still, pushes.DISC, 1.0, pushes.SETTINGS)
    assert found.why_stopped == "no_motion"
    assert not any(a.determined for a in found.parameters)
    mass = found.parameter("mass")
    assert mass.value == pytest.approx(1.0) and mass.lower < 0.3 and mass.upper > 3.0


def test_data_of_another_world_are_not_explained(two: list[PushRecord]) -> None:
    """The disc seen to run away from the blade on its own."""
    away = replace(two[0], seen=two[0].seen + np.linspace(0.0, 0.2, len(two[0].seen)))
    few = replace(pushes.SETTINGS, solver=LeastSquaresSettings(max_iterations=6))
    found = identify([away], pushes.DISC, MASS, few)
    assert not found.explained and found.misfit > 4.0


def test_a_drive_beyond_all_numbers_diverges(two: list[PushRecord]) -> None:
    mad = replace(two[0], free_acceleration=np.full_like(two[0].free_acceleration, 1e200))
    found = identify([mad], pushes.DISC, MASS, pushes.SETTINGS)
    assert found.why_stopped == "diverged" and not found.explained
    assert not any(a.determined for a in found.parameters)


@pytest.mark.parametrize("guess", [0.0, -0.5, float("nan"), float("inf")])
def test_a_guess_that_is_no_mass_is_refused(two: list[PushRecord], guess: float) -> None:
    with pytest.raises(InputError, match="mass guess"):
        identify(two, pushes.DISC, guess, pushes.SETTINGS)


def test_nothing_to_fit_to_is_refused() -> None:
    with pytest.raises(InputError, match="no push"):
        identify([], pushes.DISC, 1.0, pushes.SETTINGS)
    with pytest.raises(InputError, match="noise"):
        IdentifySettings(seen_noise=0.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"period_s": 0.0}, "period"),
        ({"effective_mass": np.zeros(240)}, "mass"),
        ({"tip": np.full(240, np.nan)}, "tip"),
        ({"free_acceleration": np.zeros(7)}, "shape"),
        ({"push_steps": 0}, "push"),
        ({"push_steps": 700}, "push"),
        ({"seen": np.zeros(1), "seen_step": np.zeros(1, dtype=int)}, "sightings"),
        ({"seen_step": np.zeros(13, dtype=int)}, "order"),
        ({"seen_step": np.arange(13) + 600}, "outside"),
    ],
)
def test_impossible_records_are_refused(
    two: list[PushRecord], changes: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        replace(two[0], **changes)


@pytest.mark.parametrize("sizes", [(0.0, 0.01, 0.04), (0.05, -0.01, 0.04), (0.05, 0.01, 0.06)])
def test_impossible_discs_are_refused(sizes: tuple[float, float, float]) -> None:
    with pytest.raises(InputError, match="disc"):
        Disc(*sizes)


def test_intervals_and_combinations_are_those_of_the_covariance() -> None:
    """Only the product is known: log m and log mu fall together."""
    covariance = np.diag(np.full(len(NAMES), 0.01))
    covariance[:2, :2] = 0.01 * np.array([[1.0, -0.99], [-0.99, 1.0]])
    best, worst = combinations_of(covariance, NAMES)
    assert (best.mass_power, best.friction_power) == pytest.approx((2**-0.5, 2**-0.5))
    assert best.std == pytest.approx(0.01) and worst.std == pytest.approx(0.1 * 1.99**0.5)
    mass = parameters_of(NAMES, np.zeros(len(NAMES)), covariance, np.full(len(NAMES), 0.4))[0]
    assert (mass.lower, mass.upper) == pytest.approx((np.exp(-0.196), np.exp(0.196)), rel=1e-4)
    assert mass.determined and mass.shrink == pytest.approx(0.25)
    spread = np.full(len(NAMES), 0.4)
    spread[2] = 0.1  # the prior of the inertia is all that is known of it
    text = " / ".join(
        describe_parameters(parameters_of(NAMES, np.zeros(len(NAMES)), covariance, spread), (best, worst))
    )
    assert "mass is 1, 95 % interval" in text and "mass and friction are not separated" in text
    assert "not determined, the values are the priors': inertia_ratio /" in text
    with pytest.raises(InputError, match="prior"):
        parameters_of(NAMES, np.zeros(len(NAMES)), 0 * covariance, np.ones(len(NAMES)))
