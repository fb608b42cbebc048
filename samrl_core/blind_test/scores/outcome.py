"""What was claimed about one sealed world, beside what was true."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from samrl_core.diagnosis.result import GAPS

CRASHED = "crashed"  # stands in the place of a verdict when there is no report
TILE_CHANGE = "tile_change_"  # begins the names of an oracle's arrays (T,), before the channel's


@dataclass(frozen=True)
class SealedTruth:
    """A sealed label, read-only."""

    id: str
    set: str  # single, none, outside, double
    engine: str
    arm: str
    effects: tuple[Mapping[str, Any], ...]
    background_scale: float

    @classmethod
    def from_label(cls, label: Mapping[str, Any]) -> SealedTruth:
        """From sealed/<id>.json."""
        return cls(
            id=label["id"],
            set=label["set"],
            engine=label["engine"],
            arm=label["arm"],
            effects=tuple(label["effects"]),
            background_scale=float(label["background"]["scale"]),
        )

    @property
    def families(self) -> tuple[str, ...]:
        """Of the true effects."""
        return tuple(e["family"] for e in self.effects)

    @property
    def names(self) -> tuple[str, ...]:
        """`family@place` of the true effects."""
        return tuple(f"{e['family']}@{e['place']}" for e in self.effects)

    @property
    def severity(self) -> float:
        """Quantile of the catalogue's range, of the first effect; 0 without one."""
        return float(self.effects[0]["severity"]) if self.effects else 0.0

    @property
    def form(self) -> str:
        """T0 (same functional form), T1 (another), T2 (outside); empty without an effect."""
        return str(self.effects[0]["form"]) if self.effects else ""

    @property
    def series(self) -> str:
        """Which set of disturbances made the effects; empty without one."""
        names = {1: "first set", 2: "second set", 3: "servo worlds", 4: "camera worlds"}
        return names[int(self.effects[0].get("series", 1))] if self.effects else ""


@dataclass(frozen=True)
class Shrinks:
    """Held-out gaps of one world by `gap_metric`, of the nominal arm, the named and the true effect."""

    nominal: float
    with_effect: float
    oracle: float | None
    shrink: float
    oracle_shrink: float | None


@dataclass(frozen=True)
class Outcome:
    """One world with its diagnosis. `report` is None where the diagnosis crashed or was refused."""

    truth: SealedTruth
    report: Mapping[str, Any] | None
    seconds: float | None = None
    shrinks: Shrinks | None = None
    withheld: bool = False  # the true family was withheld from the diagnosis: the world is an unknown one
    detail: Mapping[str, Any] = field(default_factory=dict)
    tiles: Mapping[str, np.ndarray] = field(default_factory=dict)  # channel -> true change (T,) of each tile

    @property
    def verdict(self) -> str:
        """The stated verdict, or `crashed`."""
        return str(self.report["verdict"]) if self.report is not None else CRASHED

    @property
    def named(self) -> tuple[Mapping[str, Any], ...]:
        """Effects claimed: those of an `effect` verdict, primary first; empty with any other verdict."""
        if self.report is None or self.verdict != "effect":
            return ()
        effects = [e for e in self.report.get("effects", ()) if e.get("role") != "runner_up"]
        return tuple(sorted(effects, key=lambda e: e.get("role") == "secondary"))

    @property
    def primary(self) -> Mapping[str, Any] | None:
        """The effect named first."""
        return self.named[0] if self.named else None

    @property
    def candidates(self) -> tuple[str, ...]:
        """`family@place` in order of belief, with an `effect` or `ambiguous` verdict."""
        if self.report is None or self.verdict not in ("effect", "ambiguous"):
            return ()
        listed = [*self.report.get("effects", ()), *self.report.get("runner_ups", ())]
        ranked = sorted(
            listed, key=lambda e: (e.get("role") == "runner_up", -float(e.get("probability") or 0.0))
        )
        names = [f"{e['family']}@{e['place']}" for e in ranked]
        for group in self.report.get("ambiguity_set", ()):
            names += [name for name in group if name not in names]
        return tuple(dict.fromkeys(names))

    @property
    def alarmed(self) -> bool:
        """Whether a gap was claimed; a crash counts as such, so that it is wrong on a world without one."""
        return self.verdict in GAPS or self.verdict == CRASHED

    @property
    def detected(self) -> bool:
        """Whether a gap was claimed; a crash has detected nothing."""
        return self.verdict in GAPS

    @property
    def family_right(self) -> bool:
        """Top-1 family; of a double world, one of the two."""
        known = self.truth.set in ("single", "double") and not self.withheld
        return known and self.primary is not None and self.primary["family"] in self.truth.families

    @property
    def name_right(self) -> bool:
        """Top-1 family and place."""
        return self.family_right and self.primary is not None and _name(self.primary) in self.truth.names

    @property
    def place_right(self) -> bool:
        """The named effect's place, or where nothing was named, the strongest place of `where`."""
        places = {e["place"] for e in self.truth.effects}
        if self.primary is not None:
            return self.primary["place"] in places
        where = self.report.get("where", ()) if self.report is not None else ()
        return bool(where) and where[0]["place"] in places

    def among_first(self, count: int) -> bool:
        """Whether the true family is one of the first `count` families believed in."""
        families = list(dict.fromkeys(name.split("@")[0] for name in self.candidates))
        return any(f in self.truth.families for f in families[:count])

    @property
    def unknown_score(self) -> float:
        """How strongly the world was called unknown: none_of_mine adds 1 to the unexplained fraction.

        A crash is wrong either way: lowest on an unknown world, highest on a known one.
        """
        if self.report is None:
            return -1.0 if self.truth.set == "outside" or self.withheld else 3.0
        if self.verdict in ("no_gap", "not_testable"):
            return 0.0
        return float(self.report.get("unexplained_fraction") or 0.0) + (self.verdict == "none_of_mine")


def _name(effect: Mapping[str, Any]) -> str:
    return f"{effect['family']}@{effect['place']}"
