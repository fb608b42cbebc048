"""Files of a draft that lie in several folders: a mapping's paths count from one of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_folder, is_there
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.formats.rosbag import is_bag


def named(path: Path) -> Path:
    """The path, or, where it has no name, as `.`, the whole one."""
    return path if path.name else path.absolute()


def name_by_path(draft: Draft, paths: Sequence[Path], folder: Path) -> None:
    """Give whole paths to files that lie elsewhere than in `folder`, and names of their own to namesakes.

    A draft names files without their folders, and another file of that name may lie in the first one.

    Args:
        draft: whose sources and recordings are changed.
        paths: the logs that were drafted, in order.
        folder: from which the draft's paths count.

    Raises:
        InputError: files of one name in several folders, which are not a recording each.
    """
    given: dict[str, list[Path]] = {}
    for path in paths:
        inside = sorted(path.iterdir()) if is_folder(path) and not is_bag(path) else []
        for each in (path, *inside):
            given.setdefault(each.name, []).append(each.resolve())
    for source, about in draft.sources.items():
        named = [_file(about, source, recording) for recording in draft.recordings]
        alike = given.get(named[0], []) if len(set(named)) == 1 else []
        if len(draft.sources) == 1 and len(alike) == len(named) > 1 and named[0]:
            _name_by_folder(draft, source, sorted(alike))
            continue
        for recording, file in zip(draft.recordings, named, strict=True):
            found = list(dict.fromkeys(given.get(file, [])))
            if len(found) > 1:
                raise InputError(
                    f"{found[0]} and {found[1]} have one name, and are not a recording each: a draft tells"
                    " files by their names; give them different names"
                )
            if found and found[0] != (folder / file).resolve() and is_there(found[0]):
                recording["files"] = {**recording.get("files", {}), source: str(found[0])}


def _file(about: Mapping[str, Any], source: str, recording: Mapping[str, Any]) -> str:
    """File of a source in a recording; empty where it is not one name."""
    file = recording.get("files", {}).get(source, about.get("file"))
    if not isinstance(file, str) or "name" not in recording:
        return ""
    return file.replace("{name}", str(recording["name"]))


def _name_by_folder(draft: Draft, source: str, files: Sequence[Path]) -> None:
    """Recordings of one file each that bear one name are called after their folders."""
    names = [file.parent.name for file in files]
    if len(set(names)) < len(names):
        names = [f"{name}_{number}" for number, name in enumerate(names, start=1)]
    for recording, name, file in zip(draft.recordings, names, files, strict=True):
        recording |= {"name": name, "files": {source: str(file)}}
