"""xacro to URDF, by the xacro package of ROS itself, in a process of its own: an expression may never end.

`$(find PACKAGE)` is asked of ROS where there is one; otherwise a folder of that name with a package.xml is
looked for beside the file and above it, where a checkout has it.
"""

from __future__ import annotations

import json
import re
import resource
import signal
import subprocess
import sys
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.parsers.expat import ExpatError

import xacro
from xacro import substitution_args

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file, is_folder

LONGEST_S = 20  # [s] of CPU; files of whole humanoids take one
_MOST_BYTES = 4 * 2**30  # of memory
_REFUSED = 3  # exit code of a file that cannot be expanded: standard output holds the reason
_UPWARDS = 6  # folders above the file in which packages are looked for
# What macros, properties and their expressions raise besides xacro's own.
_UNREADABLE = (
    xacro.XacroException,
    substitution_args.SubstitutionException,
    substitution_args.ArgException,
    ExpatError,
    ArithmeticError,
    AttributeError,
    ImportError,
    LookupError,
    MemoryError,
    NameError,
    OSError,
    RuntimeError,  # RecursionError is one
    SyntaxError,
    TypeError,
    ValueError,
)


def expand(path: Path, arguments: Mapping[str, str], longest_s: int = LONGEST_S) -> str:
    """The URDF that a xacro file makes with these arguments, within so much time of a core [s].

    Raises:
        InputError: naming the file in which expansion stopped, what it was about, and what to do.
    """
    command = [sys.executable, "-m", "samrl_core.diagnosis.nominal_model.from_xacro", str(path)]
    command += [json.dumps(dict(arguments)), str(longest_s)]
    run = subprocess.run(command, stdout=subprocess.PIPE, check=False)
    said = run.stdout.decode(errors="replace")
    if run.returncode == _REFUSED:
        raise InputError(said)
    if run.returncode == -signal.SIGXCPU:
        raise InputError(
            f"{path}: xacro has not expanded it within {longest_s} s; look for an expression as large as "
            "9**99999999 or a macro that calls itself, or give the expanded URDF"
        )
    if run.returncode:
        raise InputError(f"{path}: xacro died ({run.returncode}); give the expanded URDF")
    return said


def _expanded(path: Path, arguments: Mapping[str, str]) -> str:
    try:
        with _packages_beside(path):
            document: Any = xacro.process_file(str(path), mappings=dict(arguments))
            return document.toprettyxml(indent="  ")
    except _UNREADABLE as error:
        raise InputError(_explained(path, error)) from error


def _explained(path: Path, error: BaseException) -> str:
    stack = [str(file) for file in xacro.filestack or () if file]
    where = stack[-1] if stack else str(path)
    about = " ".join(str(error).split()) or type(error).__name__
    macros = [str(m.body.getAttribute("name")) for m in xacro.macrostack or ()]
    inside = f" in macro {macros[-1]}" if macros else ""
    remedy = "mend the file, or expand it with the `xacro` command and give the URDF"
    if isinstance(error, substitution_args.ArgException) or "Undefined substitution argument" in about:
        remedy = "give its value by --xacro-arg NAME:=VALUE"
    elif "package" in about or isinstance(error, LookupError | ImportError):
        remedy = "put the package's folder beside the file's own, source ROS, or give the expanded URDF"
    return f"{where}{inside}: xacro cannot be expanded: {about}; {remedy}"


@contextmanager
def _packages_beside(path: Path) -> Generator[None]:
    """Packages are found without ROS, too; xacro has no argument for that, only this function."""
    asked = substitution_args._eval_find

    def find(package: str) -> str:
        for folder in list(path.resolve().parents)[:_UPWARDS]:
            for place in (folder, folder / package):
                if place.name == package and is_folder(place) and _names(place / "package.xml", package):
                    return str(place)
        try:
            return str(asked(package))
        except (ImportError, LookupError, OSError) as error:  # OSError: no ROS is sourced
            raise LookupError(f"package {package!r} is not found") from error

    substitution_args._eval_find = find  # ty: ignore[invalid-assignment]
    try:
        yield
    finally:
        substitution_args._eval_find = asked


def _names(file: Path, package: str) -> bool:
    if not is_file(file):
        return False
    return (
        re.search(rf"<name>\s*{re.escape(package)}\s*</name>", file.read_text(errors="replace")) is not None
    )


def main() -> int:
    """Expand here: a path, a JSON object of arguments and a limit [s] in, URDF or the reason out."""
    longest_s = int(sys.argv[3])
    resource.setrlimit(resource.RLIMIT_CPU, (longest_s, longest_s + 1))
    resource.setrlimit(resource.RLIMIT_AS, (_MOST_BYTES, _MOST_BYTES))
    try:
        text, code = _expanded(Path(sys.argv[1]), json.loads(sys.argv[2])), 0
    except InputError as error:
        text, code = str(error), _REFUSED
    sys.stdout.buffer.write(text.encode(errors="replace"))
    return code


if __name__ == "__main__":
    sys.exit(main())
