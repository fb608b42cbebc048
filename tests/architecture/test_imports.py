"""The import rules hold, and a breach of each is caught."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]


def _load_rules() -> Any:
    spec = importlib.util.spec_from_file_location("import_rules", Path(__file__).with_name("import_rules.py"))
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules["import_rules"] = module
    spec.loader.exec_module(module)
    return module


rules = _load_rules()
FOUND = list(rules.imports_below(ROOT))


def test_the_walk_sees_the_code() -> None:
    assert {item.file.split("/")[0] for item in FOUND} == {"samrl_core", "samrl_ros"}
    assert any(item.module.startswith("samrl_core.types") for item in FOUND)


def test_restricted_packages_stay_in_their_places() -> None:
    assert rules.foreign_violations(FOUND) == []


def test_layers_point_downwards() -> None:
    assert rules.layer_violations(FOUND) == []


def test_no_cycles() -> None:
    assert rules.cycles(FOUND) == []


@pytest.mark.parametrize(
    ("file", "text", "check", "part"),
    [
        ("samrl_core/robots/a.py", "def f():\n    import rclpy.node\n", "foreign_violations", "rclpy"),
        ("samrl_core/model/a.py", "import pybullet as p\n", "foreign_violations", "pybullet"),
        ("samrl_core/world/a.py", "from warp import kernel\n", "foreign_violations", "warp"),
        (
            "samrl_core/experiments/a.py",
            "from mcap.reader import make_reader\n",
            "foreign_violations",
            "mcap",
        ),
        ("samrl_core/a.py", "from samrl_ros.topics import TOPICS\n", "foreign_violations", "samrl_ros"),
        (
            "samrl_core/tasks/a.py",
            "import importlib\nimportlib.import_module('std_msgs.msg')\n",
            "foreign_violations",
            "std_msgs",
        ),
        (
            "samrl_core/types/a.py",
            "from samrl_core.robots import robot\n",
            "layer_violations",
            "higher layer",
        ),
        ("samrl_core/model/a.py", "from .. import real2sim\n", "layer_violations", "higher layer"),
        ("samrl_core/misc/a.py", "import samrl_core.types.pose\n", "layer_violations", "no layer"),
    ],
)
def test_a_breach_is_caught(tmp_path: Path, file: str, text: str, check: str, part: str) -> None:
    path = tmp_path / file
    path.parent.mkdir(parents=True)
    path.write_text(text)
    problems = getattr(rules, check)(list(rules.imports_below(tmp_path)))
    assert len(problems) == 1 and part in problems[0] and file in problems[0]


def test_a_cycle_is_caught(tmp_path: Path) -> None:
    for here, there in (("robots", "tasks"), ("tasks", "motion"), ("motion", "robots")):
        path = tmp_path / "samrl_core" / here / "a.py"
        path.parent.mkdir(parents=True)
        path.write_text(f"from samrl_core.{there} import a\n")
    assert rules.cycles(list(rules.imports_below(tmp_path))) == ["motion -> robots -> tasks -> motion"]


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
        "    extra = ('samrl_core.benchmarks.peers.', 'samrl_core.baselines.gym_env')  # of extras\n"
        "    if not module.name.startswith(extra):\n"
        "        importlib.import_module(module.name)\n"
        "    count += 1\n"
        "print(count)\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False, timeout=100
    )
    assert result.returncode == 0, result.stderr[-2000:]
    assert int(result.stdout.split()[-1]) > 10
