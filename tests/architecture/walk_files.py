"""Which files a walk through the code passes: `python tests/architecture/walk_files.py WALK ...`.

    walk_files.py replay BAG                     images of a recorded run to views and actions
    walk_files.py diagnose MAPPING FOLDER        logs in FOLDER imported by a mapping, then diagnosed

A file counts when one of its functions ran, as the profiler's calls tell; what only imports it does not, nor
do bodies of classes and modules. Compiled kernels are not seen: a kernel's file counts by its Python alone.
"""

from __future__ import annotations

import inspect
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import CodeType, FrameType

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("samrl_core", "samrl_ros")  # an environment below the root is not the project
sys.path.insert(0, str(ROOT))


class Walk:
    """Code objects that ran in this process, by file of the project."""

    def __init__(self) -> None:
        self._seen: set[CodeType] = set()

    def __enter__(self) -> Walk:
        threading.setprofile(self._heard)
        sys.setprofile(self._heard)
        return self

    def __exit__(self, *_: object) -> None:
        sys.setprofile(None)
        threading.setprofile(None)

    def _heard(self, frame: FrameType, event: str, _: object) -> None:
        if event == "call":
            self._seen.add(frame.f_code)

    def files(self) -> Counter[str]:
        """Functions that ran, by path relative to the project."""
        found: Counter[str] = Counter()
        for code in tuple(self._seen):  # threads of the walk may still run
            path = Path(code.co_filename)
            function = code.co_flags & inspect.CO_OPTIMIZED  # bodies of modules and classes are not
            if function and any(path.is_relative_to(ROOT / package) for package in PACKAGES):
                found[str(path.relative_to(ROOT))] += 1
        return found


def command(arguments: list[str]) -> None:
    """Run `samrl` here, and stop unless it succeeds."""
    from samrl_ros.cli.main import run

    if code := run(arguments):
        sys.exit(f"samrl {' '.join(arguments)} ended with {code}")


def walked(work: Callable[[], None]) -> Counter[str]:
    """Files of a piece of work."""
    with Walk() as walk:
        work()
    return walk.files()


def walks(arguments: list[str], out: Path) -> dict[str, Counter[str]]:
    """Files of each walk that is asked for, by what it does."""
    match arguments:
        case ["replay", bag]:
            return {"replay": walked(lambda: command(["replay", bag, "--out", str(out / "replay.json")]))}
        case ["diagnose", mapping, folder]:
            bags = str(out / "bags")
            made = walked(lambda: command(["bag", "import", mapping, "--data", folder, "--out", bags]))
            return {
                "import": made,
                "diagnose": walked(lambda: command(["diagnose", bags, "--out", str(out / "diagnosis")])),
            }
    sys.exit(__doc__)


def main(arguments: list[str]) -> None:
    """Print each file with how many of its functions ran, and the sum."""
    with tempfile.TemporaryDirectory() as out:
        found = walks(arguments, Path(out))
    for name, files in found.items():
        for file, functions in sorted(files.items()):
            lines = len((ROOT / file).read_text().splitlines())
            print(f"{name:10s} {functions:4d} functions {lines:4d} lines  {file}")
    for name, files in found.items():
        print(f"{name}: {len(files)} files")


if __name__ == "__main__":
    main(sys.argv[1:])
