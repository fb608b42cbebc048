"""`python -m tests.faults.session OUT FOLDER COMMIT FAULT@MOMENT...`: some cells of the table, in one graph.

One graph serves them all as long as it works. The session ends when it does not: the bench starts another for
what is left. Each result is a file from the moment it is known.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from tests.faults.arms_faults import FAULTS, RELAYED, run
from tests.faults.arms_graph import ArmsGraph, Late
from tests.faults.cell_faults import CELL_FAULTS, run_cell_fault


def main() -> int:
    """Try the cells that were named."""
    out, folder, commit = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
    wanted = [name.split("@") for name in sys.argv[4:]]
    arms, cells = {f.name: f for f in FAULTS}, {f.name: f for f in CELL_FAULTS}
    if wanted[0][0] in cells:
        for name, moment in wanted:
            (folder / name).mkdir()
            run_cell_fault(cells[name], moment, folder / name).save(out / "cells", commit)
        return 0
    from samrl_ros.hosting.host import start_ros, stop_ros

    setting = arms[wanted[0][0]].setting
    if setting == "hosts":
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SUBNET"
    start_ros([])
    graph = ArmsGraph(folder, setting, RELAYED)
    try:
        graph.start()
        for name, moment in wanted:
            print(f"{name} @ {moment}", flush=True)
            trial = run(graph, arms[name], moment)
            trial.save(out / "cells", commit)
            bad = [check for check in trial.checks if not check.ok]
            print("  passed" if trial.passed else f"  FAILED: {bad}", flush=True)
            if bad:
                break  # whether it can still be used is not known
    except Late as late:
        print(f"the graph did not start: {late}", flush=True)
    finally:
        graph.stop()
        stop_ros()
    return 0


if __name__ == "__main__":
    sys.exit(main())
