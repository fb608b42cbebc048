"""Noise that remembers within an episode, and actions that stay within what the tool may do."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.policy.agent.exploration import Exploration, clip_norm, within_reach


def noise(memory: float, episodes: int = 400, actions: int = 6, seed: int = 0) -> np.ndarray:
    exploration = Exploration(0.001, memory, np.random.default_rng(seed))
    found = []
    for _ in range(episodes):
        exploration.begin()
        found.append([exploration.next() for _ in range(actions)])
    return np.array(found)


@pytest.mark.parametrize("memory", [0.0, 0.8, 1.0])
def test_noise_has_its_deviation_and_its_memory(memory: float) -> None:
    """At every action alike; an episode knows nothing of the one before."""
    drawn = noise(memory)
    np.testing.assert_allclose(drawn.std(axis=0), 0.001, rtol=0.15)
    later = [np.corrcoef(drawn[:, 0, 0], drawn[:, k, 0])[0, 1] for k in (1, 3)]
    np.testing.assert_allclose(later, [memory, memory**3], atol=0.15)
    assert abs(np.corrcoef(drawn[:-1, -1, 0], drawn[1:, 0, 0])[0, 1]) < 0.15


def test_noise_follows_its_generator() -> None:
    assert np.array_equal(noise(0.9, 2), noise(0.9, 2))
    assert not np.allclose(noise(0.9, 2), noise(0.9, 2, seed=1))
    assert not noise(0.9, 2).std() == 0
    for deviation, memory in ((-0.001, 0.5), (0.001, 1.5), (0.001, -0.1)):
        with pytest.raises(InputError, match="memory"):
            Exploration(deviation, memory, np.random.default_rng(0))


def test_a_longer_vector_is_cut() -> None:
    assert np.array_equal(clip_norm(np.array([0.001, 0.0, 0.0]), 0.003), [0.001, 0.0, 0.0])
    np.testing.assert_allclose(clip_norm(np.array([0.0, 0.006, 0.008]), 0.005), [0.0, 0.003, 0.004])
    assert not clip_norm(np.zeros(3), 0.003).any()


def test_no_sum_is_longer_than_the_tool_may_move() -> None:
    """For any nominal action within it; the residual keeps its direction, and what fits is not touched."""
    rng = np.random.default_rng(3)
    for _ in range(300):
        nominal = clip_norm(0.02 * rng.standard_normal(3), rng.uniform(0.0, 0.02))
        residual = rng.uniform(0.0, 0.02) * rng.standard_normal(3)
        kept = within_reach(nominal, residual, 0.02)
        assert np.linalg.norm(nominal + kept) <= 0.02
        assert np.linalg.norm(np.cross(kept, residual)) < 1e-12 and kept @ residual >= -1e-12
        if np.linalg.norm(nominal + residual) <= 0.02:
            assert np.array_equal(kept, residual)
        else:
            assert np.linalg.norm(nominal + kept) > 0.02 - 1e-6
    with pytest.raises(InputError, match=r"0\.0300 m is longer than the 0\.0200 m"):
        within_reach(np.array([0.03, 0.0, 0.0]), np.zeros(3), 0.02)
