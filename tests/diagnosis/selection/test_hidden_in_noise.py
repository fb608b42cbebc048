"""A gap that stands out nowhere is none, however much evidence its best effect adds up over the samples."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis import diagnose as diagnosis_module
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.effects.load.mount_compliance import EFFECT
from samrl_core.diagnosis.findings.where import heatmap
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis import worlds
from tests.diagnosis.worlds import LIFT

FRICTION = DiagnosisSettings(library={"coulomb_friction", "viscous_friction"})


def world() -> list[ArmRecording]:
    return worlds.world(1, coulomb={LIFT: 0.8})


@pytest.mark.slow
def test_what_stands_out_is_named_and_what_does_not_is_no_gap(monkeypatch: pytest.MonkeyPatch) -> None:
    a, b, c = world()
    shown, _ = diagnose([a, b], [c], FRICTION)
    assert shown.verdict == "effect" and shown.where

    def nowhere(*arguments: object) -> object:
        grid, _ = heatmap(*arguments)
        return replace(grid, values=np.minimum(grid.values, 0.5)), ()

    monkeypatch.setattr(diagnosis_module, "heatmap", nowhere)
    hidden, _ = diagnose([a, b], [c], FRICTION)
    assert hidden.verdict == "no_gap" and not hidden.effects and not hidden.where and hidden.nearest is None
    assert "below the noise" in hidden.reasons[1] and shown.effects[0].name in hidden.reasons[1]
    # What was not believed at that size is not said to be seen at a smaller one.
    monkeypatch.undo()
    sound, _ = diagnose(worlds.world(1)[:2], worlds.world(1)[2:], FRICTION)
    least = [
        {s.effect: s.stated[1] for s in d.least_sizes}["coulomb_friction@joint:lift"] for d in (hidden, sound)
    ]
    assert sound.verdict == "no_gap" and least[0] > 1.5 * least[1]


def test_a_stand_needs_joints_enough_to_be_told_from_them() -> None:
    (recording, *_) = world()
    assert EFFECT.why_unobservable(Trial(recording, RigidArm(recording.arm))) is None
    few: Any = SimpleNamespace(recording=SimpleNamespace(arm=SimpleNamespace(joints=("pan", "tilt"))))
    assert "fewer than three joints" in str(EFFECT.why_unobservable(few))
