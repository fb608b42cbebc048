"""The residual's training as a child process of its node."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

from samrl_core.common.child_process import ends_with_parent
from samrl_core.common.errors import SolveError
from samrl_core.common.files import room_for

STOP_S = 6.0  # to finish an update and save; less than a node may take to stop


class TrainingProcess:
    """One running worker; its output goes to `trainer.log` in its folder."""

    def __init__(self, folder: Path, task: str, cell: str, weights: str = "") -> None:
        """`weights`: folder of the task's trained networks, empty for those of the package."""
        self._log = folder / "trainer.log"
        command = [
            sys.executable,
            "-m",
            "samrl_core.learning.residual.worker",
            str(folder),
            "--task",
            task,
            "--cell",
            cell,
        ]
        command += ["--weights", weights] if weights else []
        with room_for(self._log), self._log.open("ab") as log:
            self._child = subprocess.Popen(
                [*command, "--parent", str(os.getpid())],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # a terminal's Ctrl-C reaches its node alone, which stops it
                preexec_fn=ends_with_parent(signal.SIGTERM),  # it saves first
            )

    def check(self) -> None:
        """Does nothing while it runs.

        Raises:
            SolveError: it has ended by itself.
        """
        code = self._child.poll()
        if code is None:
            return
        how = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
        lines = self._log.read_text(errors="replace").strip().splitlines()
        last = f": {lines[-1]}" if lines else ""
        raise SolveError(f"the training of the residual {how}{last}; its log: {self._log}")

    def stop(self) -> bool:
        """End it, its state saved; False when it had to be killed and goes on from its last version."""
        if self._child.poll() is None:
            self._child.terminate()
            try:
                self._child.wait(STOP_S)
            except subprocess.TimeoutExpired:
                self._child.kill()
                self._child.wait()
                return False
        return True
