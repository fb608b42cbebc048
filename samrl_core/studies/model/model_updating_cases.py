"""Results of `model_updating` for each fit, and the metrics of many."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from samrl_core.common.errors import InputError


@dataclass(frozen=True)
class UpdateCase:
    """One fit from far and one as in the loop."""

    study: str
    seed: int
    # Mean L1 distance of the links' centres, or that of the pancake's, at the start and after each iteration.
    distance: list[float]  # [m]
    straight: float  # the same in a straight line at the end [m]
    angle: list[float]  # between the pancake's axes, as the distance; empty for a thread [deg]
    deviations: float  # error at the end, root mean square in standard deviations of the estimate
    iterations: int
    why_stopped: str
    wall_s: float
    cpu_s: float
    loop_distance: float  # after an update as in the loop, L1 [m]
    loop_angle: float  # [deg], 0 for a thread
    loop_iterations: int
    loop_wall_s: float
    loop_cpu_s: float


def summary(cases: list[UpdateCase]) -> dict[str, float | int]:
    """Figures of one study; medians unless named otherwise, distances in mm."""
    end = 1e3 * np.array([c.distance[-1] for c in cases])
    straight = 1e3 * np.array([c.straight for c in cases])
    loop = 1e3 * np.array([c.loop_distance for c in cases])
    result: dict[str, float | int] = {
        "cases": len(cases),
        "start_l1_mm": float(np.median([1e3 * c.distance[0] for c in cases])),
        "end_l1_mm": float(np.median(end)),
        "end_l1_mm_90": float(np.quantile(end, 0.9)),
        "end_l1_mm_max": float(end.max()),
        "end_straight_mm": float(np.median(straight)),
        "end_straight_mm_max": float(straight.max()),
        "deviations": float(np.median([c.deviations for c in cases])),
        "iterations": float(np.median([c.iterations for c in cases])),
        "converged": sum(c.why_stopped == "converged" for c in cases),
        "wall_s": float(np.median([c.wall_s for c in cases])),
        "cpu_s": float(np.median([c.cpu_s for c in cases])),
        "loop_l1_mm": float(np.median(loop)),
        "loop_l1_mm_90": float(np.quantile(loop, 0.9)),
        "loop_wall_s": float(np.median([c.loop_wall_s for c in cases])),
        "loop_cpu_s": float(np.median([c.loop_cpu_s for c in cases])),
    }
    if cases[0].angle:
        result["start_deg"] = float(np.median([c.angle[0] for c in cases]))
        result["end_deg"] = float(np.median([c.angle[-1] for c in cases]))
        result["end_deg_max"] = max(c.angle[-1] for c in cases)
        result["loop_deg"] = float(np.median([c.loop_angle for c in cases]))
    return result


def read_cases(path: Path) -> list[UpdateCase]:
    """The cases that are done.

    Raises:
        InputError: a line is none of this study's; the last one may be cut off and is left out.
    """
    if not path.is_file():
        return []
    cases, lines = [], path.read_text().split("\n")
    for number, line in enumerate(lines):
        try:
            cases.append(UpdateCase(**json.loads(line)))
        except (ValueError, TypeError) as problem:
            if number < len(lines) - 1:
                raise InputError(f"{path}, line {number + 1}: {problem}; use another --out") from problem
    return cases


def line_of(case: UpdateCase) -> str:
    """One case in words."""
    angle = f", {case.angle[0]:.1f} -> {case.angle[-1]:.2f} deg" if case.angle else ""
    return (
        f"{1e3 * case.distance[0]:.1f} -> {1e3 * case.distance[-1]:.2f} mm{angle} in {case.iterations} "
        f"({case.why_stopped}, {case.cpu_s:.2f} s CPU); loop {1e3 * case.loop_distance:.2f} mm, "
        f"{case.loop_cpu_s:.2f} s CPU"
    )
