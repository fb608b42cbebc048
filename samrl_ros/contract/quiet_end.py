"""How an executable ends on a signal while it starts, and when it is done: with a code and in silence.

Imports nothing that takes time: an executable calls `leave_quietly` before anything else, so that Ctrl-C in
the first second shows no traceback.
"""

import os
import signal

from samrl_ros.contract.exit_codes import INTERRUPTED

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)  # Ctrl-C, a launcher, a closed terminal


def leave_quietly(code: int = INTERRUPTED) -> None:
    """Let signals end this process at once with a code: there is nothing to save, or all is saved.

    An exception would not do: raised inside an import it comes out as another one, or is lost.
    """

    def end(number: int, frame: object) -> None:
        let_go_of_terminal(number)
        os._exit(code)

    for number in SIGNALS:
        if not is_ignored(number):
            signal.signal(number, end)


def is_ignored(number: int) -> bool:
    """SIGHUP under nohup(1). A shell's background job ignores SIGINT, but a launcher stops nodes with it."""
    return number == signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN


def let_go_of_terminal(number: int) -> None:
    """After SIGHUP the terminal is gone: what is printed goes nowhere, and does not fail."""
    if number != signal.SIGHUP:
        return
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        if os.isatty(stream) or not _takes_output(stream):
            os.dup2(nowhere, stream)
    os.close(nowhere)


def _takes_output(stream: int) -> bool:
    """False for a terminal that has hung up: it is no terminal any more, and refuses."""
    try:
        os.write(stream, b"")
    except OSError:
        return stream == 0
    return True
