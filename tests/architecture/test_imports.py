"""The import rules hold, and a breach of each is caught."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.architecture import import_rules as rules
from tests.architecture.import_rules import ROOT, imports_of_project


def test_the_walk_sees_the_code() -> None:
    assert {item.file.split("/")[0] for item in imports_of_project()} == {"samrl_core", "samrl_ros"}
    assert any(item.module.startswith("samrl_core.cell.types") for item in imports_of_project())


def test_restricted_packages_stay_in_their_places() -> None:
    assert rules.foreign_violations(imports_of_project()) == []


def test_wings_import_what_the_table_allows() -> None:
    assert rules.wing_violations(imports_of_project()) == []


def test_rooms_keep_their_own_rules() -> None:
    assert rules.room_violations(imports_of_project()) == []
    modules = {rules.module_of(item.file) for item in imports_of_project()}
    for room in rules.ROOMS:
        assert any(module.startswith(room + ".") for module in modules), f"no files in {room}"


def test_no_circles_between_files() -> None:
    assert rules.file_circles(imports_of_project()) == []


def test_no_circles_between_rooms() -> None:
    assert rules.room_circles(imports_of_project()) == []


@pytest.mark.parametrize("package", ["samrl_core", "samrl_ros"])
def test_the_table_points_downwards_and_lists_what_exists(package: str) -> None:
    table = rules.WINGS[package]
    assert rules.circles({wing: set(targets) for wing, targets in table.items()}) == []
    existing = {
        rules.wing_of(rules.module_of(item.file))
        for item in imports_of_project()
        if item.file.startswith(package)
    }
    assert existing - {""} <= set(table) and set(table) - existing <= {"contract", "interfaces"}


@pytest.mark.parametrize(
    ("file", "text", "check", "part"),
    [
        ("samrl_core/cell/robots/a.py", "def f():\n    import rclpy.node\n", "foreign_violations", "rclpy"),
        ("samrl_core/model/a.py", "import pybullet as p\n", "foreign_violations", "pybullet"),
        ("samrl_core/cell/world/a.py", "from warp import kernel\n", "foreign_violations", "warp"),
        (
            "samrl_core/studies/a.py",
            "from mcap.reader import make_reader\n",
            "foreign_violations",
            "mcap",
        ),
        (
            "samrl_core/a.py",
            "from samrl_ros.contract.topics import TOPICS\n",
            "foreign_violations",
            "samrl_ros",
        ),
        (
            "samrl_core/cell/tasks/a.py",
            "import importlib\nimportlib.import_module('std_msgs.msg')\n",
            "foreign_violations",
            "std_msgs",
        ),
        (
            "samrl_core/cell/types/a.py",
            "from samrl_core.model import model\n",
            "wing_violations",
            "cell may not import model",
        ),
        (
            "samrl_core/model/a.py",
            "from ..policy import agent\n",
            "wing_violations",
            "model may not import policy",
        ),
        ("samrl_core/misc/a.py", "import samrl_core.cell.types.pose\n", "wing_violations", "no line"),
        (
            "samrl_ros/bags/a.py",
            "from samrl_ros.recordings import read\n",
            "wing_violations",
            "bags may not import recordings",
        ),
        (
            "samrl_core/blind_test/worlds/a.py",
            "from samrl_core.diagnosis.diagnose import diagnose\n",
            "room_violations",
            "may not import",
        ),
        (
            "samrl_core/diagnosis/effects/a.py",
            "from samrl_core.diagnosis.selection import search\n",
            "room_violations",
            "may not import",
        ),
    ],
)
def test_a_breach_is_caught(tmp_path: Path, file: str, text: str, check: str, part: str) -> None:
    path = tmp_path / file
    path.parent.mkdir(parents=True)
    path.write_text(text)
    problems = getattr(rules, check)(list(rules.imports_below(tmp_path)))
    assert len(problems) == 1 and part in problems[0] and file in problems[0]


def _write_circle(root: Path, folder: str) -> None:
    for here, there in (("robots", "tasks"), ("tasks", "control"), ("control", "robots")):
        path = root / folder / here / "a.py"
        path.parent.mkdir(parents=True)
        name = "a" if here != "control" else "b"  # rooms close the circle, files do not
        path.write_text(f"from {folder.replace('/', '.')}.{there} import {name}\n")
    (root / folder / "robots" / "b.py").write_text("import os\n")


@pytest.mark.parametrize("folder", ["samrl_core/cell", "samrl_ros/nodes"])
def test_a_circle_of_rooms_is_caught(tmp_path: Path, folder: str) -> None:
    _write_circle(tmp_path, folder)
    found = list(rules.imports_below(tmp_path))
    dotted = folder.replace("/", ".")
    assert rules.room_circles(found) == [[f"{dotted}.{room}" for room in ("control", "robots", "tasks")]]
    assert rules.file_circles(found) == []


def test_a_circle_of_files_is_caught_even_when_lazy(tmp_path: Path) -> None:
    folder = tmp_path / "samrl_ros" / "bags"
    folder.mkdir(parents=True)
    (folder / "a.py").write_text("import os\nfrom samrl_ros.bags.b import thing\n")
    (folder / "b.py").write_text("import os\ndef f():\n    from samrl_ros.bags import a\n    return a\n")
    found = list(rules.imports_below(tmp_path))
    assert rules.file_circles(found) == [["samrl_ros.bags.a", "samrl_ros.bags.b"]]


@pytest.mark.thorough
def test_core_imports_with_ros_hidden() -> None:
    """Every module of the core, in a process where importing ROS, bags or the command line raises."""
    hidden = [name for name, places in rules.ALLOWED.items() if places == ("samrl_ros/",)]
    script = (
        "import importlib, pkgutil, sys\n"
        f"hidden = {hidden!r}\n"
        "class Hide:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] in hidden:\n"
        "            raise AssertionError(f'{name} is hidden from the core')\n"
        "sys.meta_path.insert(0, Hide())\n"
        "import samrl_core\n"
        "count = 0\n"
        "for module in pkgutil.walk_packages(samrl_core.__path__, 'samrl_core.'):\n"
        "    extra = ('samrl_core.studies.speed.peers.', 'samrl_core.studies.baselines.')\n"
        "    if not module.name.startswith(extra):\n"
        "        importlib.import_module(module.name)\n"
        "    count += 1\n"
        "print(count)\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr[-2000:]
    assert int(result.stdout.split()[-1]) > 10
