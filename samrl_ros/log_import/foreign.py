"""Logs of other tools read without a mapping, where everything about them is sure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from samrl_core.cell.types.arm_description import Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_core.common.files import is_folder
from samrl_ros.bags.reader import open_bag
from samrl_ros.log_import.devices import data_folder, refuse_questions
from samrl_ros.log_import.draft.guess import Effort
from samrl_ros.log_import.draft.joints.joint_draft import draft_mapping
from samrl_ros.log_import.draft.joints.motor_input import TORQUE_CONSTANT
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.formats.parquet import is_lerobot
from samrl_ros.log_import.formats.rosbag import is_bag, is_mcap
from samrl_ros.log_import.importer import import_recording
from samrl_ros.log_import.mapping import parse_mapping
from samrl_ros.recordings.read import has_arms


def is_foreign(path: Path) -> bool:
    """Whether a log is anything but a bag with samrl's topics (or a file that only looks like a bag)."""
    if is_mcap(path):
        bag = open_bag(path)
        return (
            bool(bag.topics) and not has_arms(bag) and any(t.type.endswith("/JointState") for t in bag.topics)
        )
    return True


def runs_in(path: Path) -> list[Path]:
    """Files or folders in a folder that are recordings of one machine, by name; any other path alone.

    Raises:
        InputError: the folder holds no log of joints.
    """
    if not is_folder(path) or is_bag(path) or is_lerobot(path):
        return [path]
    draft = draft_mapping([path], None, None, Effort.none)
    named = list(dict.fromkeys(str(source["file"]) for source in draft.sources.values()))
    if "{name}" not in named[0]:
        return [path]
    file = named[0] if len(named) == 1 else "{name}"  # a folder of several each
    return [path / file.replace("{name}", recording["name"]) for recording in draft.recordings]


def read_runs(
    path: Path,
    urdf: str | None,
    tolerances: Tolerances | None,
    effort: Effort,
    options: str = "",
    given: Sequence[Path] = (),
) -> tuple[list[ArmRecording], tuple[str, ...]]:
    """Draft a mapping and import by it: one recording, or of a dataset one for each episode drafted.

    Args:
        path: of the log.
        urdf: text of the robot's description; None takes a bag's own.
        tolerances: of the model, instead of the defaults.
        effort: what measured efforts are.
        options: of `samrl bag draft` for the same, as a refusal writes them.
        given: all that the user named, which one draft serves; without it, the log.

    Raises:
        InputError: something about the log is not sure, or as `draft_mapping` and `import_recording`.
    """
    draft = draft_mapping([path], urdf, urdf, effort)
    if any(guess.asks == TORQUE_CONSTANT for guess in draft.guesses):  # in one step they are left out, aloud
        draft = draft_mapping([path], urdf, urdf, Effort.none)
    if any("{name}" in source["file"] for source in draft.sources.values()):
        names = ", ".join(recording["name"] for recording in draft.recordings)
        raise InputError(
            f"{path} holds several recordings ({names}): name each file, and one of them by --held-out"
        )
    refuse_questions(draft, given or [path], options)
    data = data_folder(draft, path)
    mapping = parse_mapping(as_yaml(draft), Path("the drafted mapping"))
    notes = [f"{guess.key}: {guess.reason}" for guess in draft.guesses]
    notes += [f"left out: {each}" for each in draft.would_tell]
    recordings = []
    for spec in mapping.recordings:
        made = import_recording(spec, mapping, data)
        several = len(mapping.recordings) > 1
        name = f"{path.stem}_{spec.name}" if several else path.stem
        recording = replace(
            made.recording, name=name, source=f"{path} ({spec.name})" if several else str(path)
        )
        if tolerances is not None:
            recording = replace(recording, arm=replace(recording.arm, tolerances=tolerances))
        recordings.append(recording)
        notes += [f"{spec.name}: {note}" if several else note for note in made.notes]
    return recordings, tuple(notes)
