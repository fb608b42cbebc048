"""Who may import whom: read from the source by AST, so that lazy imports count as well."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

# Distribution roots that only the named places may import. Paths are relative to the repository.
ALLOWED: dict[str, tuple[str, ...]] = {
    "pybullet": ("samrl_core/world/", "samrl_core/forge/", "samrl_core/benchmarks/peers/"),
    "pybullet_data": (),
    "warp": (
        "samrl_core/model/",
        "samrl_core/dynamics/",
        "samrl_core/warp_runtime.py",
        "samrl_core/diagnosis/effects/age_chain.py",  # a recursion over samples, too slow in Python
        "samrl_core/benchmarks/",  # Newton is used through it; limits of a device are measured with it
    ),
    "mujoco": (
        "samrl_core/forge/",  # second engine of sealed worlds
        "samrl_core/scoring/",  # a baseline
        "samrl_core/benchmarks/peers/",
    ),
    "gymnasium": ("samrl_core/baselines/",),
    "stable_baselines3": ("samrl_core/baselines/",),
    "mitsuba": ("samrl_core/benchmarks/peers/",),
    "newton": ("samrl_core/benchmarks/peers/",),
    "pinocchio": ("samrl_core/robots/", "samrl_core/dynamics/"),
    "plotly": ("samrl_core/report/",),
    "skimage": ("samrl_core/fusion/",),
    "rclpy": ("samrl_ros/",),
    "rcl_interfaces": ("samrl_ros/",),
    "lifecycle_msgs": ("samrl_ros/",),
    "builtin_interfaces": ("samrl_ros/",),
    "rosgraph_msgs": ("samrl_ros/",),
    "diagnostic_msgs": ("samrl_ros/",),
    "geometry_msgs": ("samrl_ros/",),
    "sensor_msgs": ("samrl_ros/",),
    "std_msgs": ("samrl_ros/",),
    "std_srvs": ("samrl_ros/",),
    "trajectory_msgs": ("samrl_ros/",),
    "tf2_msgs": ("samrl_ros/",),
    "samrl_msgs": ("samrl_ros/",),
    "ament_index_python": ("samrl_ros/",),
    "samrl_ros": ("samrl_ros/",),
    "mcap": ("samrl_ros/",),
    "mcap_ros2": ("samrl_ros/",),
    "rosbags": ("samrl_ros/bags/",),  # optional there: definitions where no ROS is installed
    "typer": ("samrl_ros/",),
    "rich": ("samrl_ros/",),
}

# Layers of samrl_core, lowest first: a module imports from its own part of the code and from lower layers.
LAYERS: tuple[frozenset[str], ...] = (
    frozenset({"errors", "folder_lock", "same_settings", "whole_file"}),
    frozenset({"types", "warp_runtime"}),
    frozenset({"robots", "tasks", "motion", "safety"}),
    frozenset({"excitation"}),
    frozenset({"model", "world", "dynamics", "recordings"}),
    frozenset({"inverse", "forge"}),  # forge makes sealed worlds: below the diagnosis, so it cannot know it
    frozenset({"real2sim", "prediction", "attributes", "fusion", "view_planning", "view_reach", "trajectory"})
    | frozenset({"rl", "diagnosis", "residual"}),
    frozenset({"learn"}),
    frozenset({"agent"}),
    frozenset({"report"}),
    frozenset({"scoring", "experiments", "benchmarks", "baselines"}),
)


@dataclass(frozen=True)
class Import:
    """One import of `module` (dotted) in `file` (relative path) at `line`."""

    file: str
    line: int
    module: str


def imports_below(root: Path, packages: tuple[str, ...] = ("samrl_core", "samrl_ros")) -> Iterator[Import]:
    """Every absolute and relative import in the packages, wherever it stands in its file."""
    for package in packages:
        for path in sorted((root / package).rglob("*.py")):
            file = path.relative_to(root).as_posix()
            for node in ast.walk(ast.parse(path.read_text(), file)):
                if isinstance(node, ast.Import):
                    for alias in node.names:
                        yield Import(file, node.lineno, alias.name)
                elif isinstance(node, ast.ImportFrom):
                    base = _absolute(file, node)
                    for alias in node.names:
                        yield Import(file, node.lineno, f"{base}.{alias.name}")
                elif isinstance(node, ast.Call) and _is_dynamic(node):
                    argument = node.args[0]
                    if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
                        yield Import(file, node.lineno, argument.value)


def _absolute(file: str, node: ast.ImportFrom) -> str:
    if not node.level:
        return node.module or ""
    parents = file.split("/")[: -node.level]
    return ".".join([*parents, *([node.module] if node.module else [])])


def _is_dynamic(node: ast.Call) -> bool:
    function = node.func
    name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    return name in ("import_module", "__import__") and bool(node.args)


def foreign_violations(found: list[Import]) -> list[str]:
    """Imports of a restricted distribution outside its places."""
    return [
        f"{item.file}:{item.line} imports {item.module}; only {ALLOWED[root] or 'tests'} may"
        for item in found
        if (root := item.module.split(".")[0]) in ALLOWED
        and not item.file.startswith(ALLOWED[root] or ("-",))
    ]


def part_of(path_or_module: str) -> str:
    """The part of samrl_core a file or module belongs to; empty outside of it or for the package itself."""
    pieces = path_or_module.removesuffix(".py").replace("/", ".").split(".")
    return pieces[1] if pieces[0] == "samrl_core" and len(pieces) > 1 and pieces[1] != "__init__" else ""


def layer_violations(found: list[Import]) -> list[str]:
    """Imports within samrl_core that point upwards, sideways into another part, or into an unlisted part."""
    level = {part: number for number, parts in enumerate(LAYERS) for part in parts}
    problems = []
    for item in found:
        source, target = part_of(item.file), part_of(item.module)
        if not source or not target or source == target:
            continue
        for part in (source, target):
            if part not in level:
                problems.append(
                    f"{item.file}:{item.line}: samrl_core/{part} has no layer in {Path(__file__).name}"
                )
        if level.get(target, 0) > level.get(source, 99):
            problems.append(f"{item.file}:{item.line}: {source} imports {target}, a higher layer")
    return problems


def cycles(found: list[Import]) -> list[str]:
    """Parts of samrl_core that import each other in a circle, sideways imports within a layer included."""
    graph: dict[str, set[str]] = {}
    for item in found:
        source, target = part_of(item.file), part_of(item.module)
        if source and target and source != target:
            graph.setdefault(source, set()).add(target)
    problems = []

    def visit(part: str, trail: tuple[str, ...]) -> None:
        if part in trail:
            problems.append(" -> ".join((*trail[trail.index(part) :], part)))
            return
        for target in sorted(graph.get(part, ())):
            visit(target, (*trail, part))

    for part in sorted(graph):
        visit(part, ())
    return sorted({cycle for cycle in problems if cycle.split(" -> ")[0] == min(cycle.split(" -> "))})
