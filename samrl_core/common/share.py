"""A share of cases and how well it is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

NORMAL_95 = 1.959963984540054  # two-sided 95 % quantile of the normal distribution


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """95 % score interval of a share (E. B. Wilson, JASA 22, 1927); (0, 1) without trials."""
    if trials == 0:
        return 0.0, 1.0
    z2 = NORMAL_95**2
    share = successes / trials
    centre = (share + z2 / (2 * trials)) / (1 + z2 / trials)
    half = NORMAL_95 / (1 + z2 / trials) * np.sqrt(share * (1 - share) / trials + z2 / (4 * trials**2))
    return max(0.0, float(centre - half)), min(1.0, float(centre + half))


@dataclass(frozen=True)
class Share:
    """A share of cases with its Wilson interval; `value` is None without cases."""

    value: float | None
    ci95: tuple[float, float]
    successes: int
    trials: int

    @classmethod
    def of(cls, outcomes: Sequence[bool]) -> Share:
        """Count the true ones."""
        hits, trials = sum(bool(x) for x in outcomes), len(outcomes)
        return cls(hits / trials if trials else None, wilson(hits, trials), hits, trials)

    def as_dict(self) -> dict[str, object]:
        """For JSON."""
        return asdict(self)
