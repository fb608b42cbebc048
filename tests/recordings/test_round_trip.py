from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription, Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.common.errors import InputError
from samrl_ros.recordings import load_recordings, read_recordings, write_recording

CHANNELS = ("states", "command", "commanded_effort")
QUANTITIES = ("position", "velocity", "acceleration", "effort")


def assert_same(a: ArmRecording, b: ArmRecording) -> None:
    assert a.arm.role == b.arm.role and a.arm.joints == b.arm.joints and a.arm.urdf == b.arm.urdf
    assert a.arm.tolerances == b.arm.tolerances
    for channel in CHANNELS:
        x, y = getattr(a, channel), getattr(b, channel)
        assert (x is None) == (y is None)
        if x is not None:
            np.testing.assert_allclose(x.time, y.time, rtol=0, atol=1e-9)
            for quantity in QUANTITIES:
                np.testing.assert_array_equal(getattr(x, quantity), getattr(y, quantity))


@pytest.mark.parametrize("name", ["one.mcap", "folder"])
@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_what_is_written_is_read(motion: ArmRecording, tmp_path: Path, name: str, compression: str) -> None:
    path = write_recording(motion, tmp_path / name, compression=compression)
    loaded = load_recordings(path)
    (back,) = loaded.recordings
    assert_same(motion, back)
    assert [mark for _, mark in back.phases] == ["reach", "hold"]
    np.testing.assert_allclose([t for t, _ in back.phases], [0.5, 1.25], atol=1e-9)
    assert back.arm.controller is not None and motion.arm.controller is not None
    np.testing.assert_array_equal(back.arm.controller.stiffness, motion.arm.controller.stiffness)
    np.testing.assert_array_equal(back.arm.controller.armature, motion.arm.controller.armature)
    assert back.arm.tool is not None and back.arm.tool.mass == 0.78
    assert loaded.notes == {"tool_arm": ()}
    assert len(back.sha256) == 64


def test_two_arms_in_one_bag(motion: ArmRecording, tmp_path: Path) -> None:
    other = replace(motion, arm=replace(motion.arm, role="camera_arm"), commanded_effort=None)
    path = write_recording([motion, other], tmp_path / "both.mcap")
    found = {r.arm.role: r for r in read_recordings(path)}
    assert_same(found["tool_arm"], motion)
    assert_same(found["camera_arm"], other)


def test_two_of_one_role_are_refused(motion: ArmRecording, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="one recording per role"):
        write_recording([motion, motion], tmp_path / "both.mcap")


def test_an_existing_path_is_kept(motion: ArmRecording, tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_text("precious")
    with pytest.raises(InputError, match="exists already"):
        write_recording(motion, tmp_path / "a.mcap")
    assert (tmp_path / "a.mcap").read_text() == "precious"


def test_a_log_without_controller_keeps_its_tolerances(motion: ArmRecording, tmp_path: Path) -> None:
    arm = ArmDescription("tool_arm", motion.arm.joints, None, None, None, Tolerances(mass=0.1))
    bare = replace(motion, arm=arm, command=None, commanded_effort=None, phases=())
    (back,) = read_recordings(write_recording(bare, tmp_path / "bare.mcap"))
    assert_same(bare, back)
    assert back.arm.controller is None


def test_given_urdf_and_tolerances_replace_those_of_the_bag(motion: ArmRecording, tmp_path: Path) -> None:
    path = write_recording(motion, tmp_path / "a.mcap")
    assert motion.arm.urdf is not None
    urdf = motion.arm.urdf.replace('name="panda"', 'name="other"')
    (back,) = read_recordings(path, urdf=urdf, tolerances=Tolerances(mass=0.2))
    assert back.arm.urdf == urdf
    assert back.arm.tolerances.mass == 0.2


@pytest.mark.thorough
def test_fifteen_seconds_at_a_kilohertz_are_quick(motion: ArmRecording, tmp_path: Path) -> None:
    count = 15_000
    values = np.random.default_rng(0).normal(size=(count, 7)).cumsum(axis=0) * 1e-3
    stamps = np.arange(count) * 1e-3
    long = replace(
        motion,
        states=JointSignal(stamps, values, values, None, values),
        command=JointSignal(stamps, values, values, values, values),
        commanded_effort=JointSignal(stamps, effort=values),
    )
    start = time.process_time()
    path = write_recording(long, tmp_path / "long.mcap")
    written = time.process_time()
    (back,) = read_recordings(path)
    read = time.process_time()
    assert_same(long, back)
    assert written - start < 4.0
    assert read - written < 3.0
