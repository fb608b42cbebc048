"""Hidden differences of machines with every kind of drive, simulated apart, are named with their size."""

from __future__ import annotations

from dataclasses import replace

import pytest

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.result import Diagnosis
from tests.diagnosis.controllers.kinds import MACHINES
from tests.diagnosis.controllers.machines import Differs, worlds

# kind and field -> family, its parameter, the sizes in SI units
NAMED: dict[tuple[str, str], tuple[str, str, tuple[float, ...]]] = {
    ("position_servo", "viscous"): ("viscous_friction", "Fv", (0.05, 0.1, 0.2)),
    ("position_servo", "coulomb"): ("coulomb_friction", "Fc", (0.075, 0.15, 0.3)),
    ("position_servo", "dead_band"): ("dead_band", "width", (0.005, 0.01, 0.02)),
    ("position_servo", "delay"): ("command_delay", "T", (0.01, 0.02, 0.04)),
    ("position_servo", "proportional"): ("controller_gain", "eK", (-0.4, -0.2, 0.3)),
    ("voltage_servo", "dead_band"): ("dead_band", "width", (0.005, 0.01, 0.02)),
    ("voltage_servo", "proportional"): ("controller_gain", "eK", (-0.4, -0.2, 0.3)),
    ("voltage_servo", "supply"): ("actuator_gain", "e", (-0.25, -0.15, 0.15)),
    ("velocity_drive", "viscous"): ("viscous_friction", "Fv", (0.067, 0.13, 0.27)),
    ("velocity_drive", "coulomb"): ("coulomb_friction", "Fc", (0.1, 0.2, 0.4)),
    ("voltage_motor", "viscous"): ("viscous_friction", "Fv", (0.04, 0.08, 0.16)),
    ("current_motor", "viscous"): ("viscous_friction", "Fv", (0.02, 0.04, 0.08)),
    ("current_motor", "coulomb"): ("coulomb_friction", "Fc", (0.06, 0.12, 0.24)),
    ("stepper", "coulomb"): ("coulomb_friction", "Fc", (0.025, 0.05, 0.1)),
}
EXACT = 0.05  # of a parameter, that an interval may miss: two integrators are not one
TIED = {"stepper"}  # near twins of friction: torque follows from a stiff field and a clock


def diagnosed(recordings: list[ArmRecording]) -> Diagnosis:
    """The last recording held out."""
    return diagnose(recordings[:-1], recordings[-1:], DiagnosisSettings())[0]


@pytest.mark.slow
@pytest.mark.parametrize("kind", MACHINES)
def test_differences_are_named_with_their_size(kind: str) -> None:
    cases = [
        (field, value, *about[:2]) for (k, field), about in NAMED.items() if k == kind for value in about[2]
    ]
    made = worlds(
        MACHINES[kind], [Differs(), *(Differs(**{field: value}) for field, value, _, _ in cases)], 1
    )
    assert diagnosed(made[0]).verdict == "no_gap"
    for recordings, (field, value, family, parameter) in zip(made[1:], cases, strict=True):
        found = diagnosed(recordings)
        told = f"{field} {value}: {found.verdict}, {[e.name for e in found.effects]}, {found.reasons}"
        if kind in TIED and found.verdict == "ambiguous":
            tied = [name.partition("@")[0] for group in found.ambiguity_set for name in group]
            assert family in tied, told
            continue
        assert found.verdict == "effect" and found.effects[0].family == family, told
        low, high = found.effects[0].parameters[parameter].ci95
        assert low - EXACT * abs(value) <= value <= high + EXACT * abs(value), f"{told}: {low} to {high}"
        assert found.gap is not None and found.gap.shrink is not None and found.gap.shrink > 0.3, told


@pytest.mark.slow
def test_a_higher_supply_is_no_payload() -> None:
    """Ten numbers of a payload meet the torque of one mechanism a little better; the motion denies them."""
    (supplied,) = worlds(MACHINES["voltage_servo"], [Differs(supply=0.15)], 1)
    found = diagnosed(supplied)
    assert [e.family for e in found.effects] == ["actuator_gain"], found.reasons
    assert "more of the torque; simulated motion" in " ".join(found.reasons)


@pytest.mark.slow
def test_a_servo_without_a_recorded_torque() -> None:
    """The law stands for it: nothing where nothing is, and a dead band where one is."""
    nominal, banded = worlds(MACHINES["position_servo"], [Differs(), Differs(dead_band=0.01)], 2, 6.0)
    assert diagnosed(nominal).verdict == "no_gap"
    found = diagnosed(banded)
    assert [e.family for e in found.effects] == ["dead_band"]
    assert found.effects[0].parameters["width"].value == pytest.approx(0.01, rel=0.1)


@pytest.mark.slow
def test_a_machine_that_is_switched_off_moves_freely() -> None:
    """Told when, nothing is missing; not told, the torque is."""
    machine = replace(MACHINES["position_servo"], off=(2.0, 3.0))
    (told,) = worlds(machine, [Differs()], 3, 8.0)
    found = diagnosed(told)
    assert found.verdict == "no_gap"
    assert found.gap is not None and found.gap.nominal < 2.0  # the fall is simulated, too
    silent = [replace(recording, torque_enabled=None) for recording in told]
    assert diagnosed(silent).verdict != "no_gap"
