"""Signals while a command works: an exception where it can be caught, and one exit code."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, NoReturn

from samrl_ros.contract.exit_codes import INTERRUPTED
from samrl_ros.contract.quiet_end import SIGNALS, is_ignored, leave_quietly, let_go_of_terminal

AGAIN_S = 0.02  # after which an interrupt is raised anew that was lost where Python cannot raise


@dataclass
class Heard:
    """Whether a signal has come."""

    any: bool = False


@contextmanager
def as_keyboard_interrupts() -> Generator[Heard]:
    """Within the block signals raise KeyboardInterrupt; afterwards they do what they did before."""
    heard = Heard()
    timers: list[threading.Timer] = []

    def interrupt(number: int, frame: object) -> None:
        let_go_of_terminal(number)
        heard.any = True
        raise KeyboardInterrupt

    def hear_again(unraisable: Any) -> None:
        """Raised in a destructor or a callback from C it would be printed and lost."""
        if unraisable.exc_type is not KeyboardInterrupt:
            sys.__unraisablehook__(unraisable)
            return
        timers.append(threading.Timer(AGAIN_S, os.kill, (os.getpid(), signal.SIGINT)))
        timers[-1].daemon = True
        timers[-1].start()

    hook, sys.unraisablehook = sys.unraisablehook, hear_again
    try:
        with handled(interrupt):
            yield heard
    finally:
        sys.unraisablehook = hook
        for timer in timers:
            timer.cancel()


@contextmanager
def held_back() -> Generator[Heard]:
    """Within the block signals are noted and do nothing else: files that belong together are all written.

    For what takes no time; whoever uses it asks afterwards whether one was heard.
    """
    heard = Heard()

    def note(number: int, frame: object) -> None:
        let_go_of_terminal(number)
        heard.any = True

    with handled(note):
        yield heard


@contextmanager
def handled(handler: Callable[[int, Any], object]) -> Generator[None]:
    """Within the block a handler gets the signals; afterwards they do what they did before."""
    before = {number: signal.signal(number, handler) for number in SIGNALS if not is_ignored(number)}
    try:
        yield
    finally:
        for number, previous in before.items():
            signal.signal(number, previous)


def leave(code: int) -> NoReturn:
    """End this process with a code that no signal changes any more.

    Python's own end is left out after an interrupt: if that came inside an `exec` (dataclasses use it),
    CPython kills itself at the very end. And with a thread that hangs in a library, where that end may crash.
    """
    leave_quietly(code)
    if code == INTERRUPTED or any(thread.daemon for thread in threading.enumerate()):
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                stream.flush()
        os._exit(code)
    sys.exit(code)
