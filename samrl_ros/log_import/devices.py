"""Logs of poses, bodies and readings diagnosed without a mapping, where everything about them is sure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_folder, is_there
from samrl_ros.bags.reader import open_bag
from samrl_ros.log_import.body_importer import bodies_of
from samrl_ros.log_import.draft.any_draft import draft_free_devices
from samrl_ros.log_import.draft.bag_set import bags_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.places import name_by_path, named
from samrl_ros.log_import.draft.readings.clock_draft import STAMPED
from samrl_ros.log_import.draft.tracks.logged_tracks import POSES, read_logged_tables
from samrl_ros.log_import.draft.tracks.transform_chains import find_bag_chains
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.formats.parquet import is_lerobot
from samrl_ros.log_import.formats.rosbag import is_bag, is_mcap, list_topics
from samrl_ros.log_import.formats.transform_tree import KINDS
from samrl_ros.log_import.imported_files import INDEX
from samrl_ros.log_import.pose_importer import poses_of
from samrl_ros.log_import.reading_importer import readings_of
from samrl_ros.log_import.tables import SUFFIXES, is_text_table
from samrl_ros.recordings import body_file, pose_file, reading_file
from samrl_ros.recordings.read import has_arms

_IMPORTED = (pose_file.SUFFIX, body_file.SUFFIX, reading_file.SUFFIX)
_READERS = {"poses": poses_of, "bodies": bodies_of, "readings": readings_of}


@dataclass(frozen=True, eq=False)
class DeviceLogs:
    """Recordings of one kind made by drafted mappings."""

    kind: str  # poses, bodies or readings
    fit: list[Any]
    held_out: list[Any]
    notes: tuple[str, ...]


def read_devices(paths: Sequence[Path], held_out: Sequence[Path]) -> DeviceLogs | None:
    """Draft mappings and import by them; None of bags with joints, of recordings, and of logs of joints.

    Args:
        paths: of one recording, or of several alike.
        held_out: likewise, never fitted.

    Raises:
        InputError: something about a log is not sure, or it cannot be read.
    """
    if not all(_may_hold_devices(path) for path in (*paths, *held_out)):
        return None
    chosen = {path.resolve() for path in held_out}
    fitted = [path for path in paths if path.resolve() not in chosen]
    found = _imported(fitted) if fitted else None
    if found is None:
        return None
    kind, made, notes = found
    fit = [each.recording for each in made if each.role == "fit"]
    held = [each.recording for each in made if each.role == "held_out"]
    if held_out:
        other = _imported(held_out)
        if other is None or other[0] != kind:
            names = ", ".join(path.name for path in held_out)
            raise InputError(f"held out are {names}, which are not {kind} as the fitted logs are")
        fit, held = [*fit, *held], [each.recording for each in other[1]]
        notes += [note for note in other[2] if note not in notes]
    return DeviceLogs(kind, fit, held, tuple(notes))


def refuse_questions(draft: Draft, paths: Sequence[Path], options: str = "") -> None:
    """Stop where a draft asks; `options` are those of the draft.

    Raises:
        InputError: with its questions and what to do.
    """
    if draft.questions:
        names = " ".join(map(str, paths))
        asked = "".join(f"\n  {question}" for question in draft.questions)
        raise InputError(
            f"{names}: not in samrl's topics, and not all of it is sure:{asked}\n`samrl bag draft {names}"
            f"{options} --out mapping.yaml` writes down what was found; answer there, then `samrl diagnose"
            f" --mapping mapping.yaml --data {data_folder(draft, paths[0])}`"
        )


def data_folder(draft: Draft, path: Path) -> Path:
    """Folder from which a draft's files count."""
    files = [source.get("file") for source in draft.sources.values()]
    path = named(path)
    if bags_in(path):
        return path
    if is_folder(path) and not is_bag(path) and not all(file == path.name for file in files):
        return path
    return path.parent.parent if any(str(file).startswith("{name}/") for file in files) else path.parent


def _imported(paths: Sequence[Path]) -> tuple[str, list[Any], list[str]] | None:
    """Kind, imported recordings and notes of logs that are drafted together."""
    draft = draft_free_devices(paths)
    if draft is None:
        return None
    refuse_questions(draft, paths)
    folder = data_folder(draft, paths[0])
    name_by_path(draft, paths, folder)
    made = _READERS[draft.kind](as_yaml(draft), Path("the drafted mapping"), folder)
    notes = [f"{guess.key}: {guess.reason}" for guess in draft.guesses]
    # Lost frames of all recordings are counted in one note of the draft.
    more = dict.fromkeys(n for each in made for n in each.notes if not n.endswith("missing cells, drop_row"))
    return draft.kind, list(made), [*notes, *more]


def _may_hold_devices(path: Path) -> bool:
    """Whether a path is a log, but no recording of samrl's own and no bag with joints."""
    if not is_there(path) or path.name.endswith(_IMPORTED) or is_lerobot(path):
        return False
    if is_bag(path):
        kinds = {topic.type for topic in list_topics(path, "the log")}
        if any(kind.endswith("JointState") for kind in kinds):
            return bool(kinds & KINDS) and not _is_own(path) and _shows_target(path)
        return bool(kinds & (POSES | STAMPED | KINDS))
    if is_folder(path):
        names = [file.name for file in path.iterdir()]
        return INDEX not in names and not any(name.endswith((*_IMPORTED, ".mcap")) for name in names)
    return path.suffix.lower() in SUFFIXES or is_text_table(path)


def _is_own(path: Path) -> bool:
    """Whether a bag has samrl's topics of arms."""
    return is_mcap(path) and has_arms(open_bag(path))


def _shows_target(path: Path) -> bool:
    """Whether the frames of a bag are those of a camera that sees a target beside an arm: then its joints are
    not what is asked about."""
    tracks = [track for table in read_logged_tables([path]) for track in table.tracks()]
    return find_bag_chains([path], tracks) is not None
