"""Ranges of the catalogue at a joint: what a severity means, the same as in the first set."""

from __future__ import annotations

import math

from samrl_core.blind_test.disturbances.disturbance import Site

_PANDA_SHOULDER = 87.0  # [N m], the effort limit for which the catalogue's ranges stand


def drive_share(site: Site, joint: int | None = None) -> float:
    """Effort limit of a joint against that of the joint which the catalogue's ranges are for."""
    return float(site.spec.limits.effort[site.joint if joint is None else joint]) / _PANDA_SHOULDER


def friction_share(site: Site) -> float:
    """Friction of a smaller drive: it falls with the root of its torque, seals and preload as they are."""
    return math.sqrt(drive_share(site))


def either_sign(site: Site) -> float:
    """+1 or -1."""
    return float(site.rng.choice((-1.0, 1.0)))


def between(site: Site, low: float, high: float) -> float:
    """Uniform in [low, high]."""
    return float(site.rng.uniform(low, high))


def moved(site: Site) -> tuple[float, float]:
    """Middle and half width of the range that the joint travels in the recordings [rad]."""
    low, high = float(site.lowest[site.joint]), float(site.highest[site.joint])
    return 0.5 * (low + high), 0.5 * (high - low)
