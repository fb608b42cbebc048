"""Every disagreement between drivers and cell is seen before anything moves; a good set passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.common.errors import InputError
from samrl_ros.cli.main import run
from samrl_ros.contract.exit_codes import INPUT_REFUSED
from samrl_ros.hardware.driver_file import FOLDER, DriverFile, driver_named
from samrl_ros.hardware.preflight import (
    ImageSample,
    JointSample,
    arm_faults,
    camera_faults,
    cell_faults,
    reordered,
)

CELL = cell_named(DEFAULT_CELL)
FRANKA, FLEXIV, CAMERA = (driver_named(n) for n in ("franka_ros2", "flexiv_ros2", "realsense_ros"))
START = 1.7e9  # [s]: a clock of today, where floats resolve 0.2 us


def joint_samples(driver: DriverFile, role: str, hz: float = 1000.0, count: int = 200) -> list[JointSample]:
    """An arm at home and at rest, its joints in the reverse order, as a broadcaster may have them."""
    names = tuple(reversed(list(driver.joints)))
    home = tuple(float(v) for v in reversed(CELL.arm(role).home))
    zeros = (0.0,) * len(names)
    stamps = [START + k / hz for k in range(count)]
    return [JointSample(stamp + 0.001, stamp, names, home, zeros, zeros) for stamp in stamps]


def image_samples(hz: float = 15.0, count: int = 20) -> dict[str, list[ImageSample]]:
    """A 15 Hz camera of 640x480 whose middle, scaled, is the cell's image."""
    size, ours = 480, CELL.intrinsics
    scale = size / ours.width
    k = tuple(v * scale if i != 8 else 1.0 for i, v in enumerate(ours.ros_k))
    made: dict[str, list[ImageSample]] = {"color": [], "depth": [], "info": []}
    for i in range(count):
        stamp = START + i / hz
        sample = ImageSample(stamp + 0.02, stamp, "camera_color_optical_frame", size, size)
        made["color"].append(replace(sample, encoding="bgr8"))
        made["depth"].append(replace(sample, encoding="16UC1"))
        made["info"].append(replace(sample, k=k))
    return made


def test_drivers_that_agree_pass() -> None:
    drivers = {"tool_arm": FRANKA, "camera_arm": FLEXIV, "camera": CAMERA}
    arms = {
        "tool_arm": joint_samples(FRANKA, "tool_arm"),
        "camera_arm": joint_samples(FLEXIV, "camera_arm"),
    }
    assert cell_faults(CELL, drivers, arms, image_samples()) == []


def test_joints_are_brought_into_our_order() -> None:
    names = ("panda_joint3", "panda_joint1", "panda_joint2")
    joints = {f"panda_joint{k}": k for k in (1, 2, 3)}
    assert reordered(joints, names, (0.3, 0.1, 0.2)) == [0.1, 0.2, 0.3]


def changed(samples: Sequence[Any], **values: Any) -> list[Any]:
    return [replace(sample, **values) for sample in samples]


GOOD = joint_samples(FRANKA, "tool_arm")


@pytest.mark.parametrize(
    ("samples", "says"),
    [
        ([], "0 messages heard"),
        (joint_samples(FRANKA, "tool_arm", hz=30.0), "30.0 Hz, needed 200"),
        (changed(GOOD, names=tuple(f"fr3_joint{k}" for k in range(1, 8))), "fr3_joint1"),
        (changed(GOOD, names=tuple(FRANKA.joints)), "outside"),  # ours assumed, theirs sent
        (changed(GOOD, position=tuple(57.3 * v for v in GOOD[0].position)), "order and units"),  # degrees
        (changed(GOOD, velocity=(0.0,) * 6 + (0.1,)), "panda_joint1 moves at 0.100 rad/s"),
        (changed(GOOD, effort=()), "0 values of effort"),
        (changed(GOOD, position=(float("nan"),) * 7), "not finite"),
        ([replace(s, received_s=s.received_s + 2.0) for s in GOOD], "synchronise the clocks"),
        ([replace(s, received_s=s.received_s - 2.0) for s in GOOD], "after its reception"),
        ([s for s in GOOD for _ in range(2)], "repeat or go back"),
    ],
)
def test_a_fault_of_an_arm_is_seen(samples: list[JointSample], says: str) -> None:
    faults = arm_faults(FRANKA, CELL.tool_arm, samples)
    assert any(says in fault for fault in faults), faults


def spoil(name: str, **values: Any) -> dict[str, list[ImageSample]]:
    made = image_samples()
    made[name] = changed(made[name], **values)
    return made


def late_depth() -> dict[str, list[ImageSample]]:
    made = image_samples()
    made["depth"] = [replace(s, stamp_s=s.stamp_s + 0.02) for s in made["depth"]]
    return made


def age(seconds: float) -> dict[str, list[ImageSample]]:
    """Images received so long after their stamps."""
    return {
        name: [replace(s, received_s=s.stamp_s + seconds) for s in samples]
        for name, samples in image_samples().items()
    }


@pytest.mark.parametrize(
    ("samples", "says"),
    [
        ({}, "0 messages heard"),
        (image_samples(hz=5.0), "5.0 Hz, needed 8"),
        (spoil("color", frame="camera_link"), "['camera_link'], expected camera_color_optical_frame"),
        (spoil("color", encoding="yuv422_yuy2"), "yuv422_yuy2"),
        (spoil("depth", encoding="32FC1"), "expected ['16UC1']"),
        (spoil("depth", width=848), "align depth to colour"),
        (spoil("info", d=(0.1, 0.0, 0.0, 0.0, 0.0)), "rectify"),
        (late_depth(), "20.0 ms apart"),
        (spoil("info", k=(0.0,) * 9), "no camera matrix"),
        (spoil("info", k=(900.0, 0, 240, 0, 900.0, 240, 0, 0, 1.0)), "sees less than the cell's"),
        ({n: changed(s, width=400) for n, s in image_samples().items()}, "miss 79 pixels at an edge"),
        (age(2.0), "2.000 s before its reception, limit 0.25 s"),
        (age(-0.1), "0.100 s after its reception, limit 0.05 s"),
    ],
)
def test_a_fault_of_the_camera_is_seen(samples: dict[str, list[ImageSample]], says: str) -> None:
    faults = camera_faults(CAMERA, CELL.intrinsics, samples)
    assert any(says in fault for fault in faults), faults


def test_every_shipped_driver_has_sources_and_can_be_read() -> None:
    for path in sorted(FOLDER.glob("*.yaml")):
        driver = DriverFile.from_file(path)
        assert driver.sources and all(source.strip() for source in driver.sources)
    assert len(list(FOLDER.glob("*.yaml"))) == 4


@pytest.mark.parametrize(
    "content", [b"kind: !!bool x", b"kind: !!timestamp x", b"\xff\xfe", b"[" * 3000, b"3"]
)
def test_a_file_that_is_no_driver_is_refused(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_bytes(content)
    with pytest.raises(InputError, match=r"mine\.yaml"):
        driver_named(str(file))


def test_the_middle_of_a_wide_image_will_do_and_labels_may_come_late() -> None:
    wide = {n: changed(s, width=640) for n, s in image_samples().items()}
    k = wide["info"][0].k
    wide["info"] = changed(wide["info"], k=(k[0], 0.0, 319.5, *k[3:]))
    assert camera_faults(CAMERA, CELL.intrinsics, wide) == []
    labels = [replace(s, encoding="mono8", received_s=s.stamp_s + 0.2) for s in wide["color"]]
    heard = wide | {"mask": labels}
    assert cell_faults(CELL, {"camera": CAMERA, "segmenter": driver_named("segmenter")}, {}, heard) == []
    heard["mask"] = [replace(s, stamp_s=s.stamp_s + 0.02) for s in labels]
    faults = camera_faults(driver_named("segmenter"), CELL.intrinsics, heard)
    assert any("color and mask are 20.0 ms apart" in fault for fault in faults), faults


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[", "YAML"),
        ("package: x", "lacks"),
        ((FOLDER / "franka_ros2.yaml").read_text().replace("joint7: 7", "joint7: 8"), "without a gap"),
        ((FOLDER / "franka_ros2.yaml").read_text().replace(" 200.0", " 2000.0"), "at most rate_hz"),
        ((FOLDER / "franka_ros2.yaml").read_text().replace("kind: arm", "kind: camera"), "streams are"),
    ],
)
def test_a_bad_driver_file_is_refused(text: str, says: str, tmp_path: Path) -> None:
    file = tmp_path / "driver.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match=says):
        driver_named(str(file))


def test_the_command_refuses_what_it_cannot_judge(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["preflight", "--tool-arm", "realsense_ros"]) == INPUT_REFUSED
    assert "tool_arm needs one of kind arm" in capsys.readouterr().err
    assert run(["preflight", "--tool-arm", "ur_driver"]) == INPUT_REFUSED
    assert "franka_ros2" in capsys.readouterr().err
