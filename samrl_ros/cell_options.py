"""What a run of the cell is asked to do, checked before anything starts."""

from __future__ import annotations

import importlib.util
import os
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import yaml

from samrl_core.errors import InputError
from samrl_core.tasks import task_named

# The recorder first, so that nothing is missed; the supervisor last, when all others answer.
NODE_ORDER = (
    "recorder",
    "sim_bridge",
    "manipulator",
    "view_planner",
    "model_updater",
    "residual_trainer",
    "supervisor",
)


LAYOUTS = ("split", "processes", "threads")


@dataclass(frozen=True)
class CellOptions:
    """Options of `samrl cell`."""

    task: str
    episodes: int
    seed: int
    out: Path
    layout: str = "split"  # split: computing nodes in own processes; processes: every node; threads: none
    view: bool = False  # Foxglove WebSocket server
    update: bool = True  # Real2Sim on
    strategy: str = "best"  # of the view planner
    real_time_factor: float = 1.0  # upper bound, 0 for as fast as it goes
    max_actions: int = 0  # 0 for the task's own
    world: str = "pybullet"
    params: Path | None = None  # a parameter file laid over ours
    node_args: tuple[str, ...] = ()  # further --ros-args

    def as_dict(self) -> dict[str, Any]:
        """Plain values for `summary.json`."""
        data = asdict(self)
        return {k: str(v) if isinstance(v, Path) else v for k, v in data.items()}


def prepare(options: CellOptions) -> Path:
    """Check the options, create the run's folder and write its parameter file.

    Returns:
        The parameter file.

    Raises:
        InputError: unknown task, an out folder in use or not writable, a parameter file that is missing.
    """
    task_named(options.task)
    if options.layout not in LAYOUTS:
        raise InputError(f"--layout is {options.layout!r}, must be one of {', '.join(LAYOUTS)}")
    if options.view and importlib.util.find_spec("foxglove") is None:
        raise InputError("--view needs the extra `viz`: pip install -e '.[viz]'")
    if options.episodes < 1:
        raise InputError(f"--episodes is {options.episodes}, must be at least 1")
    overlay: dict[str, Any] = {}
    if options.params is not None:
        overlay = _load(options.params)
    out = options.out
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out} is there already and not an empty folder; choose another --out")
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / "evaluation").mkdir()
    except OSError as error:
        raise InputError(f"cannot write to {out}: {error.strerror}; choose another --out") from error
    if not os.access(out, os.W_OK):
        raise InputError(f"{out} is not writable; choose another --out")
    file = out / "params.yaml"
    file.write_text(yaml.safe_dump(_parameters(options, overlay), sort_keys=False))
    return file


def _load(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise InputError(f"no parameter file at {path}")
    try:
        data = yaml.safe_load(path.read_text())
    except yaml.YAMLError as error:
        raise InputError(f"{path} is not YAML: {error}") from error
    if not isinstance(data, dict):
        raise InputError(f"{path} is not a ROS parameter file: the top level must name nodes")
    for node, body in data.items():
        if not isinstance(body, dict) or set(body) != {"ros__parameters"}:
            raise InputError(f"{path}: {node!r} must hold ros__parameters and nothing else")
    return data


def _parameters(options: CellOptions, overlay: dict[str, Any]) -> dict[str, Any]:
    out = options.out.resolve()
    ours: dict[str, dict[str, Any]] = {
        "sim_bridge": {
            "task": options.task,
            "world": options.world,
            "real_time_factor": options.real_time_factor,
            "evaluation_file": str(out / "evaluation" / "truth.jsonl"),
        },
        "manipulator": {"task": options.task},
        "view_planner": {"task": options.task, "strategy": options.strategy, "seed": options.seed},
        "model_updater": {"task": options.task, "enabled": options.update},
        "residual_trainer": {"task": options.task},
        "recorder": {"out": str(out / "bag"), "task": options.task},
        "supervisor": {
            "task": options.task,
            "episodes": options.episodes,
            "seed": options.seed,
            "max_actions": options.max_actions,
        },
    }
    merged: dict[str, Any] = {}
    for node, values in ours.items():
        key = f"/cell/{node}"
        given = overlay.pop(key, overlay.pop(node, {"ros__parameters": {}}))
        merged[key] = {"ros__parameters": {"use_sim_time": True, **values, **given["ros__parameters"]}}
    merged["/cell/sim_bridge"]["ros__parameters"]["use_sim_time"] = False  # it makes the clock
    if overlay:
        raise InputError(f"parameter file names unknown nodes {sorted(overlay)}; known: {list(ours)}")
    return merged


def field_names() -> tuple[str, ...]:
    """Names of all options."""
    return tuple(f.name for f in fields(CellOptions))
