"""Reports of many robots and days as one table: verdicts, and every named parameter over time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from samrl_core.diagnosis.history.change_points import ChangePoint, change_points

SCHEMA = 1
CI95_TO_STD = 1.0 / 3.92


@dataclass(frozen=True, eq=False)
class Day:
    """One diagnosed set of recordings."""

    robot: str
    name: str
    time_s: float | None  # when it was recorded, since 1970; None: not known
    report: dict[str, Any] | None  # report.json; None: it was refused
    refusal: str = ""
    folder: str = ""  # of the report, relative to the history

    @property
    def verdict(self) -> str:
        """The report's, or `refused`."""
        return "refused" if self.report is None else str(self.report["verdict"])

    @property
    def named(self) -> tuple[str, ...]:
        """`family@place` of what the report names as a cause."""
        if self.report is None or self.verdict not in ("effect", "ambiguous"):
            return ()
        return tuple(f"{e['family']}@{e['place']}" for e in self.report["effects"])

    def parameters(self, effect: str) -> dict[str, dict[str, Any]]:
        """Parameters of an effect, whether it was named or only tracked; empty where it was neither."""
        if self.report is None:
            return {}
        listed = [*self.report["effects"], *self.report.get("tracked", [])]
        found = (e["parameters"] for e in listed if f"{e['family']}@{e['place']}" == effect)
        return next(found, {})


@dataclass(frozen=True)
class Point:
    """A parameter on one day."""

    day: str
    order: int  # among all days of its robot
    time_s: float | None
    value: float
    ci95: tuple[float, float]
    named: bool  # as a cause; else it is so large only if it is there at all


@dataclass(frozen=True, eq=False)
class Series:
    """A parameter of an effect of one robot over its days."""

    robot: str
    effect: str  # family@place
    parameter: str
    unit: str
    points: tuple[Point, ...]
    steps: tuple[ChangePoint, ...]
    scatter: float  # from day to day beyond the intervals

    def between(self, step: ChangePoint) -> tuple[Point, Point]:
        """The days before and after a step."""
        return self.points[step.index - 1], self.points[step.index]


@dataclass(frozen=True, eq=False)
class History:
    """All of it, robots and days in order."""

    days: tuple[Day, ...]
    series: tuple[Series, ...]

    @property
    def robots(self) -> tuple[str, ...]:
        """Their names, in order."""
        return tuple(dict.fromkeys(day.robot for day in self.days))

    def of(self, robot: str) -> tuple[Day, ...]:
        """The days of a robot in order."""
        return tuple(day for day in self.days if day.robot == robot)

    def as_dict(self) -> dict[str, Any]:
        """Content of history.json."""
        return {"schema": SCHEMA, "robots": {name: self._robot(name) for name in self.robots}}

    def _robot(self, robot: str) -> dict[str, Any]:
        days = [
            {
                "day": d.name,
                "time_s": d.time_s,
                "verdict": d.verdict,
                "effects": list(d.named),
                "shrink": None if d.report is None else d.report["gap"]["held_out"]["shrink"],
                "report": d.folder,
                "refusal": d.refusal or None,
            }
            for d in self.of(robot)
        ]
        series = [
            {
                "effect": s.effect,
                "parameter": s.parameter,
                "unit": s.unit,
                "points": [
                    {"day": p.day, "value": p.value, "ci95": list(p.ci95), "named": p.named} for p in s.points
                ],
                "scatter": s.scatter,
                "changes": [
                    {
                        "after_day": s.between(c)[0].day,
                        "on_day": s.between(c)[1].day,
                        "before": c.before,
                        "after": c.after,
                        "std": c.std,
                        "p_value": c.p_value,
                    }
                    for c in s.steps
                ],
            }
            for s in self.series
            if s.robot == robot
        ]
        return {"days": days, "parameters": series}


def in_order(days: Iterable[Day]) -> tuple[Day, ...]:
    """By robot, then by time where every diagnosed day of the robot has one, else as they come."""
    robots: dict[str, list[Day]] = {}
    for day in days:
        robots.setdefault(day.robot, []).append(day)
    for listed in robots.values():
        if all(day.time_s is not None for day in listed if day.report is not None):
            listed.sort(key=lambda day: math.inf if day.time_s is None else day.time_s)
    return tuple(day for listed in robots.values() for day in listed)


def wanted(days: Sequence[Day]) -> dict[str, tuple[str, ...]]:
    """Of each robot, the effects that were named on any day."""
    named: dict[str, dict[str, None]] = {}
    for day in days:
        named.setdefault(day.robot, {}).update(dict.fromkeys(day.named))
    return {robot: tuple(effects) for robot, effects in named.items()}


def history(days: Sequence[Day]) -> History:
    """The whole table of days in order (`in_order`)."""
    found = []
    for robot, effects in wanted(days).items():
        own = [day for day in days if day.robot == robot]
        for effect in effects:
            names = dict.fromkeys(name for day in own for name in day.parameters(effect))
            found += [_series(robot, own, effect, name) for name in names]
    return History(tuple(days), tuple(s for s in found if s.points))


def _series(robot: str, days: Sequence[Day], effect: str, parameter: str) -> Series:
    points, unit = [], ""
    for order, day in enumerate(days):
        estimate = day.parameters(effect).get(parameter)
        if estimate is None or estimate["value"] is None or None in (estimate["ci95"] or (None,)):
            continue
        unit = estimate["unit"]
        low, high = estimate["ci95"]
        named = effect in day.named
        points.append(Point(day.name, order, day.time_s, float(estimate["value"]), (low, high), named))
    values = np.array([p.value for p in points])
    std = np.array([(p.ci95[1] - p.ci95[0]) * CI95_TO_STD for p in points])
    steps, scatter = change_points(values, std)
    return Series(robot, effect, parameter, unit, tuple(points), steps, scatter)
