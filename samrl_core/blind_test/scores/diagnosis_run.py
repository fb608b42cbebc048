"""One diagnosis in a process of its own that cannot open the labels."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from samrl_core.blind_test.scores.study import SETS, Study, move_folder
from samrl_core.common.child_process import ends_with_parent
from samrl_core.common.files import write_whole

STAGE, LEFT_OUT_STAGE = "diagnosis", "left_out"
INTERRUPTED = (130, -signal.SIGINT, -signal.SIGTERM)  # somebody stopped it: no result, neither good nor bad
MAPPING = "mapping.yaml"  # beside logs that are no bags yet
KEPT_OUTPUT = 4000  # characters of the process' last words that are stored


@dataclass(frozen=True)
class DiagnosisJob:
    """What to diagnose; picklable, for processes and clusters."""

    root: Path
    world: str
    stage: str = STAGE
    library: tuple[str, ...] | None = None  # families that may be used; None: all
    command: tuple[str, ...] = (sys.executable, "-m", "samrl_ros.cli.main", "diagnose")
    importer: tuple[str, ...] = (
        sys.executable,
        "-m",
        "samrl_ros.cli.main",
        "bag",
        "import",
    )  # of users' logs
    timeout_s: float = 1200.0
    threads: int = 1
    seed: int = 0
    commit: str | None = None  # of the code that diagnoses, for the record
    parts: tuple[str, ...] = SETS  # bags of the world, the last one held out
    arguments: tuple[str, ...] = ()  # what the command needs to know of the kind of recording

    @property
    def finished(self) -> bool:
        """Whether there is a result, a crash included."""
        return self._run_file.exists()

    @property
    def crashed(self) -> bool:
        """Whether there is a result, and it is no diagnosis."""
        return self.finished and json.loads(self._run_file.read_text())["exit_code"] != 0

    @property
    def _run_file(self) -> Path:
        return Study(self.root).run_folder(self.stage, self.world) / "run.json"


def diagnose_world(job: DiagnosisJob) -> dict[str, Any]:
    """Copy the recordings away, run the command there, and store report, re-simulation, exit code and times.

    Logs that come with a mapping are imported there first, as their user would; a refusal ends it.

    Raises:
        InterruptedError: it was stopped from outside; nothing is stored.

    Where the kernel allows it, the process has a mount namespace in which the study's folder is empty;
    else only the copied bags and no path to the study are handed to it. run.json says which it was.
    """
    study = Study(job.root.resolve())
    with tempfile.TemporaryDirectory(prefix="samrl_blind_") as name:
        place = Path(name)
        observed = study.observations(job.world)
        foreign = (observed / MAPPING).exists()
        for file in observed.iterdir() if foreign else (observed / f"{part}.mcap" for part in job.parts):
            shutil.copyfile(file, place / file.name)
        *fitted, held_out = (f"{part}.mcap" for part in job.parts)
        command = [*job.command, *fitted, "--held-out", held_out, *job.arguments]
        command += ["--out", "out", "--seed", str(job.seed)]
        if job.library is not None:
            write_whole(place / "library.yaml", yaml.safe_dump({"families": list(job.library)}))
            command += ["--library", "library.yaml"]
        hidden = can_hide()
        began = time.monotonic()
        code, output = 0, ""
        if foreign:  # the user's own first step; what it refuses is not diagnosed
            first = [*job.importer, MAPPING, "--out", "."]
            code, output = _run(_hiding(study.root, first) if hidden else first, place, job)
        if code == 0:
            code, more = _run(_hiding(study.root, command) if hidden else command, place, job)
            output += more
        if code in INTERRUPTED:
            raise InterruptedError(f"the diagnosis of {job.world} was stopped; it is done anew next time")
        run = {
            "world": job.world,
            "stage": job.stage,
            "exit_code": code,
            "seconds": time.monotonic() - began,
            "threads": job.threads,
            "commit": job.commit,
            "isolation": "mount namespace" if hidden else "copied recordings",
            "library": job.library,
            "output": output[-KEPT_OUTPUT:],
        }
        made = study.root / job.stage / f".{job.world}.{os.getpid()}"
        shutil.rmtree(made, ignore_errors=True)
        made.mkdir(parents=True)
        for file in ("report.json", "resimulation.npz"):
            if (place / "out" / file).exists():
                shutil.copyfile(place / "out" / file, made / file)
        write_whole(made / "run.json", json.dumps(run, indent=1) + "\n")
        move_folder(made, study.run_folder(job.stage, job.world))
    return run


def _run(command: list[str], place: Path, job: DiagnosisJob) -> tuple[int, str]:
    threads = {
        name: str(job.threads) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    }
    package = Path(__file__).resolve().parents[3]
    path = os.pathsep.join(p for p in (str(package), os.environ.get("PYTHONPATH", "")) if p)
    environment = {**os.environ, **threads, "PYTHONPATH": path, "PWD": str(place)}
    process = subprocess.Popen(
        command,
        cwd=place,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        preexec_fn=ends_with_parent(),
    )
    try:
        output, _ = process.communicate(timeout=job.timeout_s)
    except subprocess.TimeoutExpired:
        process.kill()
        output, _ = process.communicate()
        return 124, f"{output}\nstopped after {job.timeout_s:g} s"
    return process.returncode, output


def _hiding(folder: Path, command: list[str]) -> list[str]:
    """The command in a user and mount namespace where an empty file system lies over the folder."""
    script = f"mount -t tmpfs -o size=1m none {shlex.quote(str(folder))} && exec {shlex.join(command)}"
    return ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", script]


@cache
def can_hide() -> bool:
    """Whether unprivileged mount namespaces work here."""
    if shutil.which("unshare") is None:
        return False
    with tempfile.TemporaryDirectory() as name:
        trial = subprocess.run(_hiding(Path(name), ["true"]), capture_output=True, check=False)
    return trial.returncode == 0
