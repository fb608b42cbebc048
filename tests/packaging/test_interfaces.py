"""The interfaces build: right types, nothing done twice, clear refusals."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from samrl_core.common.errors import InputError
from samrl_ros.cli.main import run
from samrl_ros.interfaces import build as build_module
from samrl_ros.interfaces import compile as compile_module
from samrl_ros.interfaces.build import Target, build, is_current, remove, this_environment
from samrl_ros.interfaces.sources import definitions_folder, fingerprint, read_package

# What a ROS 2 Jazzy system prints for tf2_msgs/msg/TFMessage (ros2 topic info -v /tf)
TF_MESSAGE_HASH = "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"


def _hash(share: Path, type_name: str) -> str:
    package, kind, name = type_name.split("/")
    described = json.loads((share / package / kind / f"{name}.json").read_text())
    return next(item["hash_string"] for item in described["type_hashes"] if item["type_name"] == type_name)


@pytest.mark.ros
def test_the_built_tf_message_is_the_one_of_other_ros_systems() -> None:
    assert _hash(this_environment().share, "tf2_msgs/msg/TFMessage") == TF_MESSAGE_HASH


@pytest.mark.ros
def test_the_environment_is_current_and_nothing_is_built_again() -> None:
    assert build() == []


@pytest.mark.ros
def test_the_command_builds_what_is_not_current(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["interfaces"]) == 0 and "are current" in capfd.readouterr().out


@pytest.mark.ros
def test_every_definition_is_importable_and_in_the_index() -> None:
    from samrl_ros.contract.message_types import message_class

    package = read_package("samrl_msgs", definitions_folder())
    index = this_environment().share / "ament_index/resource_index/rosidl_interfaces/samrl_msgs"
    for type_name, file in zip(package.type_names, package.files, strict=True):
        assert message_class(type_name).__name__ == file.stem
        assert str(file) in index.read_text().splitlines()


def test_a_changed_definition_makes_the_build_stale(tmp_path: Path) -> None:
    shutil.copytree(definitions_folder() / "tf2_msgs", tmp_path / "tf2_msgs")
    before = read_package("tf2_msgs", tmp_path)
    old = fingerprint(before)
    target = Target(tmp_path / "modules", tmp_path / "share")
    (target.modules / "tf2_msgs").mkdir(parents=True)
    (target.modules / "tf2_msgs" / "__init__.py").touch()
    target.stamp("tf2_msgs").parent.mkdir(parents=True)
    target.stamp("tf2_msgs").write_text(json.dumps({"fingerprint": old}))
    assert is_current(before, target)
    with (tmp_path / "tf2_msgs/msg/TFMessage.msg").open("a") as file:
        file.write("bool extra\n")
    assert fingerprint(read_package("tf2_msgs", tmp_path)) != old
    assert not is_current(read_package("tf2_msgs", tmp_path), target)


def test_remove_takes_out_only_what_was_built_here(tmp_path: Path) -> None:
    target = Target(tmp_path / "modules", tmp_path / "share")
    (target.modules / "tf2_msgs").mkdir(parents=True)  # somebody else's: no stamp
    remove("tf2_msgs", target)
    assert (target.modules / "tf2_msgs").is_dir()


def test_a_missing_compiler_is_named_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compile_module.shutil, "which", lambda tool: None)
    with pytest.raises(InputError, match=r"gcc and g\+\+.*build-essential"):
        compile_module.require_compilers()


def test_missing_generators_are_named_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build_module.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="ros"):
        build_module.wheels_prefix()


def test_an_empty_package_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing to build"):
        read_package("empty_msgs", tmp_path)


@pytest.mark.slow
@pytest.mark.ros
def test_a_build_from_nothing_is_importable(tmp_path: Path) -> None:
    target = Target(tmp_path / "modules", tmp_path / "share")
    assert build(("samrl_msgs",), force=True, target=target) == ["samrl_msgs"]
    script = (
        "import sys, samrl_msgs.msg as m\n"
        f"assert m.__file__.startswith({str(target.modules)!r}), m.__file__\n"
        "from rclpy.serialization import serialize_message, deserialize_message\n"
        "sent = m.ModelState(names=['x'], values=[1.5], step=3)\n"
        "got = deserialize_message(serialize_message(sent), m.ModelState)\n"
        "assert got == sent, got\n"
    )
    code = f"import sys; sys.path.insert(0, {str(target.modules)!r})\n{script}"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert _hash(target.share, "samrl_msgs/msg/ModelState") == _hash(
        this_environment().share, "samrl_msgs/msg/ModelState"
    )
