"""Recordings of one system by role: of bags, imported files, and logs by a mapping or a draft."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from samrl_core.cell.types.arm_description import Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.cell.types.body_recording import BodyTolerances
from samrl_core.cell.types.pose_recording import PoseTolerances
from samrl_core.cell.types.reading_recording import ReadingTolerances
from samrl_core.common.errors import InputError
from samrl_core.common.files import require_there
from samrl_core.common.text_files import parse_json, read_text
from samrl_core.diagnosis.kinds.kind import Recording
from samrl_core.diagnosis.nominal_model.nominal_model import NominalModel
from samrl_core.diagnosis.recordings import check_held_out, check_recording, longest_whole, split
from samrl_core.diagnosis.recordings.motion_check import no_motion
from samrl_ros.cli.diagnosis.options import DiagnoseOptions
from samrl_ros.log_import.draft.bag_set import ask_one_machine, bags_in
from samrl_ros.log_import.draft.guess import Effort
from samrl_ros.recordings.arrays_by_role import restated
from samrl_ros.recordings.body_file import body_roles, is_body_file, load_body_files
from samrl_ros.recordings.pose_file import is_pose_file, load_pose_files, pose_roles
from samrl_ros.recordings.reading_file import is_reading_file, load_reading_files, reading_roles

Loaded = tuple[Sequence[Recording], Sequence[Recording], list[str]]  # fitted, held out, notes
_DIVIDE = {
    "poses": (PoseTolerances, pose_roles),
    "bodies": (BodyTolerances, body_roles),
    "readings": (ReadingTolerances, reading_roles),
}


def load(options: DiagnoseOptions, model: NominalModel | None = None) -> Loaded:
    """Recordings of one system by role, checked, with notes about them.

    Raises:
        InputError: a path where nothing lies, no bag, bags that cannot be read or used, or held-out data
            that were fitted too.
    """
    require_there(*options.bags, *options.held_out)
    if options.mapping is not None:
        return _load_mapped(options, options.mapping, model)
    given = [*options.bags, *options.held_out]
    options = replace(options, bags=tuple(bag for path in options.bags for bag in bags_in(path) or [path]))
    fit_paths, held_paths = _roles(options.bags, options.held_out)
    if options.camera:
        from samrl_ros.recordings.image_bag import load_image_bags

        return load_image_bags(fit_paths, held_paths, options.scene, options.tolerances)
    devices = _load_device_files(fit_paths, held_paths, options.tolerances)
    if devices is None and model is None:
        devices = _load_device_logs(options.bags, options.held_out, options.tolerances)
    return _load_arms(options, fit_paths, held_paths, model, given) if devices is None else devices


def _load_mapped(options: DiagnoseOptions, mapping: Path, model: NominalModel | None) -> Loaded:
    """Recordings that a mapping names, or logs read as it says."""
    from samrl_ros.log_import.any_importer import import_logs_by
    from samrl_ros.recordings import read_tolerances

    if options.camera:
        raise InputError("--camera takes bags with images; leave out --mapping")
    if options.effort is not Effort.ask:
        raise InputError(f"--effort {options.effort.value}: with --mapping its channels say what efforts are")
    data = options.data if options.data is not None else mapping.parent
    urdf = None if model is None else model.urdf
    found = import_logs_by(mapping, data, options.bags, options.held_out, urdf)
    named = [(each.recording.name, note) for each in found.made for note in each.notes]
    notes = [note if note.startswith(f"{name}: ") else f"{name}: {note}" for name, note in named]
    if found.kind != "joints":
        return _divided(
            found.kind, found.of_role("fit"), found.of_role("held_out"), notes, options.tolerances
        )
    notes += [
        f"{each.recording.name}: the effort of {', '.join(each.raw)} is in raw units of the drive, not in N m"
        for each in found.made
        if each.raw
    ]
    fit, held_out = found.of_role("fit"), found.of_role("held_out")
    if options.tolerances is not None:
        stated = read_tolerances(options.tolerances)
        fit, held_out = (
            [replace(r, arm=replace(r.arm, tolerances=stated)) for r in group] for group in (fit, held_out)
        )
    if not fit:
        raise InputError(f"{mapping.name}: every recording is held out; leave one to fit")
    return _of_one_arm(options, model, [(r,) for r in fit], [(r,) for r in held_out], notes)


def _divided(kind: str, fit: list, held_out: list, notes: list[str], tolerances: Path | None) -> Loaded:
    """Recordings of poses, bodies or readings by role, a part held out where none is."""
    stated, divide = _DIVIDE[kind]
    fit, held, more = divide(*restated(fit, held_out, (stated, tolerances)))
    return fit, held, [*notes, *more]


def _load_device_files(
    fit: Sequence[Path], held_out: Sequence[Path], tolerances: Path | None
) -> Loaded | None:
    """Imported recordings; None where there are none among the files.

    Raises:
        InputError: files of several kinds, damaged ones, or held-out data that were fitted.
    """
    for is_file_of, load in (
        (is_pose_file, load_pose_files),
        (is_reading_file, load_reading_files),
        (is_body_file, load_body_files),
    ):
        if any(is_file_of(path) for path in (*fit, *held_out)):
            return load(fit, held_out, tolerances)
    return None


def _load_device_logs(
    logs: Sequence[Path], held_out: Sequence[Path], tolerances: Path | None
) -> Loaded | None:
    """Logs by drafted mappings; None of logs of joints.

    Args:
        logs: of one recording or several, in the user's order.
        held_out: never fitted.
        tolerances: a file of those of the kind.

    Raises:
        InputError: something about them is not sure, they cannot be read, or held-out data were fitted.
    """
    from samrl_ros.log_import.devices import read_devices

    found = read_devices(logs, held_out)
    if found is None:
        return None
    return _divided(found.kind, found.fit, found.held_out, list(found.notes), tolerances)


def _load_arms(
    options: DiagnoseOptions,
    fit_paths: list[Path],
    held_paths: list[Path],
    model: NominalModel | None,
    given: Sequence[Path],
) -> Loaded:
    """Logs of joints, drafted one by one; `given` are the paths that the user named, for messages."""
    from samrl_ros.log_import.foreign import is_foreign, runs_in
    from samrl_ros.recordings import read_tolerances

    fit_paths = [run for path in fit_paths for run in runs_in(path)]
    urdf = None if model is None else model.urdf
    tolerances = read_tolerances(options.tolerances) if options.tolerances else None
    drafted = "" if options.urdf is None else f" --urdf {options.urdf}"
    drafted += "" if options.effort is Effort.ask else f" --effort {options.effort.value}"
    for folder in given:
        if question := ask_one_machine([bag for bag in bags_in(folder) if is_foreign(bag)]):
            raise InputError(
                f"{folder}: {question}. If they are: `samrl bag draft {folder}{drafted} --out mapping.yaml`,"
                f" delete that question, then `samrl diagnose --mapping mapping.yaml --data {folder}`"
            )
    notes: list[str] = []
    groups: list[list[tuple[ArmRecording, ...]]] = []
    all_paths = [*fit_paths, *held_paths]
    apart = len({path.stem for path in all_paths}) == 1 < len({path.parent.name for path in all_paths})
    apart &= len({path.parent.name for path in all_paths}) == len(all_paths)
    for paths in (fit_paths, held_paths):
        group = []
        for path in paths:
            runs, more = read_log(path, urdf, tolerances, options.effort, drafted, given)
            if apart:  # a folder each, under one name
                runs = [tuple(replace(each, name=path.parent.name) for each in run) for run in runs]
                more = [note.replace(path.name, f"{path.parent.name}/{path.name}", 1) for note in more]
            group += runs
            notes += more
        groups.append(group)
    return _of_one_arm(options, model, *groups, notes)


def _of_one_arm(
    options: DiagnoseOptions,
    model: NominalModel | None,
    fit_logs: list[tuple[ArmRecording, ...]],
    held_logs: list[tuple[ArmRecording, ...]],
    notes: list[str],
) -> Loaded:
    """The arm that moves, checked; where no log is held out the last of several is, or a part of one."""
    from samrl_ros.recordings.described import described_by

    if not held_logs and len(fit_logs) > 1:
        fit_logs, held_logs = fit_logs[:-1], fit_logs[-1:]
    role = options.arm or _moving_role([*fit_logs, *held_logs])
    chosen: list[list[ArmRecording]] = []
    for group in (fit_logs, held_logs):
        one = []
        for recordings in group:
            found = [r for r in recordings if r.arm.role == role]
            if not found:
                roles = [r.arm.role for r in recordings]
                raise InputError(f"{recordings[0].source} has {roles}, not {role}; choose with --arm")
            one.append(found[0])
        if model is not None:
            described = [described_by(r.arm, model) for r in one]
            one = [replace(r, arm=arm) for r, (arm, _) in zip(one, described, strict=True)]
            notes += [note for _, more in described for note in more if note not in notes]
        chosen.append(one)
    fit, held_out = chosen
    for group in (fit, held_out):
        for k, recording in enumerate(group):
            notes += [f"{recording.name}: {note}" for note in check_recording(recording)]
            group[k], note = longest_whole(recording)
            notes += [f"{recording.name}: {note}"] if note else []
    if not held_out:
        (whole,) = fit
        first, last = split(whole)
        fit, held_out = [first], [last]
        notes.append(f"{whole.name} is alone: its last part, after a gap, is held out")
    check_held_out(fit, held_out)
    return fit, held_out, notes


def read_log(
    path: Path,
    urdf: str | None,
    tolerances: Tolerances | None,
    effort: Effort,
    drafted: str = "",
    given: Sequence[Path] = (),
) -> tuple[list[tuple[ArmRecording, ...]], list[str]]:
    """Recordings of one log by arm, a bag with samrl's topics or another tool's, with notes.

    A dataset of episodes has several. `drafted` and `given` as `options` and `given` of `read_runs`.

    Raises:
        InputError: as `read_runs` and `load_recordings`.
    """
    from samrl_ros.log_import.foreign import is_foreign, read_runs
    from samrl_ros.recordings import load_recordings

    if is_foreign(path):
        recordings, more = read_runs(path, urdf, tolerances, effort, drafted, given)
        return [(each,) for each in recordings], [f"{path.name}: {note}" for note in more]
    bag = load_recordings(path, urdf=urdf, tolerances=tolerances)
    return [bag.recordings], [f"{path.name}: {note}" for role in bag.notes for note in bag.notes[role]]


def load_one(path: Path, options: DiagnoseOptions) -> tuple[ArmRecording, list[str]]:
    """The arm of a log that moves, or that was chosen, with notes.

    Raises:
        InputError: no such log, none that can be read, or no such arm in it.
    """
    require_there(path)
    (recordings, *others), notes = read_log(path, None, None, options.effort)
    notes += [f"{path.name}: of its recordings, {recordings[0].name} is compared"] if others else []
    role = options.arm or _moving_role([recordings])
    found = [r for r in recordings if r.arm.role == role]
    if not found:
        raise InputError(f"{path} has {[r.arm.role for r in recordings]}, not {role}; choose with --arm")
    return found[0], notes


def _role_table(index: Path) -> dict[str, list[str]]:
    """File names by role, of an import's recordings.json."""
    table = parse_json(read_text(index, "the recordings' roles"), str(index))
    found = {role: table.get(role, []) for role in ("fit", "held_out")} if isinstance(table, dict) else {}
    names = [name for listed in found.values() if isinstance(listed, list) for name in listed]
    plain = all(isinstance(n, str) and n == Path(n).name and "\0" not in n for n in names)
    if not found or not all(isinstance(listed, list) for listed in found.values()) or not plain:
        raise InputError(
            f"{index} must hold lists of file names under fit and held_out; import again, or name the bags"
        )
    return found


def _roles(bags: Sequence[Path], held_out: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Files to fit and to hold out: as named, by recordings.json of an import, or the last one held out."""
    fit: list[Path] = []
    held = list(held_out)
    for path in bags:
        index = path / "recordings.json"
        if path.is_dir() and index.exists():
            table = _role_table(index)
            fit += [path / name for name in table["fit"]]
            if not held_out:
                held += [path / name for name in table["held_out"]]
        elif path.is_dir() and not (path / "metadata.yaml").exists() and any(path.glob("*.mcap")):
            fit += sorted(path.glob("*.mcap"))
        else:
            fit.append(path)
    chosen = {h.resolve() for h in held}
    fit = [f for f in fit if f.resolve() not in chosen]
    if not fit:
        names = ", ".join(sorted(h.name for h in held))
        raise InputError(f"nothing is left to fit: {names} cannot be fitted and held out; give another bag")
    if not held and len(fit) > 1:
        held = [fit.pop()]
    return fit, held


def _moving_role(groups: Sequence[tuple[ArmRecording, ...]]) -> str:
    """The arm that moves in every recording; the tool arm if both do."""
    roles = [{r.arm.role for r in recordings if not no_motion(r)} for recordings in groups]
    common = set.intersection(*roles) if roles else set()
    if not common:
        present = sorted({r.arm.role for recordings in groups for r in recordings})
        raise InputError(f"no arm of {present} moves in every recording; record motion, or choose with --arm")
    return "tool_arm" if "tool_arm" in common else sorted(common)[0]
