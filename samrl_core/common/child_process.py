"""Child processes that end with their parent, also when SIGKILL leaves it no time to tell them."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Callable

_PR_SET_PDEATHSIG = 1  # prctl(2)
# Found before any fork: the child would wait for the loader's lock if another thread held it.
_prctl = ctypes.CDLL(None).prctl if sys.platform == "linux" else None


def ends_with_parent(number: int = signal.SIGKILL) -> Callable[[], None]:
    """A `preexec_fn`: the child gets this signal when the thread that started it ends.

    The signal has its default effect in the child: a shell's background job, whose children would ignore
    an interrupt, can so be stopped by one. Elsewhere than on Linux nothing asks for the signal.
    """
    parent = os.getpid()

    def prepare() -> None:
        if number != signal.SIGKILL:
            signal.signal(number, signal.SIG_DFL)
        end_with(parent, number)

    return prepare


def end_with(parent: int, number: int = signal.SIGKILL) -> None:
    """Ask in a child for this signal at its parent's end, and take it at once if that was before."""
    if _prctl is None:
        return
    _prctl(_PR_SET_PDEATHSIG, number)
    if os.getppid() != parent:
        os.kill(os.getpid(), number)
