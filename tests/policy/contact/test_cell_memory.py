"""What stays from one insertion to the next."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.pose import Pose
from samrl_core.policy.contact.cell_memory import (
    MemorySettings,
    after_insertion,
    after_touch,
    at_view,
    no_memory,
)

S = MemorySettings()
HERE = Pose.from_rpy(np.array([0.5, 0.3, 0.4]), (0.0, 0.0, 0.0))
ERROR = np.array([0.0011, -0.0007])


def beside(way: float) -> Pose:
    return Pose(HERE.position + [way, 0.0, 0.0], HERE.quat_xyzw)


def test_the_same_view_errs_again_and_is_believed_the_more_often_it_did() -> None:
    memory, spreads = no_memory(S), []
    assert at_view(memory, HERE, S)[1] == pytest.approx(S.unknown**2)
    for _ in range(4):
        memory = after_insertion(memory, HERE, ERROR, S)
        error, variance = at_view(memory, HERE, S)
        spreads.append(variance)
    assert np.linalg.norm(error - ERROR) < 0.1 * np.linalg.norm(ERROR)
    assert spreads == sorted(spreads, reverse=True) and spreads[-1] < 0.5 * S.unknown**2
    assert spreads[-1] > S.other_place**2, "another place of the hole always differs"


def test_it_fades_with_the_cameras_way() -> None:
    memory = after_insertion(no_memory(S), HERE, ERROR, S)
    near, near_variance = at_view(memory, beside(0.01), S)
    far, far_variance = at_view(memory, beside(1.0), S)
    assert np.linalg.norm(near) > 0.9 * np.linalg.norm(memory.error) > 10 * np.linalg.norm(far)
    assert memory.variance < near_variance < far_variance
    half, _ = at_view(memory, beside(S.way), S)
    np.testing.assert_allclose(half, 0.5 * memory.error)


def test_what_is_stated_is_what_is_scattered() -> None:
    """Cells drawn as the settings say: the error left is as large as stated."""
    rng, left = np.random.default_rng(3), []
    for _ in range(400):
        stays = S.unknown * rng.standard_normal(2)
        memory = no_memory(S)
        for _ in range(3):
            once = stays + S.other_place * rng.standard_normal(2)
            memory = after_insertion(memory, HERE, once + S.found * rng.standard_normal(2), S)
        error, variance = at_view(memory, HERE, S)
        left.append((stays + S.other_place * rng.standard_normal(2) - error) / np.sqrt(variance))
    assert 0.75 < np.sqrt(np.mean(np.square(left))) < 1.15


def test_a_touch_corrects_the_height() -> None:
    memory = after_touch(no_memory(S), 0.0006, S)
    assert 0.0003 < memory.height < 0.0006 and memory.height_variance < S.height**2
    again = after_touch(memory, 0.0006, S)
    assert memory.height < again.height < 0.0006 and again.height_variance < memory.height_variance
