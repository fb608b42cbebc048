"""What nobody stated of a support and the tracks give: coefficients of friction and restitution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.body_recording import BodyRecording
from samrl_core.diagnosis.residuals.bodies.find_segments import Found
from samrl_core.diagnosis.residuals.bodies.segment import polynomials


@dataclass(frozen=True)
class BodyConstants:
    """Coefficients of the nominal model; `free` names those that were solved for."""

    friction: float
    restitution: float
    free: frozenset[str]


def solved(recordings: Sequence[BodyRecording], found: Sequence[Found]) -> tuple[BodyConstants, list[str]]:
    """The stated coefficients, or those that fit the recordings best, with notes about the latter."""
    support, notes, free = recordings[0].support, [], set()
    friction = 0.0 if support is None else support.friction
    restitution = 0.0 if support is None else support.restitution
    if friction is None:
        friction, free = _friction(found), free | {"friction"}
        if any(s.slides for f in found for s in f.segments):
            notes.append(f"friction of the support is not stated; solved for: {friction:.4g}")
    if restitution is None:
        impacts = [i for f in found for i in f.impacts]
        restitution = float(np.median([-i.after / i.before for i in impacts])) if impacts else 0.0
        free = free | {"restitution"}
        if impacts:
            notes.append(f"restitution of the support is not stated; solved for: {restitution:.4g}")
    return BodyConstants(float(friction), restitution, frozenset(free)), notes


def _friction(found: Sequence[Found]) -> float:
    """Least squares over all slides, each with a start of its own."""
    product, power = 0.0, 0.0
    for segment in (s for f in found for s in f.segments if s.slides):
        start = np.linalg.qr(polynomials(segment.time, (0, 1)).T)[0]

        def inside(path: np.ndarray, start: np.ndarray = start) -> np.ndarray:
            return path - start @ (start.T @ path)

        measured = inside(segment.position - segment.travelled(segment.nominal(0.0)))
        braked = inside(segment.travelled(segment.nominal(1.0) - segment.nominal(0.0)))
        product += float(np.sum(measured * braked))
        power += float(np.sum(braked**2))
    return max(0.0, product / power) if power > 0 else 0.0
