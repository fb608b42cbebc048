"""An arm whose description states no limits: shares of an effort or a speed are shares of the same one."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.nominal import tolerance_columns
from tests.diagnosis import worlds

UNLIMITED = re.sub(r'(effort|velocity)="[\d.]+"', r'\1="0"', worlds.URDF)


def recordings() -> list[ArmRecording]:
    """A slow one and a lively one."""
    return [
        replace(r, arm=replace(r.arm, urdf=UNLIMITED)) for r in worlds.record(worlds.plant(), "AB", None, 4.0)
    ]


@pytest.mark.parametrize("step", [1, -1])
def test_a_tolerance_is_one_size_in_all_recordings_in_any_order(step: int) -> None:
    trials, _ = arm_trials(recordings()[::step], [])
    assert trials[0].motion.u is not None and trials[1].motion.u is not None
    seen = [float(np.abs(t.motion.u[:, worlds.TURN]).max()) for t in trials if t.motion.u is not None]
    assert max(seen) > 1.3 * min(seen)
    sizes = [[std for _, std in tolerance_columns(trial)] for trial in trials]
    assert sizes[0] == pytest.approx(sizes[1])
    assert trials[0].scale[worlds.TURN] == pytest.approx(max(seen))
