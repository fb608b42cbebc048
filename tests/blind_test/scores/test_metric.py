from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.blind_test.scores.shrink_scores import shrinks_of
from samrl_core.cell.types.arm_description import ArmController, ArmDescription, Tolerances
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.selection.gap_metric import channel_scales, gap_metric, shrink


def _arm(**changes: object) -> ArmDescription:
    controller = ArmController(
        ("a", "b"),
        np.array([100.0, 200.0]),
        np.array([10.0, 5.0]),
    )
    return ArmDescription("tool_arm", ("a", "b"), None, controller, tolerances=Tolerances(**changes))


def test_scales_are_what_a_tolerated_torque_does() -> None:
    scales = channel_scales(_arm(torque_offset=0.03, coulomb_friction=0.04), np.array([10.0, 20.0]))
    np.testing.assert_allclose(scales["effort"], [0.5, 1.0])  # 3-4-5 triangle of 10 and 20 N m
    np.testing.assert_allclose(scales["position"], [0.005, 0.005])
    np.testing.assert_allclose(scales["velocity"], [0.05, 0.2])


@pytest.mark.parametrize("limit", [np.array([0.0, 1.0]), np.array([np.inf, 1.0])])
def test_scales_refuse_missing_limits(limit: np.ndarray) -> None:
    with pytest.raises(InputError, match="effort limit"):
        channel_scales(_arm(), limit)


def test_scales_refuse_no_tolerance_at_all() -> None:
    with pytest.raises(InputError, match="both zero"):
        channel_scales(_arm(torque_offset=0.0, coulomb_friction=0.0), np.ones(2))


def test_metric_is_the_rms_over_channels_in_units_of_their_scales() -> None:
    measured = {
        "position": np.array([[0.0], [0.0]]),
        "effort": np.array([[5.0], [np.nan]]),
        "extra": np.ones((2, 1)),
    }
    simulated = {"position": np.array([[0.1], [0.1]]), "effort": np.array([[1.0], [9.0]])}
    scales = {"position": np.array([0.1]), "effort": np.array([2.0])}
    assert gap_metric(measured, simulated, scales) == pytest.approx(np.sqrt((1 + 1 + 4) / 3))


def test_a_simulation_that_exploded_has_an_infinite_gap() -> None:
    one = {"effort": np.ones((1, 1))}
    assert gap_metric({"effort": np.zeros((1, 1))}, {"effort": np.full((1, 1), np.nan)}, one) == np.inf
    assert shrink(1.0, np.inf) == -1.0


def test_metric_refuses_nothing_in_common_and_other_shapes() -> None:
    with pytest.raises(InputError, match="no channel"):
        gap_metric({"effort": np.ones((1, 1))}, {}, {})
    with pytest.raises(InputError, match="simulated as"):
        gap_metric({"effort": np.ones((2, 1))}, {"effort": np.ones((1, 1))}, {"effort": np.ones(1)})


def test_shrink_against_the_oracle_on_the_stamps_of_the_diagnosis(tmp_path: Path) -> None:
    time = np.array([0.0, 1.0, 2.0])
    measured = np.zeros((3, 1))
    np.savez(
        tmp_path / "r.npz",
        time=time,
        effort_measured=measured,
        effort_nominal=measured + 10,
        effort_with_effect=measured + 4,
    )
    oracle = {
        "time": np.array([0.0, 0.5, 1.0, 1.5, 2.0]),
        "effect_effort": np.full((5, 1), 2.0),
        "scale_effort": np.array([2.0]),
        "scale_position": np.array([1.0]),
    }
    s = shrinks_of(tmp_path / "r.npz", oracle)
    assert (s.nominal, s.with_effect, s.oracle) == (5.0, 2.0, 1.0)
    assert (s.shrink, s.oracle_shrink) == (pytest.approx(0.6), pytest.approx(0.8))
