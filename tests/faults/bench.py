"""`make faults`: faults x moments over the live graph; each cell of the table a promise, measured.

python -m tests.faults.bench [--out DIR] [--only TEXT] [--moment TEXT] [--setting TEXT] [--jobs N]
                             [--again] [--list]
Results are files in DIR/cells; what has one is left alone, so that a bench can be stopped and resumed. As
root it works in a network and shared memory of its own, tries two hosts and a full disk, and several whole
cells at once (--jobs, 3 cores each); else it leaves those out.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.faults.arms_faults import FAULTS
from tests.faults.cell_faults import CELL_FAULTS
from tests.faults.page import draw, write_page
from tests.faults.processes import ROOT, kill_marked
from tests.faults.trial import Trial

PRIVATE = 'ip link set lo up && mount -t tmpfs tmpfs /dev/shm && exec "$@"'
LONGEST_S = 1500.0  # wall time of a session that hangs


def table(only: str, moment: str, setting: str = "") -> list[tuple[str, str, str]]:
    """Setting, fault and moment of all cells that are asked for."""
    root = os.geteuid() == 0
    return [
        (fault.setting, fault.name, at)
        for fault in (*FAULTS, *CELL_FAULTS)
        for at in fault.moments
        if only in fault.name and moment in at and setting in fault.setting
        if root or not (fault.setting == "hosts" or getattr(fault, "disk", ""))
    ]


def commit() -> str:
    """What is tried."""
    words = ["git", "-C", str(ROOT), "describe", "--always", "--dirty"]
    return subprocess.run(words, capture_output=True, text=True, check=False).stdout.strip() or "unknown"


def run_session(out: Path, cells: Sequence[str]) -> None:
    """Some cells in one session, isolated as far as this user may."""
    folder = Path(tempfile.mkdtemp(prefix="run-", dir=out))
    command = [sys.executable, "-m", "tests.faults.session", str(out), str(folder), commit(), *cells]
    if os.geteuid() == 0:
        command = ["unshare", "-n", "-m", "sh", "-c", PRIVATE, "sh", *command]
    try:
        subprocess.run(command, timeout=LONGEST_S, check=False)
    except subprocess.TimeoutExpired:
        print("the session hung", flush=True)
    finally:
        for run in (folder.name, *(f"{folder.name}-{part.name}" for part in folder.iterdir())):
            kill_marked(run)
        for steps in folder.rglob("steps.*"):
            steps.unlink()  # 0.6 MB a second; what they came to stands in the results


def main() -> int:
    """Run what is missing, then write table and picture; 1 when a cell failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "faults")
    parser.add_argument("--only", default="", help="faults whose name holds this")
    parser.add_argument("--moment", default="", help="before, motion, contact or stopping")
    parser.add_argument("--setting", default="", help="plain, relayed, hosts or cell")
    parser.add_argument("--jobs", type=int, default=1, help="whole cells at once (root)")
    parser.add_argument("--again", action="store_true", help="also those that have a result")
    parser.add_argument("--list", action="store_true", help="only list the cells")
    options = parser.parse_args()
    cells, results = table(options.only, options.moment, options.setting), options.out / "cells"
    if options.list:
        print("\n".join(f"{setting:8} {fault} @ {moment}" for setting, fault, moment in cells))
        return 0
    results.mkdir(parents=True, exist_ok=True)
    if options.again:
        for _, fault, moment in cells:
            (results / f"{fault}@{moment}.json").unlink(missing_ok=True)
    if options.jobs > 1 and os.geteuid() != 0:
        parser.error("--jobs above 1 needs root: whole cells side by side need networks of their own")
    with ThreadPoolExecutor(max(1, options.jobs)) as pool:
        for setting in dict.fromkeys(setting for setting, _, _ in cells):
            mine = [f"{fault}@{moment}" for s, fault, moment in cells if s == setting]
            groups = [[name] for name in mine] if setting == "cell" else [mine]
            list(pool.map(lambda names: _finish(options.out, names), groups))
    draw(results, options.out / "faults.png")
    print(write_page(results, options.out / "faults.md"))
    return 0 if all('"passed": true' in path.read_text() for path in results.glob("*.json")) else 1


def _finish(out: Path, names: Sequence[str]) -> None:
    """Sessions until each cell has a result; one that ends two of them without any has failed."""
    results, tried = out / "cells", dict.fromkeys(names, 0)
    while missing := [name for name in names if not (results / f"{name}.json").exists()]:
        tried[missing[0]] += 1
        run_session(out, missing)
        if tried[missing[0]] > 1 and not (results / f"{missing[0]}.json").exists():
            _note_no_result(missing[0], results)


def _note_no_result(name: str, results: Path) -> None:
    fault, moment = name.split("@")
    trial = Trial(fault, moment, "", results / "none", str)
    trial.check("the bench came to a result", False, "two sessions ended without one")
    trial.save(results, commit())


if __name__ == "__main__":
    sys.exit(main())
