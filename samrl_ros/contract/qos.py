"""The QoS profiles that samrl_ros.contract.topics names, as rclpy profiles."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from samrl_core.common.errors import InputError
from samrl_ros.contract import topics


def _profile(depth: int, *, reliable: bool = True, latched: bool = False) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


PROFILES: dict[str, QoSProfile] = {
    topics.STATE: _profile(10),
    topics.COMMAND: _profile(10),
    topics.SENSOR: _profile(5, reliable=False),
    topics.LATCHED: _profile(1, latched=True),
    topics.CLOCK: _profile(1, reliable=False),
    topics.STATIC_TF: _profile(1, latched=True),
    topics.DIAGNOSTICS: _profile(10),
}


def qos_named(name: str, depth: int = 0) -> QoSProfile:
    """The profile of that name, its queue at least `depth` long. Raises InputError for an unknown one."""
    if name not in PROFILES:
        raise InputError(f"unknown QoS profile {name!r}; known are {', '.join(PROFILES)}")
    profile = PROFILES[name]
    if depth <= profile.depth:
        return profile
    return QoSProfile(
        history=profile.history,
        depth=depth,
        reliability=profile.reliability,
        durability=profile.durability,
    )
