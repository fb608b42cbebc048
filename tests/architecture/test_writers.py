"""Files are written by `samrl_core.common.files` and what builds on it: whole, with words for a full disk."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# Who may write by itself, and why.
OWN_WRITERS = {
    "samrl_core/common/files.py": "the writer",
    "samrl_core/common/figure_file.py": "into memory, then whole",
    "samrl_core/diagnosis/export/scripts/held_out_comparison.py": "plain code for users, without us",
    "samrl_core/diagnosis/export/scripts/resimulate_pybullet.py": "plain code for users, without us",
    "samrl_ros/bags/metadata.py": "OSError is the bag writer's to word",
    "samrl_ros/cell/node_group.py": "logs of child processes, in `room_for`",
    "samrl_ros/cell/soak/soak.py": "log of a child process, in `room_for`",
    "samrl_ros/watch/judgement.py": "log of a child process, in `room_for`",
    "samrl_ros/nodes/training_process.py": "log of a child process, in `room_for`",
    "samrl_core/studies/job_queue.py": "logs of child processes, in `room_for`",
    "samrl_core/blind_test/engines/engines.py": "a folder for one simulation",
    "samrl_core/cell/world/pybullet/arm_meshes.py": "a folder for one simulation",
    "samrl_core/cell/world/pybullet/body_files.py": "a folder for one simulation",
    "samrl_core/learning/residual/replay.py": "a sparse file, in `room_for`",
    "samrl_core/blind_test/scores/study.py": "an archive in memory, then whole",
    "samrl_ros/cell/report/pictures.py": "to nowhere",
    "samrl_ros/interfaces/build.py": "builds into the environment",
    "samrl_ros/interfaces/generate.py": "builds into the environment",
    "samrl_ros/docs.py": "pages of this repository",
}
METHODS = {"write_text", "write_bytes", "savefig"}


def own_writers() -> Iterator[tuple[str, int]]:
    """File and line of every call that writes a file directly."""
    for package in ("samrl_core", "samrl_ros"):
        for path in sorted((ROOT / package).rglob("*.py")):
            text = path.read_text()
            if not any(f".{name}" in text for name in (*METHODS, "open")):
                continue  # parsing takes a hundred times as long
            for node in ast.walk(ast.parse(text)):
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and _writes(node):
                    yield path.relative_to(ROOT).as_posix(), node.lineno


def _writes(call: ast.Call) -> bool:
    assert isinstance(call.func, ast.Attribute)
    if call.func.attr != "open":
        return call.func.attr in METHODS
    given = [*call.args, *(k.value for k in call.keywords if k.arg == "mode")]
    modes = [a.value for a in given if isinstance(a, ast.Constant) and isinstance(a.value, str)]
    return any(set("wax+") & set(mode) and len(mode) <= 3 for mode in modes)


def test_nobody_else_writes_files() -> None:
    found = list(own_writers())
    assert {file for file, _ in found} >= set(OWN_WRITERS), "OWN_WRITERS lists who writes nothing"
    others = [f"{file}:{line}" for file, line in found if file not in OWN_WRITERS]
    assert not others, f"use write_whole, append_line or save_figure, or say in OWN_WRITERS why not: {others}"
