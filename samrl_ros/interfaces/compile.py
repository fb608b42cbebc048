"""From generated sources to three libraries and one Python extension, with gcc and g++."""

from __future__ import annotations

import os
import shutil
import subprocess
import sysconfig
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from samrl_core.common.errors import InputError
from samrl_ros.interfaces.generate import TYPESUPPORTS, Generated

RUNTIME = (
    "rosidl_runtime_c",
    "rosidl_typesupport_c",
    "rosidl_typesupport_fastrtps_c",
    "rosidl_typesupport_fastrtps_cpp",
    "rosidl_typesupport_introspection_c",
    "fastcdr",
    "rmw",
    "rcutils",
)


def require_compilers() -> None:
    """Raise InputError with the remedy when gcc, g++ or Python's headers are missing."""
    missing = [tool for tool in ("gcc", "g++") if shutil.which(tool) is None]
    if missing:
        raise InputError(
            f"Building the ROS interfaces needs {' and '.join(missing)}, not found on PATH. "
            "Install a compiler (Debian, Ubuntu: apt install build-essential) and run this again."
        )
    header = Path(sysconfig.get_path("include")) / "Python.h"
    if not header.is_file():
        raise InputError(
            f"Building the ROS interfaces needs {header}. Install Python's headers "
            "(Debian, Ubuntu: apt install python3-dev) and run this again."
        )


def build_binaries(generated: Generated, work: Path, prefix: Path) -> None:
    """Compile everything and link it into the Python package `generated.python`, then drop the C files."""
    sources = _sort_sources(generated)
    objects = _compile([file for group in sources.values() for file in group], generated, work, prefix)
    name, out = generated.package.name, generated.python
    base = f"{name}__rosidl_generator_c"
    # The wheels' libraries are three folders up from a package in site-packages; elsewhere by absolute path.
    link = _Linker(
        [f"-L{out}", f"-L{prefix / 'lib'}"],
        [f"-Wl,-rpath,$ORIGIN:$ORIGIN/../../..:{prefix / 'lib'}", "-Wl,--as-needed"],
        _libraries(generated, prefix),
    )
    link(out / f"lib{base}.so", [objects[file] for file in sources["generator"]], [])
    supports = []
    for support in TYPESUPPORTS:
        # rmw_fastrtps finds the libraries by exactly this name, and needs both of them
        supports.append(f"{name}__{support}")
        link(out / f"lib{name}__{support}.so", [objects[file] for file in sources[support]], [f"-l{base}"])
    extension = f"{name}_s__rosidl_typesupport_c{sysconfig.get_config_var('EXT_SUFFIX')}"
    kept = ["-Wl,--no-as-needed", f"-l{base}", *(f"-l{library}" for library in supports), "-Wl,--as-needed"]
    link(out / extension, [objects[file] for file in sources["extension"]], kept)
    for file in out.rglob("*.c"):
        file.unlink()


def _sort_sources(generated: Generated) -> dict[str, list[Path]]:
    """Which source goes into which binary."""
    fastrtps, introspection = TYPESUPPORTS
    groups: dict[str, list[Path]] = {"generator": [], fastrtps: [], introspection: [], "extension": []}
    groups[introspection] = sorted(generated.introspection.rglob("*.c"))
    groups["extension"] = sorted(generated.python.rglob("*.c"))
    for file in sorted((*generated.c.rglob("*.c"), *generated.c.rglob("*.cpp"))):
        if file.name.endswith("__type_support_c.cpp"):
            groups[fastrtps].append(file)
        elif file.name.endswith("__type_support.cpp"):  # picks a type support at run time
            groups["extension"].append(file)
        else:
            groups["generator"].append(file)
    return groups


def _compile(sources: Sequence[Path], generated: Generated, work: Path, prefix: Path) -> dict[Path, Path]:
    import numpy

    include = prefix / "include"
    folders = [generated.c.parent, generated.introspection.parent, generated.python.parent]
    folders += [Path(sysconfig.get_path("include")), Path(numpy.get_include()), include]
    folders += sorted(path for path in include.iterdir() if path.is_dir())
    flags = ["-O1", "-fPIC", "-w", *(f"-I{folder}" for folder in folders)]
    target = work / "objects"
    target.mkdir()

    def one(numbered: tuple[int, Path]) -> Path:
        number, source = numbered
        output = target / f"{number}_{source.stem}.o"
        compiler = ["g++", "-std=c++17"] if source.suffix == ".cpp" else ["gcc"]
        _run([*compiler, *flags, "-c", str(source), "-o", str(output)])
        return output

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return dict(zip(sources, pool.map(one, enumerate(sources)), strict=True))


def _libraries(generated: Generated, prefix: Path) -> list[str]:
    """Linker options for the dependencies that exist as libraries, and the run time."""
    suffixes = ("rosidl_generator_c", "rosidl_typesupport_c", *TYPESUPPORTS, "rosidl_generator_py")
    names = [f"{dependency}__{suffix}" for dependency in generated.dependencies for suffix in suffixes]
    present = [name for name in names if (prefix / "lib" / f"lib{name}.so").exists()]
    return [f"-l{name}" for name in (*present, *RUNTIME)]


class _Linker:
    """The options that all binaries of a package share."""

    def __init__(self, search: list[str], flags: list[str], libraries: list[str]) -> None:
        self._search, self._flags, self._libraries = search, flags, libraries

    def __call__(self, output: Path, objects: Sequence[Path], first: Sequence[str]) -> None:
        command = ["g++", "-shared", "-s", "-o", str(output), f"-Wl,-soname,{output.name}"]
        _run([*command, *map(str, objects), *self._search, *self._flags, *first, *self._libraries])


def _run(command: Sequence[str]) -> None:
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode:
        raise InputError(
            f"{' '.join(command[:3])} ... failed with {result.returncode}; is the compiler complete?\n"
            f"{result.stderr[-3000:]}"
        )
