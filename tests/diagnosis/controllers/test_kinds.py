"""Every kind of controller: its text, its figures, and the bag and mapping that carry it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.cell.types.controllers import KINDS, controller_from
from samrl_core.common.errors import InputError
from samrl_ros.log_import.importer import import_recording
from samrl_ros.log_import.mapping import read_mapping
from samrl_ros.log_import.units import drive_factor
from samrl_ros.recordings.nominal_texts import controller_text, parse_controller
from samrl_ros.recordings.read import read_recordings
from samrl_ros.recordings.write import write_recording
from tests.diagnosis.controllers.kinds import MACHINES, VOLTAGE_SERVO
from tests.diagnosis.controllers.machines import JOINT

EACH = pytest.mark.parametrize("kind", MACHINES)
LAW_NUMBERS = ("integral", "dead_band", "punch", "back_emf", "pole_pitch", "torque_per_volt")


@EACH
def test_a_text_comes_back_as_it_was(kind: str) -> None:
    arm = MACHINES[kind].described()
    assert arm.controller is not None
    back = parse_controller(controller_text(arm), "there").controller
    assert back is not None and back.kind == kind
    for name in ("stiffness", "damping", "armature"):
        np.testing.assert_allclose(getattr(back, name), getattr(arm.controller, name))
    for name in LAW_NUMBERS:
        np.testing.assert_allclose(back.law.of_joints(name, 1), arm.controller.law.of_joints(name, 1))


def test_a_servo_has_the_torque_and_speed_of_its_data_sheet() -> None:
    """MX-28 at 12 V: 2.5 N m at standstill, 55 rev/min without load."""
    controller = VOLTAGE_SERVO.described().controller
    assert controller is not None and controller.effort_limit is not None
    assert controller.effort_limit[0] == pytest.approx(2.5, rel=0.01)
    free = controller.effort_limit[0] / controller.law.of_joints("back_emf", 1)[0]
    assert free == pytest.approx(55 * 2 * np.pi / 60, rel=0.01)


def test_a_stepper_holds_with_its_torque_a_full_step_off() -> None:
    controller = MACHINES["stepper"].described().controller
    assert controller is not None
    pitch = controller.law.of_joints("pole_pitch", 1)[0]
    full_step = 2 * np.pi / 200 / 5
    assert controller.stiffness[0] / pitch * np.sin(pitch * full_step) == pytest.approx(0.4 * 5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"type": "magic"}, "type is 'magic'; known are joint_impedance"),
        ({"resistance": [0.0]}, "resistance is .* must be above zero"),
        ({"off": "somehow"}, "off is 'somehow', must be one of free, braked"),
        ({"proportional": [1.0, 2.0]}, "proportional is .* must be 1 finite number up to"),
        ({"proportional": 12}, r"proportional is 12, must be a list of 1 finite number; write \[12\]"),
    ],
)
def test_texts_that_fit_no_kind_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        controller_from({**VOLTAGE_SERVO.about, "joints": [JOINT], **change})


@pytest.mark.parametrize("kind", ["voltage_motor", "current_motor"])
def test_a_joint_may_have_no_motor(kind: str) -> None:
    """A rotary pendulum's arm is driven, its pendulum is not; their owner has one motor's sheet."""
    about = {"type": kind, "joints": ["arm", "pendulum"], "torque_constant": [0.042, 0.0]}
    more = {"resistance": [8.4, 0.0], "voltage_limit": [10.0, 0.0]}
    own = more if kind == "voltage_motor" else {"current_limit": [1.2, 0.0]}
    controller = controller_from({**about, **own})
    assert controller is not None and controller.effort_limit is not None
    assert controller.effort_limit[0] == pytest.approx(0.05, rel=0.01)
    assert controller.effort_limit[1] == np.inf
    assert controller.law.of_joints("back_emf", 2)[1] == 0.0
    unit = "V" if kind == "voltage_motor" else "A"
    assert drive_factor(unit, controller.law, 2, "log")[1] == 0.0
    with pytest.raises(InputError, match=r"torque_constant is \[0.0, 0.0\], must be above zero"):
        controller_from({**about, **own, "torque_constant": [0.0, 0.0]})


def test_a_missing_key_is_named() -> None:
    with pytest.raises(InputError, match="lacks proportional, voltage_limit"):
        controller_from(
            {"type": "voltage_servo", "joints": [JOINT], "torque_constant": [1.0], "resistance": [1.0]}
        )


@EACH
def test_a_kind_is_documented(kind: str) -> None:
    page = (Path(__file__).parents[3] / "msgs_docs" / "reference" / "controllers.md").read_text()
    assert f"## `{kind}`" in page and KINDS[kind].formula.replace("|", "\\|") in page


def test_a_bag_keeps_when_torque_was_off(tmp_path: Path) -> None:
    time = np.arange(300) / 100.0
    path = np.sin(time)[:, None]
    flags = JointSignal(np.array([0.0, 1.0, 2.0]), effort=np.array([[1.0], [0.0], [1.0]]))
    recording = ArmRecording(
        "run", "", "", VOLTAGE_SERVO.described(), JointSignal(time, path), JointSignal(time, path), None,
        torque_enabled=flags,
    )  # fmt: skip
    (back,) = read_recordings(write_recording(recording, tmp_path / "run.mcap"))
    assert back.torque_enabled is not None and back.torque_enabled.effort is not None
    np.testing.assert_allclose(back.torque_enabled.time, flags.time, atol=1e-9)
    np.testing.assert_array_equal(back.torque_enabled.effort, flags.effort)
    assert back.arm.controller is not None and back.arm.controller.kind == "voltage_servo"


def mapping_of(tmp_path: Path, unit: str, **controller: object) -> Path:
    """A mapping of a log with a signal in some unit, and a flag."""
    time = np.arange(400) / 100.0
    rows = np.column_stack([time, np.sin(time), np.sin(time), 0.5 * np.cos(time), time > 2.0])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header="t,q,goal,signal,on", comments="")
    about = {
        "joints": [JOINT],
        "urdf": VOLTAGE_SERVO.urdf,
        "controller": {**VOLTAGE_SERVO.about, **controller},
        "sources": {
            "log": {
                "file": "log.csv",
                "time": {"column": "t"},
                "columns": {name: name for name in ("q", "goal", "signal", "on")},
            }
        },
        "channels": {
            "states": {"position": ["q"]},
            "command": {"position": ["goal"]},
            "commanded_effort": {"effort": {"formula": ["signal"], "unit": unit}},
            "torque_enabled": {"enabled": ["on"]},
        },
        "recordings": [{"name": "run"}],
    }
    file = tmp_path / "mapping.yaml"
    file.write_text(json.dumps(about))
    return file


@pytest.mark.parametrize(
    ("unit", "source", "factor"),
    [("V", "voltage", 2.5 / 12), ("duty", "voltage", 2.5), ("A", "current", 0.00925 * 193)],
)
def test_a_mapping_takes_the_drives_own_units(tmp_path: Path, unit: str, source: str, factor: float) -> None:
    mapping = read_mapping(mapping_of(tmp_path, unit, effort_from=source))
    found = import_recording(mapping.recordings[0], mapping, tmp_path).recording
    assert found.commanded_effort is not None and found.commanded_effort.effort is not None
    assert np.max(np.abs(found.commanded_effort.effort)) == pytest.approx(0.5 * factor, rel=0.01)
    assert found.torque_enabled is not None and found.torque_enabled.effort is not None
    assert found.torque_enabled.effort[0, 0] == 0 and found.torque_enabled.effort[-1, 0] == 1


def test_a_current_is_not_taken_for_a_voltage(tmp_path: Path) -> None:
    mapping = read_mapping(mapping_of(tmp_path, "A"))
    with pytest.raises(InputError, match="unit A contradicts .* effort_from: current"):
        import_recording(mapping.recordings[0], mapping, tmp_path)
