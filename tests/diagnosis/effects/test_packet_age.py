"""Ages of packets: the chain against brute force, and losses put into a stream are found again."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from samrl_core.diagnosis.effects.drive.age_chain import AgeChain, forward_backward
from samrl_core.diagnosis.residuals.basis_functions import resonant


def step(chain: AgeChain, a: int, b: int) -> float:
    """Probability that age b follows age a."""
    last = chain.up.shape[1] - 1
    p = chain.new[0, a] * chain.target[0, b]
    p += chain.stay[0, a] * (b == a) + chain.up[0, a] * (b == min(a + 1, last))
    return float(p + chain.down[0, a] * (b == max(a - 1, 0)))


@pytest.mark.parametrize("make", [AgeChain.held, AgeChain.wandering])
def test_chain_against_all_paths(make: type[AgeChain]) -> None:
    chain, rng = make(1, 3), np.random.default_rng(0)  # ty: ignore[missing-argument]
    assert np.allclose(chain.up + chain.stay + chain.down + chain.new, 1.0)
    logs = rng.normal(size=(1, 5, 3))
    posterior, total, learnt = forward_backward(logs, chain)
    expected, evidence = np.zeros((5, 3)), 0.0
    for path in product(range(3), repeat=5):
        p = float(chain.target[0, path[0]])
        for a, b in zip(path[:-1], path[1:], strict=True):
            p *= step(chain, a, b)
        p *= float(np.exp(sum(logs[0, t, a] for t, a in enumerate(path))))
        evidence += p
        expected[range(5), path] += p
    np.testing.assert_allclose(posterior[0], expected / evidence, atol=1e-9)
    assert total[0] == pytest.approx(np.log(evidence))
    assert np.allclose(learnt.up + learnt.stay + learnt.down + learnt.new, 1.0)
    assert np.allclose(learnt.target.sum(axis=1), 1.0)


def test_learnt_chain_is_more_probable() -> None:
    rng = np.random.default_rng(1)
    logs = np.where(rng.random((1, 400, 1)) < 0.3, [[0.0, 2.0, 0.0]], [[2.0, 0.0, 0.0]])
    chain, before = AgeChain.held(1, 3), -np.inf
    for _ in range(5):
        _, total, chain = forward_backward(logs, chain)
        assert total[0] > before - 1.0  # but for the pseudo counts
        before = float(total[0])
    assert chain.up[0, 0] > 0.1


def test_second_order_is_down_by_3_db_at_its_cutoff() -> None:
    time = np.arange(0.0, 4.0, 0.001)
    wave = np.sin(2 * np.pi * 8.0 * time)
    out = resonant(wave, 8.0, np.sqrt(0.5), 0.001)
    assert np.std(out[2000:]) / np.std(wave[2000:]) == pytest.approx(np.sqrt(0.5), rel=0.01)
