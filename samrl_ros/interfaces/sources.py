"""Where the interface definitions are, what they depend on, and when a build of them is current."""

from __future__ import annotations

import hashlib
import importlib.metadata
import sys
import sysconfig
from dataclasses import dataclass
from pathlib import Path

from samrl_core.common.errors import InputError

HERE = Path(__file__).resolve().parent
KINDS = ("msg", "srv")


@dataclass(frozen=True)
class InterfacePackage:
    """One ROS package of definitions: its name, and its files below `folder` as `msg/Name.msg`."""

    name: str
    folder: Path
    files: tuple[Path, ...]  # relative to `folder`

    @property
    def type_names(self) -> tuple[str, ...]:
        """For example `samrl_msgs/msg/ModelState`."""
        return tuple(f"{self.name}/{file.parent}/{file.stem}" for file in self.files)


def definitions_folder() -> Path:
    """Folder with one sub-folder per package: inside an installed samrl, `msgs_docs` in a checkout."""
    installed, checkout = HERE / "definitions", HERE.parents[1] / "msgs_docs"
    for folder in (installed, checkout):
        if (folder / "samrl_msgs" / "msg").is_dir():
            return folder
    raise InputError(
        f"No interface definitions in {installed} or {checkout}. Reinstall samrl, or run from a checkout."
    )


def read_package(name: str, definitions: Path) -> InterfacePackage:
    """Collect the definitions of one package. Raises InputError when there are none."""
    folder = definitions / name
    files = tuple(
        sorted(file.relative_to(folder) for kind in KINDS for file in (folder / kind).glob(f"*.{kind}"))
    )
    if not files:
        raise InputError(f"{folder} has no msg/*.msg or srv/*.srv: there is nothing to build.")
    return InterfacePackage(name, folder, files)


def fingerprint(package: InterfacePackage) -> str:
    """SHA-256 over all that shapes the build: definitions, this code, the generators and the Python ABI."""
    digest = hashlib.sha256()
    for file in (*(package.folder / file for file in package.files), *sorted(HERE.glob("*.py"))):
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    generators = sorted(
        f"{distribution.name}=={distribution.version}"
        for distribution in importlib.metadata.distributions()
        if (distribution.name or "").startswith(("ros-rosidl", "ros-rmw", "ros-fastcdr"))
    )
    abi = f"{sys.version_info[:2]} {sysconfig.get_config_var('EXT_SUFFIX')}"
    digest.update("\n".join([*generators, abi]).encode())
    return digest.hexdigest()
