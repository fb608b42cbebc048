"""Quality of service as bags carry it: YAML in words (rosbag2 metadata 9), numbers in older bags."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import yaml

from samrl_core.common.errors import InputError
from samrl_core.common.text_files import parse_yaml
from samrl_ros.contract import topics

# rmw's "infinite" duration, as rosbag2 writes it: 2^63 - 1 ns.
_INFINITE = {"sec": 9223372036, "nsec": 854775807}
# Position = number in the enums of rmw/types.h, which bags before metadata 9 carry.
_HISTORY = ("system_default", "keep_last", "keep_all", "unknown")
_RELIABILITY = ("system_default", "reliable", "best_effort", "unknown", "best_available")
_DURABILITY = ("system_default", "transient_local", "volatile", "unknown", "best_available")


@dataclass(frozen=True)
class QoS:
    """What a publisher offers. Words as in rosbag2."""

    reliability: str = "reliable"
    durability: str = "volatile"
    history: str = "keep_last"
    depth: int = 10  # [messages]

    def __post_init__(self) -> None:
        for value, words, name in (
            (self.reliability, _RELIABILITY, "reliability"),
            (self.durability, _DURABILITY, "durability"),
            (self.history, _HISTORY, "history"),
        ):
            if value not in words:
                raise InputError(f"QoS {name} {value!r} is unknown; use one of {', '.join(words)}")
        if self.depth < 0:
            raise InputError(f"QoS depth {self.depth} must not be negative")

    @property
    def latched(self) -> bool:
        """Late joiners receive the last messages."""
        return self.durability == "transient_local"

    def to_profile(self) -> dict[str, Any]:
        """The profile as rosbag2 stores it in metadata 9."""
        return {
            "history": self.history,
            "depth": self.depth,
            "reliability": self.reliability,
            "durability": self.durability,
            "deadline": dict(_INFINITE),
            "lifespan": dict(_INFINITE),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_INFINITE),
            "avoid_ros_namespace_conventions": False,
        }


# The profiles that samrl_ros.contract.topics names.
PROFILES: dict[str, QoS] = {
    topics.STATE: QoS(),
    topics.COMMAND: QoS(),
    topics.SENSOR: QoS(reliability="best_effort", depth=5),
    topics.LATCHED: QoS(durability="transient_local", depth=1),
    topics.CLOCK: QoS(reliability="best_effort", depth=1),
    topics.STATIC_TF: QoS(durability="transient_local", depth=1),
    topics.DIAGNOSTICS: QoS(),
}


def topic_qos(name: str) -> QoS:
    """QoS of a topic of the cell's table. Raises `InputError` for a topic that is not in it."""
    try:
        return PROFILES[topics.TOPICS[name].qos]
    except KeyError as error:
        raise InputError(f"topic {name} is not in the cell's table; give its QoS explicitly") from error


def dump_profiles(profiles: tuple[QoS, ...]) -> str:
    """YAML list for a channel's `offered_qos_profiles`."""
    return yaml.safe_dump([qos.to_profile() for qos in profiles], sort_keys=False).strip()


def load_profiles(text: str | list[Any] | None) -> tuple[QoS, ...]:
    """Profiles from a channel's YAML text or a list out of metadata.yaml; words or numbers.

    A bag is readable without them, so what cannot be understood gives an empty tuple.
    """
    if isinstance(text, str):
        try:
            text = parse_yaml(text, "offered_qos_profiles")
        except InputError:
            return ()
    if not isinstance(text, list):
        return ()
    try:
        return tuple(_from_profile(entry) for entry in text)
    except (InputError, KeyError, TypeError, ValueError, IndexError, OverflowError):
        return ()


def _from_profile(entry: dict[str, Any]) -> QoS:
    return QoS(
        _word(entry["reliability"], _RELIABILITY),
        _word(entry["durability"], _DURABILITY),
        _word(entry["history"], _HISTORY),
        int(entry["depth"]),
    )


def _word(value: str | int, words: tuple[str, ...]) -> str:
    return words[value] if isinstance(value, int) else value
