"""Twists of rigid transforms and of a chain against finite differences."""

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.diagnosis.residuals.poses import rigid
from samrl_core.diagnosis.residuals.poses.chain import Chain, Constants
from tests.diagnosis.poses.pose_worlds import PoseWorld, record

STEP = 1e-6


@pytest.mark.parametrize("angle", [0.0, 0.04, 0.06, 0.5, 2.0, 3.1])
def test_a_small_twist_behind_moves_the_logarithm_as_its_jacobian_says(angle: float):
    rng = np.random.default_rng(3)
    axis = rng.normal(size=3)
    twist = np.concatenate([rng.normal(size=3), angle * axis / np.linalg.norm(axis)])[None]
    steps = STEP * np.eye(6)
    ahead, behind = (
        np.concatenate([rigid.log(rigid.exp(twist) @ rigid.exp(sign * d)) for d in steps]) for sign in (1, -1)
    )
    assert rigid.inverse_jacobian(twist)[0] == pytest.approx((ahead - behind).T / (2 * STEP), abs=1e-6)


@pytest.fixture(scope="module")
def chain() -> Chain:
    recording = record(PoseWorld(seconds=4.0))
    return Chain(recording, Constants.stated(recording))


def test_offsets_of_the_clock_are_read_together_as_one_by_one(chain: Chain):
    offsets = np.array([-0.3, 0.0, 0.07])
    each = np.stack([chain.predicted((offset, offset)) for offset in offsets])
    assert chain.predicted_each(offsets) == pytest.approx(each, abs=1e-12)


@pytest.mark.parametrize("shift", [0.0, 0.11])
def test_constants_move_the_target_as_their_twists_say(chain: Chain, shift: float):
    kept = chain.constants
    for name, twists in chain.error_twists((shift, shift)).items():
        for twist, step in zip(twists, STEP * np.eye(6), strict=True):
            moved = []
            for sign in (1, -1):
                matrix = getattr(kept, name) @ rigid.exp(sign * step)[0]
                chain.constants = replace(kept, **{name: matrix})
                moved.append(chain.predicted((shift, shift)))
            found = rigid.log(moved[0] @ rigid.inverse(moved[1])) / (2 * STEP)
            assert twist == pytest.approx(found, abs=1e-6)
    chain.constants = kept


def test_a_shift_is_measured_from_the_constants_as_they_are(chain: Chain):
    kept = chain.constants
    before = chain.shift_twist((0.05, 0.05))
    chain.constants = replace(kept, camera=kept.camera @ rigid.exp(np.full(6, 0.1))[0])
    moved = rigid.log(chain.predicted((0.05, 0.05)) @ rigid.inverse(chain.predicted()))
    assert chain.shift_twist((0.05, 0.05)) == pytest.approx(moved, abs=1e-12)
    assert np.abs(moved - before).max() > 1e-4
    chain.constants = kept
