"""An ordinary machine has one large effect and several small ones: the large one is named all the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.nominal import tolerance_columns
from tests.diagnosis import worlds
from tests.diagnosis.worlds import BEND, LIFT, TURN

# What any machine has, beyond the tolerances: ripple of the gears, friction that depends on the direction.
SMALL = {
    "harmonic_amplitude": {TURN: 0.5, LIFT: 0.5, BEND: 0.25},
    "harmonic_order": {TURN: 23.0, LIFT: 31.0, BEND: 37.0},
    "friction_asymmetry": {TURN: 0.2, LIFT: -0.2, BEND: 0.1},
}


def machine(**fields: object) -> list[ArmRecording]:
    """A and C without torque sensors, encoders of 16 bits."""
    step = 2 * np.pi / 2**16
    made = []
    for r in worlds.world(5, "AC", **SMALL, **fields):
        assert r.states.position is not None
        states = replace(r.states, effort=None, position=np.round(r.states.position / step) * step)
        made.append(replace(r, states=states))
    return made


def without_law(made: list[ArmRecording]) -> list[ArmRecording]:
    """The same of a machine whose controller nobody has described; its URDF states the rotors."""
    urdf = worlds.URDF
    for name, inertia in zip(worlds.JOINTS, worlds.ARMATURE, strict=True):
        head, tail = urdf.split(f'<joint name="{name}"', 1)
        urdf = (
            head
            + f'<joint name="{name}"'
            + tail.replace(
                "</joint>", f'<dynamics damping="0" friction="0" armature="{inertia}"/></joint>', 1
            )
        )
    return [replace(r, arm=replace(r.arm, controller=None, urdf=urdf), command=None) for r in made]


@pytest.mark.parametrize("law", [pytest.param(True, marks=pytest.mark.slow), False], ids=["law", "no law"])
def test_the_dominant_effect_is_named(law: bool) -> None:
    made = machine(coulomb={LIFT: 4.0})
    made = made if law else without_law(made)
    found, far = diagnose(made[:1], made[1:], DiagnosisSettings(share_held_out=False))
    assert found.verdict == "effect", found.reasons
    assert "coulomb_friction@joint:lift" in {e.name for e in found.effects}
    assert not {e.family for e in found.effects} & {"torque_saturation", "torque_rate_limit"}
    assert found.gap is not None and found.gap.shrink is not None and found.gap.shrink > 0.3
    assert found.gap.metric.startswith("closed-loop" if law else "simulation forward")
    assert far.motion is not None and far.motion > 0.3


def test_a_half_width_is_no_standard_deviation() -> None:
    (recording,) = worlds.world(1, "A")

    def widths(stated_as: str) -> list[float]:
        tolerances = Tolerances(stated_as=stated_as)
        stated = replace(recording, arm=replace(recording.arm, tolerances=tolerances))
        return [std for _, std in tolerance_columns(arm_trials([stated], [])[0][0])]

    half, deviation = np.array(widths("half_width")), np.array(widths("standard_deviation"))
    ratio = half / deviation
    assert float(np.min(ratio)) == pytest.approx(1 / np.sqrt(3.0))
    assert set(np.round(ratio, 6)) <= {round(1 / np.sqrt(3.0), 6), 1.0}  # the latter: nobody states them
    with pytest.raises(InputError, match="half_width"):
        Tolerances(stated_as="variance")
