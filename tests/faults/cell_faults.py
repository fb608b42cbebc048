"""The table's faults of the whole cell: `samrl cell` with every node a process, two short episodes."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from samrl_core.common.errors import InputError
from samrl_ros.bags.reader import open_bag
from samrl_ros.bags.repair import repair
from samrl_ros.contract.exit_codes import FAILED, INPUT_REFUSED, INTERRUPTED, OK
from samrl_ros.hosting.host import start_ros, stop_ros
from tests.faults.arms_graph import MOVING, PATIENCE_S, Late
from tests.faults.ears import Ears
from tests.faults.processes import Processes, environment, marked
from tests.faults.trial import Trial
from tests.faults.watched_world import StateFile

EPISODES = 2
OPTIONS = (
    "--task",
    "peg_insertion",
    "--max-actions",
    "3",
    "--episodes",
    str(EPISODES),
    "--layout",
    "processes",
)
END_S = 400.0  # wall time for a run to come to its end after a fault, on a machine that is busy
SMALL_DISK = "size=32m"  # the run's reserve, and the first seconds


class Cell:
    """A run of `samrl cell`."""

    def __init__(self, folder: Path, options: Sequence[str] = OPTIONS) -> None:
        self.folder, self.run, self.out = folder, f"{folder.parent.name}-{folder.name}", folder / "out"
        self.steps = folder / "steps"
        self.processes = Processes(folder / "logs", self.run)
        self._options = options
        self.ears = Ears(thinks=False)

    def start(self, *arguments: str) -> None:
        """Start it and wait until its world runs."""
        command = [sys.executable, "-m", "samrl_ros.cli.main", "cell", *self._options, "--out", str(self.out)]
        self.processes.start("cell", [*command, *arguments], environment(self.run, self.steps))
        state = Path(f"{self.steps}.state")
        self.wait(lambda: state.exists() and state.stat().st_size, "the world")
        self.state = StateFile(state)

    def wait(self, condition: Callable[[], object], what: str, longest_s: float = PATIENCE_S) -> None:
        """Return once it holds. Raises Late, also when the cell has ended."""
        until = time.monotonic() + longest_s
        while not condition():
            if time.monotonic() > until or not self.processes.alive("cell"):
                raise Late(f"{what} did not come: {self.text()[-400:]}")
            time.sleep(0.005)

    def wait_for_moment(self, moment: str) -> None:
        """before: no action yet. motion: the tool arm moves. stopping: in motion, after Ctrl-C."""
        if moment == "before":
            self.wait(lambda: "update" in [p for _, p in self.ears.heard.phases], "the first update", END_S)
            return
        acts = lambda: "act" in [p for _, p in self.ears.heard.phases]  # noqa: E731
        self.wait(lambda: acts() and self.state.read()[1] > MOVING, "motion", END_S)
        if moment == "stopping":
            self.processes.children["cell"].send_signal(signal.SIGINT)

    def pid(self, node: str) -> int:
        """Process of a node."""
        for pid, words in marked(self.run).items():
            if "samrl_ros.ros2_run" in words and words[words.index("samrl_ros.ros2_run") + 1] == node:
                return pid
        raise Late(f"{node} has no process")

    def end(self) -> int:
        """Its exit code; -99 when it had to be killed."""
        try:
            return self.processes.children["cell"].wait(END_S)
        except subprocess.TimeoutExpired:
            return -99

    def text(self) -> str:
        """What it has said, and its nodes."""
        logs = [path.read_text(errors="replace") for path in sorted((self.out / "logs").glob("*.log"))]
        return "\n".join([self.processes.text("cell"), *logs])

    def close(self) -> None:
        """End what is left."""
        self.processes.end()
        self.ears.close()


@dataclass(frozen=True)
class CellFault:
    """A row of the table."""

    name: str
    moments: tuple[str, ...]
    promise: str
    harm: Callable[[Cell], None]
    codes: tuple[int, ...]  # allowed ends
    told: str = ""  # what must be said when the run does not end as it would have
    bag: str = "whole"  # whole, repairable or any
    disk: str = ""  # size of the file system for --out, empty for the bench's own
    options: tuple[str, ...] = OPTIONS

    @property
    def setting(self) -> str:
        """As of the other faults."""
        return "cell"


def _kill(node: str) -> Callable[[Cell], None]:
    return lambda cell: os.kill(cell.pid(node), signal.SIGKILL)


def _pause(node: str, seconds: float) -> Callable[[Cell], None]:
    def harm(cell: Cell) -> None:
        pid = cell.pid(node)
        os.kill(pid, signal.SIGSTOP)
        time.sleep(seconds)
        os.kill(pid, signal.SIGCONT)

    return harm


def _kill_all(cell: Cell) -> None:
    cell.processes.children["cell"].kill()


def _fill_disk(cell: Cell) -> None:
    with contextlib.suppress(OSError), (cell.out / "ballast").open("wb", buffering=0) as ballast:
        while True:
            ballast.write(bytes(1 << 16))
    cell.wait(
        lambda: "space" in cell.text().lower() or "full" in cell.text().lower(), "word of the disk", END_S
    )


def _second_cell(cell: Cell) -> None:
    command = [sys.executable, "-m", "samrl_ros.cli.main", "cell", "--out", str(cell.folder / "second")]
    second = subprocess.run(command, env=environment(cell.run), capture_output=True, text=True, timeout=END_S)
    if second.returncode != INPUT_REFUSED or "another cell" not in second.stderr + second.stdout:
        raise Late(f"the second cell was not refused: {second.returncode} {second.stderr[-300:]}")


def _estop_and_reset(cell: Cell) -> None:
    called = cell.ears.trigger("estop")
    cell.wait(lambda: called() is not None, "the emergency stop")
    cell.wait(lambda: cell.state.read()[1] < 1e-6, "rest")
    time.sleep(2.0)
    for _ in range(50):
        answer = cell.ears.trigger("estop_reset")
        cell.wait(lambda answer=answer: answer() is not None, "an answer to the reset")
        if answer().success:
            return
        time.sleep(0.2)
    raise Late("the emergency stop could not be reset")


RESTARTABLE = ("model_updater", "view_planner", "policy", "residual_trainer")
NEEDED = ("sim_bridge", "manipulator", "supervisor", "recorder")
GONE = "(killed|gone|died|ended|restart|starts? again|started)"

CELL_FAULTS: list[CellFault] = [
    *(
        CellFault(
            f"cell_{node}_killed",
            ("before", "motion") if node in ("model_updater", "policy") else ("motion",),
            "It is started anew and told; the episode goes on or is given up, the next one is run",
            _kill(node),
            (OK, FAILED),
            f"{node}.*{GONE}",
        )
        for node in RESTARTABLE
    ),
    *(
        CellFault(
            f"cell_{node}_killed",
            ("motion", "stopping") if node == "sim_bridge" else ("motion",),
            "It is not replaced in motion: the arms stop and the run ends, told by the node's name",
            _kill(node),
            (FAILED,),
            f"{node}.*{GONE}",
            "repairable" if node == "recorder" else "whole",
        )
        for node in NEEDED
    ),
    *(
        CellFault(
            f"cell_{node}_paused_3s",
            ("motion", "stopping") if node == "model_updater" else ("motion",),
            "3 s without it are no fault: the run goes on; an episode that it costs is given up and told",
            _pause(node, 3.0),
            (OK, FAILED),
        )
        for node in ("sim_bridge", "model_updater", "policy", "manipulator", "supervisor")
    ),
    *(
        CellFault(
            f"cell_{node}_paused_30s",
            ("motion",),
            "30 s held by a signal are no death: it goes on; an episode that it costs is given up and told",
            _pause(node, 30.0),
            (OK, FAILED),
        )
        for node in ("sim_bridge", "model_updater")
    ),
    CellFault(
        "cell_parent_killed",
        ("motion",),
        "All nodes end by themselves and the bag is whole",
        _kill_all,
        (-9,),
    ),
    CellFault(
        "cell_disk_full",
        ("before",),
        "The run ends, says that the disk is full, and the bag can be repaired",
        _fill_disk,
        (FAILED,),
        "(disk|space)",
        "repairable",
        SMALL_DISK,
    ),
    CellFault(
        "cell_second_cell", ("motion",), "The second is refused, the first goes on", _second_cell, (OK,)
    ),
    CellFault(
        "cell_estop_and_reset",
        ("motion",),
        "The arms brake and stand; after the reset the run goes on",
        _estop_and_reset,
        (OK,),
    ),
]


def run_cell_fault(fault: CellFault, moment: str, folder: Path) -> Trial:
    """Run the cell, do it harm at the moment, see it end."""
    start_ros([])
    if fault.disk:
        (folder / "out").mkdir()
        subprocess.run(["mount", "-t", "tmpfs", "-o", fault.disk, "tmpfs", str(folder / "out")], check=True)
    cell = Cell(folder, fault.options)
    trial = Trial(fault.name, moment, fault.promise, cell.steps, cell.text)
    try:
        cell.start()
        cell.wait_for_moment(moment)
        trial.harmed = time.monotonic()
        fault.harm(cell)
    except Late as late:
        trial.check("the fault could be brought about", False, str(late)[-600:])
    code = cell.end()
    took = time.monotonic() - trial.harmed
    stopping = moment == "stopping"
    allowed = (
        (INTERRUPTED, FAILED)
        if stopping and FAILED in fault.codes
        else (INTERRUPTED,)
        if stopping
        else fault.codes
    )
    trial.check(f"exit code {' or '.join(map(str, allowed))}", code in allowed, f"{code} after {took:.0f} s")
    _check_outcome(trial, fault, cell, code)
    deadline = time.monotonic() + 30
    while marked(cell.run) and time.monotonic() < deadline:
        time.sleep(0.1)
    left = [" ".join(words)[:100] for words in marked(cell.run).values()]
    trial.check("no process is left", not left, "; ".join(left) or "none")
    cell.close()
    _check_bag(trial, fault, cell)
    trial.check_limits()
    trial.check_no_traceback()
    stop_ros()
    return trial


def _check_outcome(trial: Trial, fault: CellFault, cell: Cell, code: int) -> None:
    """A run that ends with 0 has given every episode an outcome; any other says why, also in its summary."""
    path = cell.out / "summary.json"
    if code == -9:
        return
    if not path.exists():
        trial.check(
            "a summary is written", bool(fault.disk), "none; the disk is full" if fault.disk else "none"
        )
        summary = {"episodes": [], "error": ""}
    else:
        summary = json.loads(path.read_text())
    reasons = [f"{e['episode']}: {e['reason']}" for e in summary["episodes"]]
    lost = bool(summary.get("given_up"))
    if code == OK or lost or (fault.codes == (OK, FAILED) and code != INTERRUPTED):
        trial.check("every episode has an outcome", len(reasons) == EPISODES, "; ".join(reasons)[:400])
        acted = any(e["actions"] for e in summary["episodes"])
        trial.check("it acted", acted, f"{[e['actions'] for e in summary['episodes']]} actions")
    if code != OK and path.exists():
        why = summary["error"] or (f"{summary['given_up']} given up" if lost else "")
        trial.check("the summary says why", why, why[:300] or "nothing")
    if fault.told and trial.moment != "stopping":
        trial.check_told(fault.told, "its output", cell.processes.text("cell"))


def _check_bag(trial: Trial, fault: CellFault, cell: Cell) -> None:
    bag = cell.out / "bag"
    try:
        whole = open_bag(bag)
        sound = not whole.truncated and whole.has_metadata
        if not sound and fault.bag == "repairable":
            repair(bag, cell.folder / "repaired")
            whole = open_bag(cell.folder / "repaired")
            sound = not whole.truncated
        count = sum(topic.count for topic in whole.topics)
        trial.check(f"the bag is {fault.bag}", sound, f"{count} messages")
    except InputError as error:
        trial.check(f"the bag is {fault.bag}", False, str(error)[:200])
