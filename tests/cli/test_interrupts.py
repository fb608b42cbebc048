"""Ctrl-C, SIGTERM and SIGHUP end every command with 130 and without a traceback, from its first moment on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from samrl_core.common import executor
from samrl_ros.cli import commands, main
from samrl_ros.contract import interrupts

pytestmark = pytest.mark.usefixtures("hangup")

# Sends a signal to itself when a module is about to be imported: the middle of a start, without a clock.
INTERRUPTED_START = """
import os, sys

class Interrupter:
    def find_spec(self, name, path=None, target=None):
        if name == {at!r}:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), {number})

sys.meta_path.insert(0, Interrupter())
sys.argv = ["samrl", *{arguments!r}]
from {module} import main
main()
"""
CLI, NODE = "samrl_ros.cli.main", "samrl_ros.ros2_run"
QUIET_IMPORTS = {"typing", "dataclasses", "threading", "typer", "rclpy", "numpy"}


def python(program: str, **surroundings: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, **surroundings}
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment)


@pytest.mark.parametrize(
    ("module", "arguments", "at"),
    [
        (CLI, ["effects"], "typer"),
        (CLI, ["effects"], "numpy"),
        (CLI, ["effects"], "samrl_core.diagnosis.effects"),
        (CLI, ["cell"], "samrl_ros.cell.run"),
        (CLI, ["train", "peg_insertion"], "torch"),
        (CLI, ["forge", "--out", "none"], "samrl_ros.blind_test.study"),
        (CLI, ["bag", "info", "none"], "samrl_ros.cli.bag"),
        (NODE, ["policy"], "samrl_ros.nodes.registry"),
        pytest.param(NODE, ["policy"], "rclpy.node", marks=pytest.mark.ros),
        pytest.param(NODE, ["recorder"], "samrl_ros.hosting.host", marks=pytest.mark.ros),
        pytest.param(NODE, ["cell"], "samrl_ros.cell.run", marks=pytest.mark.ros),
    ],
)
def test_an_interrupt_during_the_start_is_silent(module: str, arguments: list[str], at: str) -> None:
    done = python(INTERRUPTED_START.format(module=module, arguments=arguments, at=at, number=signal.SIGINT))
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize(("module", "at"), [(CLI, "typer"), (NODE, "samrl_ros.nodes.registry")])
def test_so_are_the_other_signals(number: signal.Signals, module: str, at: str) -> None:
    done = python(INTERRUPTED_START.format(module=module, arguments=["policy"], at=at, number=int(number)))
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


@pytest.mark.parametrize("module", [CLI, NODE])
def test_signals_are_in_hand_before_anything_heavy_is_imported(module: str) -> None:
    looked = python(f"import sys, {module}; print(*sorted({QUIET_IMPORTS!r} & set(sys.modules)))")
    before = python(f"import sys; print(*sorted({QUIET_IMPORTS!r} & set(sys.modules)))")
    assert looked.stdout == before.stdout and looked.returncode == 0, looked.stderr


LOST = """
import os, signal, sys
from samrl_ros.contract.interrupts import as_keyboard_interrupts, leave

class Lost:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000): pass

try:
    with as_keyboard_interrupts():
        {how}
        signal.pause()
        print("not interrupted")
except KeyboardInterrupt:
    leave(130)
"""


@pytest.mark.parametrize(
    "how",
    [  # after the second CPython itself would end with -2
        "Lost()",  # raised in a destructor: Python would print and forget it
        'exec("os.kill(os.getpid(), signal.SIGINT)\\nfor _ in range(1000): pass")',
    ],
)
def test_an_interrupt_is_not_lost_where_python_cannot_raise(how: str) -> None:
    done = python(LOST.format(how=how))
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


def test_an_interrupt_that_a_library_turns_into_its_own_error_is_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails_after_a_signal(**_: Any) -> None:
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            signal.pause()
        except KeyboardInterrupt as error:
            raise ImportError("initialization failed") from error

    monkeypatch.setattr(commands, "app", fails_after_a_signal)
    assert main.run(["effects"]) == 130
    monkeypatch.setattr(commands, "app", lambda **_: 1 / 0)
    with pytest.raises(ZeroDivisionError):  # without a signal it is a fault, and is seen
        main.run(["effects"])
    assert capsys.readouterr().err == ""


def test_handlers_are_put_back() -> None:
    before = [signal.getsignal(n) for n in interrupts.SIGNALS]
    with interrupts.as_keyboard_interrupts() as heard:
        assert signal.getsignal(signal.SIGHUP) is not before[2]
    assert [signal.getsignal(n) for n in interrupts.SIGNALS] == before and not heard.any


def test_nohup_stays_in_force() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with interrupts.as_keyboard_interrupts() as heard:
            os.kill(os.getpid(), signal.SIGHUP)
        assert not heard.any
    finally:
        signal.signal(signal.SIGHUP, before)


CLOSED_TERMINAL = """
import os, pty, signal, sys
child, master = pty.fork()
if child == 0:
    from samrl_ros.contract.interrupts import as_keyboard_interrupts
    try:
        with as_keyboard_interrupts():
            os.write(1, b"ready")
            while True:
                signal.pause()
    except KeyboardInterrupt:
        print("to nobody", flush=True)
        os._exit(5)
os.read(master, 5)
os.close(master)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


def test_after_a_closed_terminal_printing_goes_nowhere_and_does_not_fail() -> None:
    assert python(CLOSED_TERMINAL).stdout == "5\n"


# --- worker processes ---


def _wait_for_ever(folder: str) -> None:
    half = Path(folder) / "half"
    half.touch()
    try:
        threading.Event().wait()
    finally:
        half.unlink()


INTERRUPTED_POOL = """
import os, signal, sys, threading, time
from pathlib import Path
from samrl_core.common.executor import run_in_processes
from tests.cli.test_interrupts import _wait_for_ever
from samrl_ros.contract.interrupts import as_keyboard_interrupts, leave

folder = Path(sys.argv[1])

def interrupt():
    while len(list(folder.glob("*/half"))) < 2:
        time.sleep(0.02)
    os.killpg(0, signal.SIGINT)  # as a terminal does

if __name__ == "__main__":
    threading.Thread(target=interrupt, daemon=True).start()
    try:
        with as_keyboard_interrupts():
            list(run_in_processes(_wait_for_ever, [str(folder / "a"), str(folder / "b")], 2))
    except KeyboardInterrupt:
        leave(130)
"""


def test_an_interrupt_ends_workers_in_silence_and_leaves_no_half_file(tmp_path: Path) -> None:
    for name in "ab":
        (tmp_path / name).mkdir()
    program = tmp_path / "program.py"
    program.write_text(INTERRUPTED_POOL)
    root = Path(__file__).resolve().parents[2]
    environment = {**os.environ, "PYTHONPATH": f"{root}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    command = [sys.executable, str(program), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, start_new_session=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")
    assert not list(tmp_path.glob("*/half"))


def test_threads_with_long_work_do_not_hold_an_interrupt_up() -> None:
    free = threading.Event()
    ends = executor.run_in_threads(lambda seconds: free.wait(seconds), [0.0, 600.0], 2)
    assert next(ends).error is None
    threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGTERM)).start()
    with pytest.raises(KeyboardInterrupt), interrupts.as_keyboard_interrupts():
        next(ends)
    free.set()


# --- the cell ---


@pytest.mark.ros
@pytest.mark.parametrize(("asked", "code"), [(True, 130), (False, 1)])
def test_a_node_that_needs_long_to_stop_does_not_hide_the_interrupt(
    asked: bool, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import json

    pytest.importorskip("rclpy")
    from samrl_ros.cell import run
    from samrl_ros.cell.monitor import Watch

    late = "view_planner did not stop within 15 s and was killed"

    def watched(options: Any, arguments: Any, stop: threading.Event, *_: Any) -> tuple[Watch, str, str]:
        if asked:
            stop.set()
        return Watch(), "", late

    monkeypatch.setattr(run, "_watch_run", watched)
    monkeypatch.setattr(run, "_refuse_taken_domain", lambda: None)
    with Console(file=(tmp_path / "said").open("w"), width=200) as screen:
        assert run.run_cell(run.CellOptions(out=tmp_path / "out"), screen) == code
        screen.file.flush()
    error = json.loads((tmp_path / "out" / "summary.json").read_text())["error"]
    assert late in error and error.startswith("interrupted") == asked
    assert late in (tmp_path / "said").read_text()
