"""Recording programmes: motions that make a robot show what its model leaves out."""

from __future__ import annotations

from samrl_core.excitation.programme import SETS, GainScale, gains, programme

__all__ = ["SETS", "GainScale", "gains", "programme"]
