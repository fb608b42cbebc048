"""Memory, threads, handles and shared memory of a running cell, from outside."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil

from samrl_core.common.files import append_line

MIDDLEWARE = "/dev/shm/fastrtps_"
_MB = 2**20


class ProcessWatch:
    """Samples a process and all its children into a file, a line of JSON per process and time.

    `anonymous_MB` is what the process itself has allocated and touched: what a leak fills. The resident size
    holds besides it files that all processes share, and that the system takes back when it likes.
    """

    def __init__(self, pid: int, file: Path) -> None:
        self._root = psutil.Process(pid)
        self._file = file
        self._since = time.monotonic()
        self.shared: set[Path] = set()  # files of shared memory that one of them has or had mapped

    def sample(self) -> None:
        """Take one sample; a process that has just ended is left out."""
        lines = []
        try:
            family = [self._root, *self._root.children(recursive=True)]
        except psutil.NoSuchProcess:
            return
        now, mapped = time.monotonic() - self._since, set()
        for process in family:
            try:
                lines.append({"wall_s": round(now, 2), **self._figures(process)})
                mapped |= _mapped(process.pid)
            except (psutil.Error, OSError):
                continue
        self.shared |= mapped
        lines.append({"wall_s": round(now, 2), "process": "", "shared_MB": size_of(mapped) / _MB})
        append_line(self._file, "\n".join(map(json.dumps, lines)), outlives_power=False)

    def left_behind(self) -> list[Path]:
        """Files of shared memory that nobody uses any more; ask when all processes have ended.

        All cells of a computer share some.
        """
        used = set().union(*(_mapped(process.pid) for process in psutil.process_iter()))
        return sorted(path for path in self.shared - used if path.exists())

    def _figures(self, process: psutil.Process) -> dict[str, Any]:
        rollup = {}
        for line in Path(f"/proc/{process.pid}/smaps_rollup").read_text().splitlines()[1:]:
            name, _, value = line.partition(":")
            rollup[name] = int(value.split()[0]) / 1024
        with process.oneshot():
            times = process.cpu_times()
            return {
                "process": self._name(process),
                "pid": process.pid,
                "anonymous_MB": round(rollup["Anonymous"], 3),
                "resident_MB": round(rollup["Rss"], 3),
                "threads": process.num_threads(),
                "handles": process.num_fds(),
                "cpu_s": round(times.user + times.system, 2),
            }

    def _name(self, process: psutil.Process) -> str:
        """The names of its nodes; the process that was started is the cell."""
        if process.pid == self._root.pid:
            return "cell"
        line = process.cmdline()
        if "samrl_ros.ros2_run" not in line:
            return "other"
        nodes = line[line.index("samrl_ros.ros2_run") + 1 :]
        return "+".join(nodes[: nodes.index("--ros-args")] if "--ros-args" in nodes else nodes)


def read_samples(file: Path) -> Iterator[dict[str, Any]]:
    """What was sampled; the last line may be cut off by a kill."""
    for line in file.read_text().splitlines():
        try:
            yield json.loads(line)
        except ValueError:
            return


def size_of(files: set[Path]) -> int:
    """Memory that shared files take [bytes], not their length: they are sparse."""
    total = 0
    for path in files:
        try:
            total += 512 * path.stat().st_blocks
        except OSError:
            continue
    return total


def _mapped(pid: int) -> set[Path]:
    """The middleware's files; none of a process that has ended or is somebody else's."""
    try:
        text = Path(f"/proc/{pid}/maps").read_text()
    except OSError:
        return set()
    names = {line.split(None, 5)[5] for line in text.splitlines() if MIDDLEWARE in line}
    return {Path(name) for name in names if not name.endswith("(deleted)")}
