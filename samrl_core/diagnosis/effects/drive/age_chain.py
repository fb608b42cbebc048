"""Forward-backward over a packet's age: grown by one sample, unchanged, younger by one, or set anew."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from samrl_core.common.warp_runtime import start as start_warp

PSEUDO = 1.0  # transitions that are believed before any were seen, as the first guess has them


@dataclass(frozen=True, eq=False)
class AgeChain:
    """Probabilities of the next sample's age; (B, ages) each, of B chains."""

    up: np.ndarray  # one sample older; the oldest stays the oldest
    stay: np.ndarray
    down: np.ndarray  # one sample younger
    new: np.ndarray  # set anew
    target: np.ndarray  # what it is set to: sums to one

    @staticmethod
    def held(chains: int, ages: int) -> AgeChain:
        """Packets that get lost: the last one grows old until the next arrives, which is fresh."""
        zero = np.zeros((chains, ages))
        up = np.full_like(zero, 0.5)
        up[:, 0] = 0.02
        target = zero.copy()
        target[:, 0] = 1.0
        return AgeChain(up, zero, zero, 1.0 - up, target)

    @staticmethod
    def wandering(chains: int, ages: int) -> AgeChain:
        """A delay that stays for a while, drifts by single samples, and now and then jumps."""
        one = np.ones((chains, ages))
        return AgeChain(0.2 * one, 0.5 * one, 0.2 * one, 0.1 * one, one / ages)

    def learnt(self, counts: np.ndarray) -> AgeChain:
        """From expected transitions (B, 5, ages) in the order of the fields."""
        total = counts + PSEUDO * np.stack([self.up, self.stay, self.down, self.new, self.target], axis=1)
        # A drift does not depend on the age. Losses come in bursts (Gilbert 1960, Bell Syst. Tech. J. 39):
        # the first has a probability of its own, and further ones another.
        alike = slice(None) if self.stay.any() else slice(1, None)
        total[:, :4, alike] = np.sum(total[:, :4, alike], axis=2, keepdims=True)
        moves = total[:, :4] / np.sum(total[:, :4], axis=1, keepdims=True)
        target = total[:, 4] / np.sum(total[:, 4], axis=1, keepdims=True)
        return AgeChain(moves[:, 0], moves[:, 1], moves[:, 2], moves[:, 3], target)


@wp.kernel(enable_backward=False, module="unique")
def _smooth(
    e: wp.array3d(dtype=wp.float64),
    moves: wp.array3d(dtype=wp.float64),
    g: wp.array3d(dtype=wp.float64),
    work: wp.array3d(dtype=wp.float64),
    counts: wp.array3d(dtype=wp.float64),
    logs: wp.array(dtype=wp.float64),
):
    c = wp.tid()
    frames = e.shape[1]
    n = e.shape[2]
    zero = wp.float64(0.0)
    total = zero
    for t in range(frames):
        renewed = zero
        if t > 0:
            for a in range(n):
                renewed += g[c, t - 1, a] * moves[c, 3, a]
        norm = zero
        for a in range(n):
            p = moves[c, 4, a]
            if t > 0:
                p = renewed * moves[c, 4, a] + g[c, t - 1, a] * moves[c, 1, a]
                if a > 0:
                    p += g[c, t - 1, a - 1] * moves[c, 0, a - 1]
                if a == n - 1:
                    p += g[c, t - 1, a] * moves[c, 0, a]
                if a < n - 1:
                    p += g[c, t - 1, a + 1] * moves[c, 2, a + 1]
                if a == 0:
                    p += g[c, t - 1, a] * moves[c, 2, a]
            p = p * e[c, t, a]
            g[c, t, a] = p
            norm += p
        norm = wp.max(norm, wp.float64(1.0e-280))
        total += wp.log(norm)
        for a in range(n):
            g[c, t, a] = g[c, t, a] / norm
    logs[c] = total
    # work[c, 0]: beta(t + 1) e(t + 1), scaled so that sum of alpha beta is one; work[c, 1]: beta(t)
    for s in range(frames - 1):
        t = frames - 2 - s
        # posterior(t + 1) = alpha beta: beta from it is not kept, so it is carried along in `work`.
        for a in range(n):
            if s == 0:
                work[c, 1, a] = wp.float64(1.0)
            work[c, 0, a] = work[c, 1, a] * e[c, t + 1, a]
        renewed = zero
        for a in range(n):
            renewed += moves[c, 4, a] * work[c, 0, a]
        norm = zero
        for a in range(n):
            older = wp.min(a + 1, n - 1)
            younger = wp.max(a - 1, 0)
            b = moves[c, 0, a] * work[c, 0, older] + moves[c, 1, a] * work[c, 0, a]
            b += moves[c, 2, a] * work[c, 0, younger] + moves[c, 3, a] * renewed
            work[c, 1, a] = b
            norm += g[c, t, a] * b
        norm = wp.max(norm, wp.float64(1.0e-280))
        renewal = zero
        for a in range(n):
            older = wp.min(a + 1, n - 1)
            younger = wp.max(a - 1, 0)
            p = g[c, t, a] / norm
            counts[c, 0, a] += p * moves[c, 0, a] * work[c, 0, older]
            counts[c, 1, a] += p * moves[c, 1, a] * work[c, 0, a]
            counts[c, 2, a] += p * moves[c, 2, a] * work[c, 0, younger]
            counts[c, 3, a] += p * moves[c, 3, a] * renewed
            renewal += p * moves[c, 3, a]
            work[c, 1, a] = work[c, 1, a] / norm
            g[c, t, a] = g[c, t, a] * work[c, 1, a]
        for a in range(n):
            counts[c, 4, a] += renewal * moves[c, 4, a] * work[c, 0, a]


def forward_backward(logs: np.ndarray, chain: AgeChain) -> tuple[np.ndarray, np.ndarray, AgeChain]:
    """Posterior (B, F, ages), log likelihood (B,) [nat], and the chain that makes the ages more probable.

    Args:
        logs: log likelihood (B, F, ages) of each sample given its age.
        chain: probabilities of transitions.
    """
    start_warp()
    most = np.max(logs, axis=2)
    moves = np.stack([chain.up, chain.stay, chain.down, chain.new, chain.target], axis=1)
    chains, _, ages = logs.shape
    arrays: list[Any] = [
        wp.from_numpy(np.ascontiguousarray(x, dtype=np.float64), dtype=wp.float64, device="cpu")
        for x in (
            np.exp(logs - most[:, :, None]), moves, np.zeros_like(logs), np.zeros((chains, 2, ages)),
            np.zeros((chains, 5, ages)), np.zeros(chains),
        )
    ]  # fmt: skip
    wp.launch(_smooth, dim=chains, inputs=arrays, device="cpu")
    posterior, counts, scale = arrays[2].numpy(), arrays[4].numpy(), arrays[5].numpy()
    return posterior, scale + np.sum(most, axis=1), chain.learnt(counts)
