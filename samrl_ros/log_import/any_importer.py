"""A mapping of any kind, run: which kind it describes, its recordings, and other logs in place of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from samrl_core.common.errors import InputError
from samrl_core.common.text_files import parse_yaml, read_text
from samrl_ros.log_import.body_importer import bodies_of
from samrl_ros.log_import.imported_files import entries_of, write_imported
from samrl_ros.log_import.importer import ImportedRecording, import_recording, write_bag
from samrl_ros.log_import.mapping import parse_mapping
from samrl_ros.log_import.pose_importer import poses_of
from samrl_ros.log_import.reading_importer import readings_of
from samrl_ros.recordings import body_file, pose_file, reading_file

_OF_A_LOG = ("name", "role", "files", "glob", "hold_out_every")  # keys that say which log is read, not how
_CUTS = ("parts", "rows", "time_range")  # keys that choose from one log


@dataclass(frozen=True, eq=False)
class Imported:
    """Recordings of one kind, each with `recording`, `role`, `report` and `notes`."""

    kind: str  # joints, poses, bodies or readings
    made: Sequence[Any]

    def of_role(self, role: str) -> list[Any]:
        """Recordings that are `fit` or `held_out`."""
        return [each.recording for each in self.made if each.role == role]

    def system_of(self, each: Any) -> str:
        """What a recording is of, for a reader."""
        return _SYSTEM[self.kind].format(each.recording)


def kind_of(text: str, path: Path) -> str:
    """`joints`, `poses`, `bodies` or `readings`: what a mapping's text describes; `path` is for messages.

    Raises:
        InputError: it is no YAML, or describes two kinds.
    """
    content = parse_yaml(text, str(path))
    found = [key for key in ("poses", "readings", "bodies") if isinstance(content, dict) and key in content]
    if len(found) > 1:
        raise InputError(f"{path.name}: has {' and '.join(found)}; one mapping describes one kind")
    return found[0] if found else "joints"


def import_any(path: Path, data: Path, out: Path | None) -> Imported:
    """Every recording of a mapping; written into `out` with an index of roles, unless it is None.

    Args:
        path: of the mapping.
        data: folder that its paths count from.
        out: folder.

    Raises:
        InputError: with the key path of what is wrong; or a file of `out` exists already.
    """
    text = read_text(path, "the mapping")
    kind = kind_of(text, path)
    made = _RUN[kind](text, path, data)
    if out is not None:
        suffix, write = _WRITE[kind]
        write_imported(made, out, suffix, lambda each, file: write(each, file, path))
    return Imported(kind, made)


def import_logs_by(
    path: Path, data: Path, logs: Sequence[Path], held_out: Sequence[Path], urdf: str | None = None
) -> Imported:
    """Logs read as a mapping says, in place of those it names; without logs, its own.

    Args:
        path: of the mapping.
        data: folder that its paths count from.
        logs: one recording each.
        held_out: likewise, never fitted.
        urdf: text of a model in place of the mapping's.

    Raises:
        InputError: the mapping reads several files at once or cuts its recordings, a model for what has no
            joints, or as `import_any`.
    """
    text = read_text(path, "the mapping")
    if logs or held_out:
        text = _with_logs(text, path, logs, held_out)
    kind = kind_of(text, path)
    if urdf is None:
        return Imported(kind, _RUN[kind](text, path, data))
    if kind != "joints":
        raise InputError(f"{path.name} describes {kind}; a model of an arm is of no use, leave it out")
    return Imported(kind, _joints_of(text, path, data, urdf))


def _with_logs(text: str, path: Path, logs: Sequence[Path], held_out: Sequence[Path]) -> str:
    general, entries = entries_of(text, path)
    own = [{k: v for k, v in e.items() if k not in _OF_A_LOG} for e in entries if isinstance(e, dict)]
    how = own[0] if own else {}
    if cuts := sorted({key for each in (general, *own) for key in each if key in _CUTS}):
        raise InputError(f"{path.name}: {', '.join(cuts)} cut its recordings; leave LOG out to read those")
    if differ := sorted({key for each in own for key in {*how, *each} if how.get(key) != each.get(key)}):
        raise InputError(
            f"{path.name}: its recordings differ in {', '.join(differ)}; give each its log under `files`"
            " and leave LOG out"
        )
    sources = {**general, **how}.get("sources")
    if isinstance(sources, dict) and len(sources) != 1 and not _read_one_file(sources):
        raise InputError(
            f"{path.name}: has sources {', '.join(map(str, sources))}, of which each recording names files; "
            "do so under `recordings` and leave LOG out"
        )
    read = list(sources) if isinstance(sources, dict) else ["log"]  # missing ones are refused later
    names, held = _names([*logs, *held_out]), {log.resolve() for log in held_out}
    recordings = []
    for log, name in names.items():
        about: dict[str, Any] = {**how, "name": name, "files": dict.fromkeys(read, str(log))}
        if held_out:
            about["role"] = "held_out" if log in held else "fit"
        recordings.append(about)
    return yaml.safe_dump({**general, "recordings": recordings}, sort_keys=False, allow_unicode=True)


def _read_one_file(sources: dict[str, Any]) -> bool:
    """Whether sources are topics or parts of one log, so that another log stands for all of them."""
    files = [source.get("file") if isinstance(source, dict) else None for source in sources.values()]
    return bool(files) and files[0] is not None and all(file == files[0] for file in files)


def _names(logs: Sequence[Path]) -> dict[Path, str]:
    """A name for each log: its file's, with its folder's where two files are called alike."""
    paths = list(dict.fromkeys(log.resolve() for log in logs))
    stems = [path.stem for path in paths]
    return {
        path: f"{path.parent.name}_{path.stem}" if stems.count(path.stem) > 1 else path.stem for path in paths
    }


def _joints_of(text: str, path: Path, data: Path, urdf: str | None = None) -> list[ImportedRecording]:
    mapping = parse_mapping(text, path)
    specs = mapping.recordings
    if urdf is not None:
        specs = tuple(spec.with_model(urdf) for spec in specs)
    return [import_recording(spec, mapping, data) for spec in specs]


_SYSTEM = {
    "joints": "{0.arm.role}",
    "poses": "{0.target} seen by {0.camera}",
    "bodies": "{0.body.name}",
    "readings": "{0.quantity} of {0.sensor}",
}
_RUN: dict[str, Callable[[str, Path, Path], Sequence[Any]]] = {
    "joints": _joints_of,
    "poses": poses_of,
    "bodies": bodies_of,
    "readings": readings_of,
}
_WRITE: dict[str, tuple[str, Callable[[Any, Path, Path], object]]] = {
    "joints": (".mcap", lambda each, file, mapping: write_bag(each, file, mapping.name)),
    "poses": (pose_file.SUFFIX, lambda each, file, _: pose_file.write_pose_file(each.recording, file)),
    "bodies": (body_file.SUFFIX, lambda each, file, _: body_file.write_body_file(each.recording, file)),
    "readings": (
        reading_file.SUFFIX,
        lambda each, file, _: reading_file.write_reading_file(each.recording, file),
    ),
}
