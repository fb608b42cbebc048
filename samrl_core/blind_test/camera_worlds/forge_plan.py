"""Which sealed worlds of a camera a blind test holds: causes, severities and cells, from one seed."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from samrl_core.blind_test.camera_worlds.plan import (
    CAUSES,
    NOTHING,
    ON_REQUEST,
    OUTSIDE,
    CameraWorld,
)
from samrl_core.common.errors import InputError

BACKGROUND = "typical:test"  # cells that nobody developed on
_SEVERITIES = (1.0, 0.75, 0.5)
_STRONG = (1.0, 0.75)  # of what the library does not have


@dataclass(frozen=True)
class CameraForgeSettings:
    """How many sealed worlds of a camera of each kind."""

    seed: int = 0
    single: int = 12  # every known cause once
    none: int = 6
    outside: int = 3
    duration_s: float = 6.0  # of each recording
    causes: tuple[str, ...] = ()  # known ones, of which each goes round; empty for the usual ones

    def __post_init__(self) -> None:
        counts = (self.single, self.none, self.outside)
        if min(counts) < 0 or sum(counts) == 0:
            raise InputError(f"numbers of camera worlds {counts} must not be negative, and not all zero")
        if not 6.0 <= self.duration_s <= 60.0:
            raise InputError(f"recordings of {self.duration_s} s; give 6..60 s")
        known = [c for c in CAUSES if c not in OUTSIDE]
        if unknown := [c for c in self.causes if c not in known]:
            raise InputError(f"no known cause is called {unknown[0]!r}; there are: {', '.join(known)}")


@dataclass(frozen=True)
class CameraItem:
    """One sealed world to be made; nothing else is needed."""

    id: str
    set: str  # single, none, outside
    world: CameraWorld
    duration_s: float

    def as_dict(self) -> dict:
        """For JSON."""
        return asdict(self)


def plan_cameras(settings: CameraForgeSettings) -> list[CameraItem]:
    """All worlds in shuffled order, the same for the same settings; causes go round."""
    rng = np.random.default_rng(settings.seed)
    usual = [c for c in CAUSES if c not in (*OUTSIDE, *ON_REQUEST)]
    known = [str(c) for c in rng.permutation(list(dict.fromkeys(settings.causes)) or usual)]
    unknown = [str(c) for c in rng.permutation(list(OUTSIDE))]
    asked = [
        ("single", known[i % len(known)], _SEVERITIES[i % len(_SEVERITIES)]) for i in range(settings.single)
    ]
    asked += [("none", NOTHING, 0.0)] * settings.none
    asked += [
        ("outside", unknown[i % len(unknown)], _STRONG[i % len(_STRONG)]) for i in range(settings.outside)
    ]
    items = []
    for place, k in enumerate(rng.permutation(len(asked)).tolist()):
        kind, cause, severity = asked[k]
        name = f"c{place:03d}"
        world = CameraWorld(name, int(rng.integers(2**31)), BACKGROUND, cause, severity)
        items.append(CameraItem(name, kind, world, settings.duration_s))
    return items
