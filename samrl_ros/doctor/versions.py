"""Installed distributions against what is asked for, and against the lock that the tests run with."""

from __future__ import annotations

import importlib.metadata
import os
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

from packaging.requirements import InvalidRequirement, Requirement
from packaging.version import InvalidVersion, Version

from samrl_ros.doctor.check import Check, ok, problem, warning

LOCK = "constraints.txt"
SHOWN = 6  # names in a line


def installed_version(name: str) -> str | None:
    """Of a distribution; None if it is not installed."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def lock_file() -> Path | None:
    """The lock of this samrl: beside the packages in a checkout, under share/ of an installed one."""
    prefixes = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    candidates = [Path(__file__).resolve().parents[2] / LOCK]
    candidates += [Path(prefix) / "share" / "samrl_ros" / LOCK for prefix in prefixes if prefix]
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def read_lock(text: str) -> dict[str, str]:
    """Versions by name, of lines `name==version`."""
    return dict(re.findall(r"^([\w.\-]+)==(\S+)$", text, re.MULTILINE))


def check_requirements(
    wanted: Iterable[str] | None = None, version: Callable[[str], str | None] = installed_version
) -> Check:
    """What samrl asks for is installed. Extras are not asked for; `check_ros` looks for ROS."""
    if wanted is None:
        if installed_version("samrl") is None:
            return warning("packages", "samrl is not installed here", "pip install -e '.[ros]' (make setup)")
        wanted = importlib.metadata.requires("samrl") or ()
    bad = []
    for text in wanted:
        try:
            asked = Requirement(text)
        except InvalidRequirement as error:
            return problem("packages", f"samrl asks for {text!r} ({error})", "install samrl again")
        if asked.marker is not None and not asked.marker.evaluate({"extra": ""}):
            continue
        found = version(asked.name)
        if found is None:
            bad.append(f"{asked.name} is missing")
        elif not asked.specifier.contains(found, prereleases=True):
            bad.append(f"{asked.name} is {found}, needed {asked.specifier}")
    if bad:
        return problem("packages", _shown(bad), "pip install -c constraints.txt -e '.[ros]' (make setup)")
    return ok("packages", "all that samrl asks for is installed")


def check_lock(lock: Path | None = None, version: Callable[[str], str | None] = installed_version) -> Check:
    """Installed versions are those that the tests run with. A build's label (`+cpu`) does not count."""
    path = lock or lock_file()
    if path is None:
        return warning("lock", f"no {LOCK} beside samrl", "nothing; install from a checkout to compare")
    different = []
    compared = 0
    for name, pinned in read_lock(path.read_text()).items():
        found = version(name)
        if found is None:
            continue
        compared += 1
        if not _same(found, pinned):
            different.append(f"{name} {found} (lock: {pinned})")
    if different:
        return warning("lock", _shown(different), f"pip install -c {path} -e '.[ros]' to run what is tested")
    return ok("lock", f"{compared} installed packages have the versions of {path}")


def _same(found: str, pinned: str) -> bool:
    try:
        return Version(found).public == Version(pinned).public
    except InvalidVersion:
        return found == pinned


def _shown(items: list[str]) -> str:
    more = f" and {len(items) - SHOWN} more" if len(items) > SHOWN else ""
    return "; ".join(items[:SHOWN]) + more
