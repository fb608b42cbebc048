"""`samrl`: the command line. Every refusal becomes one clear line, every end an exit code.

Nothing heavy is imported before signals are in hand: an interrupt in the first second shows no traceback.
"""

import errno
import sys

from samrl_ros.contract.exit_codes import FAILED, INPUT_REFUSED, INTERRUPTED, OK
from samrl_ros.contract.quiet_end import leave_quietly

# Of paths that the system refuses, wherever a command touches them first.
_OF_PATHS = (
    *(errno.ENAMETOOLONG, errno.ELOOP, errno.ENOTDIR, errno.EISDIR, errno.EACCES, errno.EPERM, errno.EROFS),
    *(errno.ENOENT, errno.ENXIO, errno.EEXIST),
)


def run(arguments: list[str]) -> int:
    """Run a command line; every refusal becomes one clear line and an exit code.

    What follows `--ros-args` goes to the nodes unread, as with any ROS 2 executable.
    """
    from pathlib import Path

    from samrl_core.common.errors import InputError, SamrlError
    from samrl_core.common.files import NO_ROOM, no_room
    from samrl_ros.cli.commands import app
    from samrl_ros.contract.interrupts import as_keyboard_interrupts

    cut = arguments.index("--ros-args") if "--ros-args" in arguments else len(arguments)
    with as_keyboard_interrupts() as heard:
        try:
            app(args=arguments[:cut], obj=tuple(arguments[cut + 1 :]), prog_name="samrl")
        except SystemExit as end:
            return end.code if isinstance(end.code, int) else int(bool(end.code))
        except KeyboardInterrupt:
            return INTERRUPTED
        except Exception as error:
            if heard.any:  # libraries turn an interrupt into errors of their own
                return INTERRUPTED
            if isinstance(error, InputError):
                return _say("refused", str(error), INPUT_REFUSED)
            if isinstance(error, SamrlError):
                return _say("error", str(error), FAILED)
            if isinstance(error, OSError) and error.errno in _OF_PATHS and error.filename:
                shown = f"{str(error.filename)[:200]}: {error.strerror}; check the path"
                return _say("refused", shown, INPUT_REFUSED)
            if isinstance(error, OSError) and error.errno in NO_ROOM:
                return _say("refused", no_room(Path(error.filename or "."), error), INPUT_REFUSED)
            raise
    return OK


def _say(what: str, text: str, code: int) -> int:
    from rich.console import Console
    from rich.markup import escape

    Console(stderr=True).print(f"[bold red]{what}:[/] {escape(text)}", highlight=False, soft_wrap=True)
    return code


def main() -> None:
    """Entry point of the console script."""
    leave_quietly()
    from samrl_ros.contract.full_output import FullOutput
    from samrl_ros.contract.interrupts import leave

    output = FullOutput()
    code = run(sys.argv[1:])
    if why := output.lost():
        text = f"standard output: {why}; what was printed is lost, files were written. Print to another place"
        code = max(code, _say("error", text, FAILED))
    leave(code)


if __name__ == "__main__":
    main()
