"""Who may import whom: read from the source by AST, so that lazy imports count as well."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

# Distribution roots that only the named places may import. Paths are relative to the repository.
ALLOWED: dict[str, tuple[str, ...]] = {
    "pybullet": (
        "samrl_core/cell/world/",
        "samrl_core/blind_test/engines/",
        "samrl_core/studies/speed/peers/",
        "samrl_core/diagnosis/export/scripts/",  # handed to users, run as they would
    ),
    "pybullet_data": ("samrl_core/cell/world/pybullet/arm_meshes.py",),  # the Panda's meshes
    "warp": (
        "samrl_core/model/rendering/",
        "samrl_core/model/physics/",
        "samrl_core/diagnosis/simulation/",
        "samrl_core/common/warp_runtime.py",
        "samrl_core/diagnosis/effects/drive/age_chain.py",  # a recursion over samples, too slow in Python
        "samrl_core/studies/speed/",  # Newton is used through it; limits of a device are measured with it
    ),
    "mujoco": (
        "samrl_core/blind_test/engines/",  # second engine of sealed worlds
        "samrl_core/blind_test/baselines/",
        "samrl_core/studies/speed/peers/",
        "samrl_core/diagnosis/nominal_model/",  # it compiles MJCF
        "samrl_core/diagnosis/export/",  # it is one of those that are exported to
    ),
    "xacro": ("samrl_core/diagnosis/nominal_model/",),
    "gymnasium": ("samrl_core/studies/baselines/",),
    "mitsuba": ("samrl_core/studies/speed/peers/",),
    "newton": ("samrl_core/studies/speed/peers/",),
    "pinocchio": (
        "samrl_core/cell/robots/",
        "samrl_core/diagnosis/simulation/",
        "samrl_core/blind_test/engines/",  # third engine of sealed worlds
        "samrl_core/studies/speed/",
    ),
    "jinja2": (
        "samrl_core/common/templates.py",
        "samrl_core/diagnosis/report/",
        "samrl_core/diagnosis/history/",
        "samrl_ros/cell/report/",
    ),
    "pandas": ("samrl_ros/log_import/",),
    "pydantic": ("samrl_core/common/validation.py", "samrl_core/diagnosis/report/", "samrl_ros/log_import/"),
    "plotly": ("samrl_core/diagnosis/report/", "samrl_core/diagnosis/history/", "samrl_ros/cell/report/"),
    "skimage": ("samrl_core/model/fusion/",),
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
    "rosbags": ("samrl_ros/bags/", "samrl_ros/log_import/formats/"),
    "typer": ("samrl_ros/",),
    "rich": ("samrl_ros/",),
}

# What each wing may import besides itself. A wing that is not listed is an error.
WINGS: dict[str, dict[str, frozenset[str]]] = {
    "samrl_core": {
        "common": frozenset(),
        "cell": frozenset({"common"}),
        "diagnosis": frozenset({"model", "cell", "common"}),  # the model: for images alone, see ROOMS
        "model": frozenset({"cell", "common"}),
        "blind_test": frozenset({"diagnosis", "cell", "common"}),
        "policy": frozenset({"model", "cell", "common"}),
        "learning": frozenset({"policy", "model", "cell", "common"}),
        "studies": frozenset({"learning", "policy", "model", "diagnosis", "cell", "common"}),
    },
    "samrl_ros": {
        "contract": frozenset(),
        "interfaces": frozenset(),
        "conversions": frozenset(),
        "hosting": frozenset({"contract"}),
        "bags": frozenset({"contract", "hosting"}),
        "recordings": frozenset({"bags", "contract", "conversions"}),
        "log_import": frozenset({"recordings", "bags"}),
        "blind_test": frozenset({"recordings", "bags"}),
        "nodes": frozenset({"hardware", "bags", "contract", "conversions", "hosting"}),
        "cell": frozenset({"nodes", "hardware", "bags", "contract", "conversions", "hosting"}),
        "watch": frozenset({"bags", "contract"}),
        "doctor": frozenset({"hosting", "contract"}),
        "hardware": frozenset({"contract", "conversions"}),
        "cli": frozenset(
            {
                "cell",
                "doctor",
                "hardware",
                "blind_test",
                "log_import",
                "recordings",
                "watch",
                "nodes",
                "bags",
                "hosting",
                "interfaces",
                "contract",
            }
        ),
        "docs": frozenset({"nodes", "contract"}),
        "ros2_run": frozenset({"cli", "nodes", "hosting", "contract"}),
    },
}

# Rooms with a stricter rule than their wing: they may import these prefixes of the project alone. Who makes
# sealed worlds cannot know the diagnosis, and effects do not know how they are selected.
ROOMS: dict[str, tuple[str, ...]] = {
    "samrl_core.blind_test.engines": ("samrl_core.cell", "samrl_core.common"),
    "samrl_core.blind_test.disturbances": (
        "samrl_core.blind_test.engines",
        "samrl_core.cell",
        "samrl_core.common",
    ),
    # Written without sight of the first set: of it, the shapes of `disturbance` and the look-up alone.
    "samrl_core.blind_test.second_set": (
        "samrl_core.blind_test.disturbances.disturbance",
        "samrl_core.blind_test.disturbances.registry",
        "samrl_core.blind_test.engines",
        "samrl_core.cell",
        "samrl_core.common",
    ),
    "samrl_core.blind_test.servo_worlds": (
        "samrl_core.blind_test.disturbances.disturbance",
        "samrl_core.common",
    ),
    "samrl_core.blind_test.worlds": (
        "samrl_core.blind_test.disturbances",
        "samrl_core.blind_test.second_set",
        "samrl_core.blind_test.engines",
        "samrl_core.cell",
        "samrl_core.common",
    ),
    # Images are compared with the model's own rendering; nothing else of the diagnosis knows the model.
    "samrl_core.diagnosis.residuals.images": (
        "samrl_core.diagnosis.residuals",
        "samrl_core.model.rendering",
        "samrl_core.model.scene",
        "samrl_core.cell",
        "samrl_core.common",
    ),
    **{
        f"samrl_core.diagnosis.{room}": ("samrl_core.diagnosis", "samrl_core.cell", "samrl_core.common")
        for room in (
            "residuals",
            "selection",
            "kinds",
            "simulation",
            "recordings",
            "nominal_model",
            "export",
            "report",
            "history",
        )
    },
    "samrl_core.diagnosis.effects": (
        "samrl_core.diagnosis.residuals",
        "samrl_core.diagnosis.simulation",
        "samrl_core.cell",
        "samrl_core.common",
    ),
}


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


@cache
def imports_of_project() -> tuple[Import, ...]:
    """Every import of this checkout, read once."""
    return tuple(imports_below(ROOT))


def _absolute(file: str, node: ast.ImportFrom) -> str:
    if not node.level:
        return node.module or ""
    parents = file.split("/")[: -node.level]
    return ".".join([*parents, *([node.module] if node.module else [])])


def _is_dynamic(node: ast.Call) -> bool:
    function = node.func
    name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    return name in ("import_module", "__import__") and bool(node.args)


def foreign_violations(found: Iterable[Import]) -> list[str]:
    """Imports of a restricted distribution outside its places."""
    return [
        f"{item.file}:{item.line} imports {item.module}; only {ALLOWED[root] or 'tests'} may"
        for item in found
        if (root := item.module.split(".")[0]) in ALLOWED
        and not item.file.startswith(ALLOWED[root] or ("-",))
    ]


def wing_of(module: str) -> str:
    """The wing of a dotted module, such as `model`; empty for a package itself."""
    pieces = module.split(".")
    return pieces[1] if pieces[0] in WINGS and len(pieces) > 1 else ""


def room_of(module: str) -> str:
    """Package, wing and room of a dotted module, such as `samrl_core.model.physics`."""
    return ".".join(module.split(".")[:3])


def module_of(file: str) -> str:
    """Dotted name of a file; a package's is that of its folder."""
    return file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def wing_violations(found: Iterable[Import]) -> list[str]:
    """Imports of a wing that the table does not allow, and wings that it does not list."""
    problems = []
    for item in found:
        source, target = module_of(item.file), item.module
        package = source.split(".")[0]
        here, there = wing_of(source), wing_of(target)
        if not here or not there or package != target.split(".")[0] or here == there:
            continue
        table = WINGS[package]
        for wing in (here, there):
            if wing not in table:
                problems.append(
                    f"{item.file}:{item.line}: {package}/{wing} has no line in {Path(__file__).name}"
                )
        if here in table and there in table and there not in table[here]:
            problems.append(f"{item.file}:{item.line}: {here} may not import {there}")
    return problems


def room_violations(found: Iterable[Import]) -> list[str]:
    """Imports of the project by a room that has a rule of its own."""
    problems = []
    for item in found:
        source = module_of(item.file)
        room = next((r for r in ROOMS if source == r or source.startswith(r + ".")), None)
        if room is None or not item.module.startswith(("samrl_core.", "samrl_ros.")):
            continue
        if not any(item.module == p or item.module.startswith(p + ".") for p in (room, *ROOMS[room])):
            problems.append(f"{item.file}:{item.line}: {room} may not import {item.module}")
    return problems


def graph_of(found: Iterable[Import]) -> dict[str, set[str]]:
    """Files that each file imports, by dotted module name; for an imported name, the file that has it."""
    found = list(found)
    known = {module_of(item.file) for item in found}
    graph: dict[str, set[str]] = {}
    for item in found:
        source, target = module_of(item.file), item.module
        while target and target not in known:
            target = target.rpartition(".")[0]
        graph.setdefault(source, set())
        if target and target != source:
            graph[source].add(target)
    return graph


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Groups of nodes that reach one another (strongly connected components of more than one, sorted)."""
    order: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found = []

    def visit(node: str) -> None:
        order[node] = low[node] = len(order)
        stack.append(node)
        for target in sorted(graph.get(node, ())):
            if target not in order:
                visit(target)
                low[node] = min(low[node], low[target])
            elif target in stack:
                low[node] = min(low[node], order[target])
        if low[node] == order[node]:
            group = [stack.pop()]
            while group[-1] != node:
                group.append(stack.pop())
            if len(group) > 1:
                found.append(sorted(group))

    for node in sorted(graph):
        if node not in order:
            visit(node)
    return sorted(found)


def file_circles(found: Iterable[Import]) -> list[list[str]]:
    """Files that import one another in a circle, lazy and typing-only imports included."""
    return circles(graph_of(found))


def room_circles(found: Iterable[Import]) -> list[list[str]]:
    """Rooms that import one another in a circle."""
    graph: dict[str, set[str]] = {}
    for source, targets in graph_of(found).items():
        graph.setdefault(room_of(source), set()).update(room_of(t) for t in targets)
    for room, targets in graph.items():
        targets.discard(room)
    return circles(graph)
