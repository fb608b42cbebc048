"""How large and how tangled the code is: `python tests/architecture/house_metrics.py [CHECKOUT ...]`.

One column for each checkout (this one unless told otherwise), so that a reorganisation can be compared.
Everything is read from the source; nothing of the checkout is imported.
"""

from __future__ import annotations

import ast
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.architecture.import_rules import circles, graph_of, imports_below

PACKAGES = ("samrl_core", "samrl_ros")
SMALL = 40  # lines; a file below that may want to be part of another


def product_files(root: Path) -> list[Path]:
    """Python files of both packages."""
    return sorted(p for package in PACKAGES for p in (root / package).rglob("*.py"))


def fold(graph: dict[str, set[str]], depth: int) -> dict[str, set[str]]:
    """The import graph of files as one of folders, `depth` components deep (2: wings, 3: rooms)."""
    folded: dict[str, set[str]] = defaultdict(set)
    for source, targets in graph.items():
        here = ".".join(source.split(".")[:depth])
        folded[here].update(".".join(t.split(".")[:depth]) for t in targets)
        folded[here].discard(here)
    for package in PACKAGES:
        folded.pop(package, None)
    return {node: {t for t in targets if t not in PACKAGES} for node, targets in folded.items()}


def floors(graph: dict[str, set[str]]) -> int:
    """Length of the longest chain of imports; nodes of one circle share a floor."""
    group = {node: node for node in graph}
    for members in circles(graph):
        group.update(dict.fromkeys(members, members[0]))
    merged: dict[str, set[str]] = defaultdict(set)
    for node, targets in graph.items():
        merged[group[node]].update(group.get(t, t) for t in targets)
    height: dict[str, int] = {}

    def climb(node: str) -> int:
        if node not in height:
            height[node] = 1 + max((climb(t) for t in merged.get(node, ()) if t != node), default=0)
        return height[node]

    return max(climb(node) for node in list(merged))


def repeated_classes(files: list[Path]) -> dict[str, int]:
    """Class names that stand in more than one file, and how often. Names with an underscore are private."""
    count = Counter(
        node.name
        for file in files
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    return {name: n for name, n in count.items() if n > 1}


def _defaults(tree: ast.AST) -> Iterator[tuple[str, object]]:
    """Name and literal of each default: of a dataclass field, an argument or `setting(value, ...)`."""
    for node in ast.walk(tree):
        pairs: list[tuple[str, ast.expr | None]] = []
        if isinstance(node, ast.ClassDef):
            for item in node.body:
                if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name):
                    pairs.append((item.target.id, item.value))
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            named = [*node.args.posonlyargs, *node.args.args]
            given = [*[None] * (len(named) - len(node.args.defaults)), *node.args.defaults]
            pairs += [(a.arg, d) for a, d in zip(named, given, strict=True)]
            pairs += [(a.arg, d) for a, d in zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)]
        for name, value in pairs:
            if isinstance(value, ast.Call) and value.args and getattr(value.func, "id", "") == "setting":
                value = value.args[0]
            if isinstance(value, ast.Constant) and isinstance(value.value, int | float):
                yield name, value.value


def repeated_defaults(files: list[Path]) -> dict[tuple[str, object], int]:
    """(name, number) stated as a default in more than one file; -1, 0, 1 and booleans are not counted."""
    stands = defaultdict(set)
    for file in files:
        for name, value in _defaults(ast.parse(file.read_text())):
            if not isinstance(value, bool) and value not in (0, 1, -1):
                stands[name, value].add(file)
    return {key: len(places) for key, places in stands.items() if len(places) > 1}


def metrics(root: Path) -> dict[str, object]:
    """All figures of a checkout, by their name."""
    files = product_files(root)
    graph = graph_of(list(imports_below(root)))
    core = {k: {t for t in v if t.startswith("samrl_core.")} for k, v in graph.items() if "samrl_core." in k}
    wings, rooms = fold(core, 2), fold(graph, 3)
    folders = Counter(file.parent for file in files)
    lines = {file: len(file.read_text().splitlines()) for file in files}
    largest = max(folders, key=lambda folder: folders[folder])
    classes, defaults = repeated_classes(files), repeated_defaults(files)
    return {
        "product files": len(files),
        "product lines": sum(lines.values()),
        f"files under {SMALL} lines": sum(
            n < SMALL for f, n in lines.items() if f.name != "__init__.py" and n
        ),
        "files over 400 lines": sum(n > 400 for n in lines.values()),
        "folders and loose files directly below samrl_core": len(wings),
        "floors of imports between them": floors(wings),
        "import arrows between them": sum(len(t) for t in wings.values()),
        "circles of folders, both packages": len(circles(fold(graph, 2))) + len(circles(rooms)),
        "circles of files, both packages": len(circles(graph)),
        "largest flat folder": f"{folders[largest]} ({largest.relative_to(root)})",
        "class names that stand twice or more": len(classes),
        "defaults stated in more than one file": len(defaults),
    }


def main(arguments: list[str]) -> None:
    """Print the table."""
    roots = [Path(a).resolve() for a in arguments] or [Path(__file__).resolve().parents[2]]
    columns = [metrics(root) for root in roots]
    for name in columns[0]:
        print(f"{name:52s}" + "".join(f"{column[name]!s:>42s}" for column in columns))
    if len(roots) == 1:
        print("classes:", repeated_classes(product_files(roots[0])))
        print(
            "defaults:", {f"{n}={v}": c for (n, v), c in repeated_defaults(product_files(roots[0])).items()}
        )


if __name__ == "__main__":
    main(sys.argv[1:])
