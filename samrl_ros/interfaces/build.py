"""Build and install `samrl_msgs` (and `tf2_msgs`, which the wheels lack) into this Python environment.

Run as `python -m samrl_ros.interfaces.build` or `python msgs_docs/build_interfaces.py`. Nothing is done
when the installed build is current. With a system ROS 2, build `msgs_docs/samrl_msgs` with colcon instead.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import importlib.util
import json
import shutil
import sys
import sysconfig
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import filelock

from samrl_core.common.errors import InputError, SamrlError
from samrl_ros.interfaces.compile import build_binaries, require_compilers
from samrl_ros.interfaces.generate import Generated, generate
from samrl_ros.interfaces.sources import InterfacePackage, definitions_folder, fingerprint, read_package

PACKAGES = ("tf2_msgs", "samrl_msgs")
STAMP = "samrl_build.json"


@dataclass(frozen=True)
class Target:
    """Where a build goes: modules to site-packages, definitions and hashes to the ament prefix."""

    modules: Path
    share: Path

    def stamp(self, name: str) -> Path:
        """The file that marks a package as built by this code, with its fingerprint."""
        return self.share / name / STAMP


def this_environment() -> Target:
    """The running interpreter's own folders."""
    return Target(Path(sysconfig.get_path("platlib")), Path(sys.prefix) / "share")


def wheels_prefix() -> Path:
    """Folder with the ROS wheels' `share`, `include` and `lib`. Raises InputError when they are missing."""
    spec = importlib.util.find_spec("rosidl_adapter")
    if spec is None or spec.origin is None:
        raise InputError(
            "The ROS interface generators are not installed. Install them with pip install 'samrl[ros]' "
            "(after uv sync: uv sync --reinstall --extra ros)."
        )
    # .../lib/python3.x/site-packages/rosidl_adapter/__init__.py
    prefix = Path(spec.origin).parents[4]
    if not (prefix / "include" / "rosidl_runtime_c").is_dir() or not _has_wheels():
        raise InputError(
            f"rosidl_adapter comes from {prefix}, which is not an environment with the ROS wheels. "
            "With a system ROS 2, build the interfaces with colcon: "
            "colcon build --base-paths msgs_docs/samrl_msgs"
        )
    return prefix


def _has_wheels() -> bool:
    try:
        importlib.metadata.version("ros-rosidl-adapter")
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def is_current(package: InterfacePackage, target: Target) -> bool:
    """Whether `target` holds a build of exactly these inputs, or somebody else's build to leave alone."""
    stamp = target.stamp(package.name)
    if not stamp.is_file():
        spec = importlib.util.find_spec(package.name)
        return spec is not None and spec.origin is not None  # a folder without __init__.py is no build
    if not (target.modules / package.name / "__init__.py").is_file():
        return False
    return json.loads(stamp.read_text())["fingerprint"] == fingerprint(package)


def build(
    names: tuple[str, ...] = PACKAGES, *, force: bool = False, target: Target | None = None
) -> list[str]:
    """Build what is not current and return the names built. Raises InputError with the remedy."""
    target = target or this_environment()
    definitions = definitions_folder()
    packages = [read_package(name, definitions) for name in names]
    with tempfile.TemporaryDirectory(prefix="samrl_interfaces_") as scratch:
        target.share.mkdir(parents=True, exist_ok=True)
        with filelock.FileLock(target.share / ".samrl_interfaces.lock"):  # two test workers may start at once
            stale = [package for package in packages if force or not is_current(package, target)]
            if not stale:
                return []
            prefix = wheels_prefix()
            require_compilers()
            for package in stale:
                work = Path(scratch, package.name)
                work.mkdir()
                generated = generate(package, work, prefix)
                build_binaries(generated, work, prefix)
                _install(generated, target)
    return [package.name for package in stale]


def _install(generated: Generated, target: Target) -> None:
    """Put a finished build in place; the stamp comes last, so an interrupted install is not taken as done."""
    package = generated.package
    remove(package.name, target)
    share = target.share / package.name
    for file in package.files:
        (share / file.parent).mkdir(parents=True, exist_ok=True)
        shutil.copy(package.folder / file, share / file)
        shutil.copy((generated.c / file).with_suffix(".json"), (share / file).with_suffix(".json"))
        shutil.copy((generated.idl / file).with_suffix(".idl"), (share / file).with_suffix(".idl"))
    manifest = package.folder / "package.xml"
    if manifest.is_file():
        shutil.copy(manifest, share / manifest.name)
    index = target.share / "ament_index" / "resource_index"
    listed = sorted(
        f"{file.with_suffix(suffix)}" for file in package.files for suffix in (".idl", file.suffix)
    )
    for resource, text in (("packages", ""), ("rosidl_interfaces", "\n".join(listed))):
        (index / resource).mkdir(parents=True, exist_ok=True)
        (index / resource / package.name).write_text(text)
    shutil.copytree(generated.python, target.modules / package.name)
    target.stamp(package.name).write_text(json.dumps({"fingerprint": fingerprint(package)}))


def remove(name: str, target: Target) -> None:
    """Take a build of this code out again; anything else of the same name is left alone."""
    if target.stamp(name).is_file():
        target.stamp(name).unlink()
        shutil.rmtree(target.share / name)
        shutil.rmtree(target.modules / name, ignore_errors=True)
        for marker in (target.share / "ament_index" / "resource_index").glob(f"*/{name}"):
            marker.unlink()


def main(arguments: list[str] | None = None) -> int:
    """Command line. Returns 0 when the interfaces are in place, 3 when they cannot be built."""
    parser = argparse.ArgumentParser(prog="build_interfaces", description=__doc__)
    parser.add_argument("--force", action="store_true", help="build even when the installed one is current")
    parser.add_argument("--remove", action="store_true", help="remove what this command installed")
    options = parser.parse_args(arguments)
    start = time.perf_counter()
    try:
        if options.remove:
            for name in PACKAGES:
                remove(name, this_environment())
            return 0
        built = build(force=options.force)
    except SamrlError as error:
        print(f"error: {error}", file=sys.stderr)
        return 3
    what = f"built {', '.join(built)}" if built else f"{', '.join(PACKAGES)} are current"
    print(f"ROS interfaces: {what} ({time.perf_counter() - start:.1f} s)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
