"""What the nodes' processes compile while the cell starts, reported on the error stream."""

from __future__ import annotations

import sys
from pathlib import Path

from samrl_core.common.warp_runtime import COMPILING


class CompilationTeller:
    """Reads the nodes' logs as they grow; a process of its own writes there what it compiles."""

    def __init__(self, logs: Path) -> None:
        self._logs = logs
        self._read: dict[Path, int] = {}  # bytes, by log

    def report(self) -> None:
        """Print whole lines of compilation that are new, with the node's name."""
        for log in sorted(self._logs.glob("*.log")):
            with log.open("rb") as file:
                file.seek(self._read.get(log, 0))
                text = file.read()
            whole, end, _ = text.rpartition(b"\n")
            self._read[log] = self._read.get(log, 0) + len(whole) + len(end)
            for line in whole.decode(errors="replace").splitlines():
                if line.startswith(COMPILING):
                    print(f"{log.stem}: {line}", file=sys.stderr, flush=True)
