from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from samrl_core.blind_test.baselines.claim import NOTHING
from samrl_core.blind_test.baselines.registry import BASELINES, baseline
from samrl_core.blind_test.baselines.samples import make_samples
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError


def _arm_module() -> Any:
    spec = importlib.util.spec_from_file_location(
        "two_joint_arm", Path(__file__).with_name("two_joint_arm.py")
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


ARM = _arm_module()


@pytest.fixture(scope="module")
def clean() -> Sequence[ArmRecording]:
    return [ARM.record("A", 1), ARM.record("B", 2)]


@pytest.fixture(scope="module")
def rubbing() -> Sequence[ArmRecording]:
    """Viscous friction at the second joint."""
    return [ARM.record(n, s, friction=lambda dq: np.array([0.0, 0.8]) * dq) for n, s in (("A", 3), ("B", 4))]


@pytest.fixture(scope="module")
def weak_drive() -> Sequence[ArmRecording]:
    """Six per cent of the first drive's torque missing."""
    return [ARM.record(n, s, gain=(0.94, 1.0)) for n, s in (("A", 5), ("B", 6))]


@pytest.mark.thorough
@pytest.mark.parametrize("name", sorted(BASELINES))
def test_every_baseline_finds_an_obvious_cause(name: str, rubbing: Sequence[ArmRecording]) -> None:
    claim = baseline(name)(rubbing)
    assert (claim.family, claim.place) == ("viscous_friction", "joint:j2")


@pytest.mark.parametrize("name", ["all_parameters", "argmin_rmse", "sparse_regression"])
def test_regressions_find_a_weak_drive(name: str, weak_drive: Sequence[ArmRecording]) -> None:
    claim = baseline(name)(weak_drive)
    assert claim.place == "joint:j1"
    assert claim.family == "actuator_gain"


def test_argmin_always_names_something(clean: Sequence[ArmRecording]) -> None:
    assert baseline("argmin_rmse")(clean).family is not None


@pytest.mark.parametrize("name", ["all_parameters", "sparse_regression"])
def test_others_may_name_nothing(name: str, clean: Sequence[ArmRecording]) -> None:
    assert baseline(name)(clean) == NOTHING


def test_residuals_of_a_clean_arm_are_noise(clean: Sequence[ArmRecording]) -> None:
    s = make_samples(clean, (0.005,))
    for residual in s.residuals:
        assert np.abs(residual).max() < 0.15  # N m, of 40 and 20


def test_missing_channels_are_refused(clean: Sequence[ArmRecording]) -> None:
    with pytest.raises(InputError, match="baselines need them"):
        make_samples([replace(clean[0], commanded_effort=None)], (0.005,))
    with pytest.raises(InputError, match="'effort'"):
        make_samples([replace(clean[0], states=replace(clean[0].states, effort=None))], (0.005,))


def test_claims_score_like_reports() -> None:
    assert NOTHING.as_report()["verdict"] == "no_gap"
    with pytest.raises(InputError, match="argmin_rmse"):
        baseline("guess")
