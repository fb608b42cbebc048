"""Every check of `samrl doctor` sees what it is there for."""

from __future__ import annotations

import fcntl
import json
import os
from pathlib import Path

import pytest

from samrl_core.common import warp_runtime
from samrl_core.policy.networks import weights
from samrl_ros.cli import doctor
from samrl_ros.doctor.check import Check, Level, ok, problem, warning
from samrl_ros.doctor.ros import PROFILE_VARIABLE, check_middleware, check_profile
from samrl_ros.doctor.system import (
    check_disk,
    check_gpu,
    check_kernel_cache,
    check_shared_memory,
    clean_shared_memory,
)
from samrl_ros.doctor.versions import check_lock, check_requirements
from samrl_ros.doctor.weights import check_weights


@pytest.mark.parametrize(
    ("environment", "level"),
    [
        ({}, Level.OK),
        ({"ROS_DOMAIN_ID": "101"}, Level.OK),
        ({"ROS_DOMAIN_ID": "500"}, Level.PROBLEM),
        ({"ROS_DOMAIN_ID": "-1"}, Level.PROBLEM),
        ({"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}, Level.WARNING),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, Level.WARNING),
    ],
)
def test_middleware(environment: dict[str, str], level: Level) -> None:
    assert check_middleware(environment).level is level


def test_our_profile_has_room_for_images() -> None:
    assert check_profile({}).level is Level.OK


@pytest.mark.parametrize(
    ("text", "level"),
    [
        ("<profiles><segment_size>524288</segment_size></profiles>", Level.WARNING),
        ("<profiles/>", Level.WARNING),
        ("<profiles", Level.PROBLEM),
    ],
)
def test_a_profile_of_the_users_own(text: str, level: Level, tmp_path: Path) -> None:
    file = tmp_path / "profile.xml"
    file.write_text(text)
    assert check_profile({PROFILE_VARIABLE: str(file)}).level is level
    assert check_profile({"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}).level is Level.WARNING


def test_shared_memory_that_nobody_has_open_is_told(tmp_path: Path) -> None:
    segment, lock = (tmp_path / f"fastrtps_0123456789abcdef{end}" for end in ("", "_el"))
    segment.write_bytes(bytes(65 * 2**20))
    lock.touch()
    os.utime(lock, (0, 0))
    with lock.open("ab") as owner:
        fcntl.flock(owner, fcntl.LOCK_EX)
        assert check_shared_memory(tmp_path).level is Level.OK
    left = check_shared_memory(tmp_path)
    assert left.level is Level.WARNING and "65 MiB" in left.found and "samrl doctor --clean" in left.remedy
    assert "1 segments" in clean_shared_memory(tmp_path).found and not list(tmp_path.iterdir())
    assert check_shared_memory(tmp_path).level is Level.OK
    assert check_shared_memory(tmp_path / "none").level is Level.PROBLEM


def test_versions_that_are_missing_or_outside_are_problems() -> None:
    installed = {"numpy": "1.26.0", "torch": "2.13.0+cpu"}.get
    check = check_requirements(["numpy>=2.0", "torch==2.13.0", "rich>=13; python_version < '3'"], installed)
    assert check.level is Level.PROBLEM and check.found == "numpy is 1.26.0, needed >=2.0"
    assert check_requirements(["rich>=13"], installed).found == "rich is missing"
    assert check_requirements(["torch==2.13.0"], installed).level is Level.OK


def test_versions_beside_the_lock_are_told(tmp_path: Path) -> None:
    lock = tmp_path / "constraints.txt"
    lock.write_text("# comment\nnumpy==2.4.6\ntorch==2.13.0+cpu\nabsent==1\n")
    assert check_lock(lock, {"numpy": "2.4.6", "torch": "2.13.0+cu130"}.get).level is Level.OK
    other = check_lock(lock, {"numpy": "2.5.0"}.get)
    assert other.level is Level.WARNING and "numpy 2.5.0 (lock: 2.4.6)" in other.found


def test_a_missing_network_is_a_problem(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert check_weights().level is Level.OK
    monkeypatch.setattr(weights, "shipped", lambda task, kind: tmp_path / "none.safetensors")
    assert check_weights().level is Level.PROBLEM


def test_an_unused_driver_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    assert check_gpu(tmp_path / "none").level is Level.OK
    (tmp_path / "version").touch()
    assert check_gpu(tmp_path / "version").level is Level.WARNING


def test_a_full_disk_is_a_problem(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    class Usage:
        free = 100 * 2**20

    monkeypatch.setattr("shutil.disk_usage", lambda path: Usage)
    check = check_disk(tmp_path / "out" / "deep")
    assert check.level is Level.PROBLEM and "100 MiB free" in check.found and "--out" in check.remedy


def test_an_empty_kernel_cache_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(warp_runtime, "kernel_cache", lambda: tmp_path / "cache")
    assert check_kernel_cache().level is Level.WARNING
    (tmp_path / "cache" / "module").mkdir()
    assert check_kernel_cache().level is Level.OK
    (tmp_path / "file").touch()
    monkeypatch.setattr(warp_runtime, "kernel_cache", lambda: tmp_path / "file" / "cache")
    assert check_kernel_cache().level is Level.PROBLEM


@pytest.mark.parametrize(
    ("made", "code"),
    [
        ([ok("a", "x"), warning("b", "y", "do")], 0),
        ([ok("a", "x"), problem("b", "y", "do")], 1),
    ],
)
def test_the_exit_code_tells_of_problems(
    made: list[Check], code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(doctor, "checks", lambda out: iter(made))
    assert doctor.doctor(doctor.DoctorOptions()) == code
    said = capsys.readouterr().out
    assert "-> do" in said and "a: x" in said
    assert doctor.doctor(doctor.DoctorOptions(as_json=True)) == code
    data = json.loads(capsys.readouterr().out)
    assert data["schema"] == 1 and data["problem"] == code
    assert data["checks"][1] == {"name": "b", "level": made[1].level, "found": "y", "remedy": "do"}
