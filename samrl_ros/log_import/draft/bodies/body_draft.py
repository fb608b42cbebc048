"""Drafts a mapping of a free body: which track it is, which axis is up, in which units, and what it touches.

Free fall proves the units and the axis (`free_fall`). A slide proves neither: that its support is level, and
which way is up, is asked for. What the body is made of and how it touches is in no log: friction and
restitution that nobody states are solved for, and a note says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.blocks import numbers_of
from samrl_ros.log_import.draft.bodies.free_fall import SURE_LEAN, FreeFall, G, find_unscaled_fall
from samrl_ros.log_import.draft.bodies.name_order import ask_of_name_order
from samrl_ros.log_import.draft.bodies.seen_tracks import (
    BODIES,
    SeenTrack,
    choose_track,
    clean_poses,
    contact_seconds,
    is_named_body,
    is_of_a_machine,
    look_at,
    plane_across,
    plane_of_most,
)
from samrl_ros.log_import.draft.column_names import meaning, words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.tracks.found_track import Component
from samrl_ros.log_import.draft.tracks.logged_tracks import LoggedTrack
from samrl_ros.log_import.draft.tracks.pose_tracks import numbers_of_parts
from samrl_ros.log_import.draft.tracks.track_entries import (
    add_columns,
    add_track_entry,
    add_track_source,
    empty_columns,
    length_unit,
    repeats_time,
    turns_unit,
)
from samrl_ros.log_import.pose_specs import LENGTHS

MOST_RUNS = 20  # of a folder that are searched for contact
PLACEHOLDER_HZ = 100.0
DOWNWARDS = frozenset("ned down depth".split())  # in names of tracks whose z points down
PUSHES = frozenset("tip tips pusher ft wrench wrenches force forces finger gripper".split())
ROUND = frozenset("ball sphere marble cylinder roller wheel can bottle".split())
ROLLS = (
    "{} by its name: does it roll? Then write `body: {{sphere: radius}}` or `{{cylinder: [radius, height]}}`"
    " and `rolls: true` beside `normal`; a puck slides"
)
_UNNAMED = {  # what is asked of columns without names, by what gives their rotation
    "matrix": "is it a matrix of 3 rows of 4, row by row (the KITTI format)?",
    "quaternion": "is it a position and a quaternion x, y, z, w after the time (the TUM format)?",
    "rotation_vector": "is it a position and a rotation vector?",
}


def draft_bodies(tracks: Sequence[LoggedTrack]) -> Draft | None:
    """A draft of tracks of one free body: one recording, or several files alike; None of any other log."""
    whole = [each for each in tracks if each.track.whole]
    candidates = whole or [each for each in tracks if each.track.positioned]
    if not candidates or any(is_of_a_machine(each, tracks) for each in candidates):
        return None
    # Topics of a bag, and labels of a file's rows, are things beside each other; files are one after another,
    # and so are a file's groups.
    files = list(dict.fromkeys(each.motion for each in candidates))
    alike = {file: sorted((c.part, *c.track.used) for c in candidates if c.motion == file) for file in files}
    if any(each != alike[files[0]] for each in alike.values()):
        return None  # tracks of several devices, not several motions of one body
    first = [look_at(each) for each in candidates if each.motion == files[0]]
    chosen, question = choose_track(first)
    of_it = (chosen.each.part, chosen.each.track.used, chosen.each.track.stem)
    same = [c for c in candidates if (c.part, c.track.used, c.track.stem) == of_it]
    runs = [chosen, *(look_at(each) for each in same if each.motion != files[0])]
    pushing = sorted(name for name in chosen.each.table.columns if set(words_in(name)) & PUSHES)
    # What is pushed speeds up as well, and what a hand pushes along a plane does so beside no tip's column.
    if (pushing or _falls_along_a_plane(runs)) and not _most_fall_alike(runs):
        runs = [replace(run, fall=None, curve=None) for run in runs]
        chosen = runs[0]
    fall = next((run.fall for run in runs if run.fall is not None), None)
    if fall is None and not is_named_body(chosen.each) and len(chosen.each.track.axes) < 2:
        return None
    draft = Draft(about="Drafted by samrl bag draft. Every entry has its reason beside it; check them.")
    reason = "the only track" if len(first) == 1 else "the track that moves"
    draft.note("bodies.track", f"{chosen.each.name}: {reason}", question)
    if pushing:
        draft.note(
            "recordings", f"{', '.join(pushing)} stand beside it: something pushes the body",
            "when is it free? Give each recording the `time_range` in which it touches the support alone:"
            " what is pushed tells no friction",
        )  # fmt: skip
    draft.unused += [each.name for each in tracks if each.motion == files[0] and each is not chosen.each]
    track = _describe_track(chosen, fall, runs, draft)
    named = chosen.each.table.maker or set(chosen.each.track.stem) & BODIES
    draft.bodies = {"body": {"name": "_".join(chosen.each.track.stem)}} if named else {}
    draft.bodies["track"] = track
    _describe_up(chosen, fall, len(runs) == 1 and _falls_along_a_plane(runs), draft)
    _describe_contact(runs, fall, draft)
    _add_recordings(runs, draft)
    return draft


def _most_fall_alike(runs: Sequence[SeenTrack]) -> bool:
    """Whether gravity is what most runs show: it pulls every one of them the same way."""
    falls = [(run.fall.axis, run.fall.up) for run in runs if run.fall is not None]
    return any(falls.count(way) > 0.5 * len(runs) for way in set(falls))


def _falls_along_a_plane(runs: Sequence[SeenTrack]) -> bool:
    """Whether what looks like a fall lies in the plane that most tracks stay in, as a push there does."""
    axis = plane_of_most(runs)
    return axis is not None and any(run.fall is not None and run.fall.axis != axis for run in runs)


def _describe_track(
    chosen: SeenTrack, fall: FreeFall | None, runs: Sequence[SeenTrack], draft: Draft
) -> dict[str, Any]:
    """Source, columns, units and turns of the track."""
    each = chosen.each
    source = add_track_source("track", each, draft)
    entry = add_track_entry(each, "track", draft)
    if any(not np.isfinite(run.each.position).all() for run in runs):
        source["missing"] = "drop_row"
    if any(run.each.track.zeros for run in runs):
        empty_columns(each, source)
    lost = sum(int((~np.isfinite(run.each.position)).any(axis=1).sum()) for run in runs)
    if lost:
        draft.note("sources.track.missing", f"{lost} poses are empty: not seen there, so they are left out")
    _describe_time(chosen, fall, source, draft)
    if (
        chosen.time is not None
        and chosen.time.entry
        and any(run.time and repeats_time(run.time) for run in runs)
    ):
        source["time"]["repeated"] = "drop"
        draft.note("sources.track.time", "some steps do not increase; such rows are left out")
    if "angle_unit" in entry and not each.track.angle_unit:
        turned = [run.each for run in runs if run.each.track.rotation == each.track.rotation]
        entry["angle_unit"] = max((turns_unit(run) for run in turned), key=lambda unit: unit == "deg")
    if each.track.axes != "xyz":
        entry["axes"] = each.track.axes
    entry.pop("source")
    _describe_unit(chosen, fall, plane_of_most(runs), entry, draft)
    _describe_turns(each, entry, draft)
    if len(each.track.axes) == 2 and not each.track.rotation:
        _add_angle(each, source, entry, draft)
    if not each.track.named:
        draft.note(
            "bodies.track.position",
            f"columns {each.track.names} have no names; their numbers may be those of a body",
            _UNNAMED.get(
                each.track.rotation, "are they x, y and z of a position, after a time if there is one?"
            ),
        )
    return entry


def _describe_time(chosen: SeenTrack, fall: FreeFall | None, source: dict[str, Any], draft: Draft) -> None:
    key, time = "sources.track.time", chosen.time
    if time is None:
        counted = {"column": chosen.frames} if chosen.frames else {}
        source["time"] = {**counted, "rate_hz": PLACEHOLDER_HZ}
        what = f"{chosen.frames!r} counts frames" if chosen.frames else "no column is named as time"
        draft.note(key, what, f"what is the frame rate [Hz]? {PLACEHOLDER_HZ:g} is a placeholder")
        ask_of_name_order(chosen.each, draft)
        return
    unit = time.units[0] if fall is None else fall.time_unit
    column = time.entry.get("column")
    if time.proof:
        draft.note(key, time.proof)
    elif fall is not None:
        draft.note(key, f"{column!r} in {unit}: what falls gains {fall.gravity:.3g} m/s per s")
    else:
        step = float(np.nanmedian(np.diff(time.values)))
        counted = step == 1.0 or len(time.units) != 1
        question = f"is {column!r} in {unit}, and no count of frames?" if counted else ""
        draft.note(key, f"{column!r} in {unit}: steps of {step:g}", question)
    if time.entry:
        plain = time.entry.get("iso") or "nanoseconds" in time.entry
        source["time"] = dict(time.entry) if plain else {**time.entry, "unit": unit}


def _describe_unit(
    chosen: SeenTrack, fall: FreeFall | None, across: int | None, entry: dict[str, Any], draft: Draft
) -> None:
    """Of its length; `across` is the axis across the plane that it stays in, in which friction slows it."""
    key, each = "bodies.track.unit", chosen.each
    said = each.track.unit
    if fall is not None:
        proof = f"it falls with {fall.gravity:.3g} m/s^2 then"
        if said in LENGTHS and said != fall.unit:
            question = f"the log says {said}, but what falls says {fall.unit}: which is it?"
        elif not fall.sure:
            question = f"free fall has {G:.2f} m/s^2; are unit, frame rate and playback speed right?"
        else:
            question = ""
        entry["unit"] = said if said in LENGTHS else "m" if said == "in" else fall.unit
        draft.note(key, proof if said not in LENGTHS else f"the log says {said}; {proof}", question)
        return
    if said in LENGTHS or said == "in":
        question = ""
        if chosen.curve is not None:
            question = (
                f"what looks like a fall does not have {G:.2f} m/s^2 in it: does the body fly freely, or is"
                " it carried? If it flies, are unit, frame rate and `gravity` right? If it slides down an"
                " incline, write `incline: ANGLE` (in degrees, +x downhill) in place of `gravity`"
            )
        draft.note(key, f"the log says {said}", question)
        return
    scale = None
    if chosen.time is not None and len(chosen.time.units) == 1:
        stamps = chosen.time.seconds(chosen.time.units[0])
        scale = find_unscaled_fall(*clean_poses(stamps, each.position))
    if scale is not None and across in (None, scale.axis):
        entry["unit"] = "m"
        metres = G / scale.gravity
        draft.note(
            key, f"it falls with {scale.gravity:.4g} units/s^2, which is 9.81 m/s^2 in no unit that is known",
            "how long is a unit (a pixel?) in m? Write `position: [\"SCALE * x\", ...]`;"
            f" {metres:.4g} would make it free fall, but then the length can no longer be judged",
        )  # fmt: skip
        return
    entry["unit"] = "m" if chosen.curve is not None else length_unit(each)
    if chosen.curve is not None:
        draft.note(
            key, "it falls, but neither the unit of length nor the frame rate is known",
            "how long is a unit (a pixel?) in m? Write `position: [\"SCALE * x\", ...]`",
        )  # fmt: skip
        return
    farthest = float(np.nanmax(np.abs(each.position)))
    draft.note(
        key, f"numbers up to {farthest:.4g}, nothing falls",
        f"is the unit {entry['unit']}, and no other?",
    )  # fmt: skip


def _describe_turns(each: LoggedTrack, entry: dict[str, Any], draft: Draft) -> None:
    """How its turns are given, or that they are left out."""
    kind = each.track.rotation
    if kind == "quaternion":
        sure = bool(each.track.order)
        entry["order"] = each.track.order or "xyzw"
        why = f"{each.track.order} by the names" if sure else "four numbers without names"
        draft.note("bodies.track.quaternion", why, "" if sure else "is its order xyzw, and not wxyz?")
    elif kind == "rotation_vector" and each.track.vague:
        draft.note(
            "bodies.track.rotation_vector", "three numbers, as rotation vectors are (Vicon: helical angles)",
            "is it a rotation vector, and no Euler angles? Leave it out if turns do not matter",
        )  # fmt: skip
    elif kind == "rpy":
        draft.note(
            "bodies.track.rpy", "roll, pitch and yaw by their names",
            "do they turn about the fixed x, y, z axes in this order, as in a URDF"
            + ("?" if each.track.angle_unit else f", and are they in {entry['angle_unit']}?"),
        )  # fmt: skip


def _add_angle(each: LoggedTrack, source: dict[str, Any], entry: dict[str, Any], draft: Draft) -> None:
    """An angle beside a track in two axes."""
    if (part := each.track.angle) is not None:
        (entry["angle"],) = add_columns([part], source)
        turned = float(np.nanmax(np.abs(numbers_of_parts(each.table, [part]))))
        entry["angle_unit"] = "deg" if turned > 4 * np.pi else "rad"
        draft.note("bodies.track.angle", "the number behind x and y", f"is it in {entry['angle_unit']}?")
        return
    for name in each.table.columns:
        told, values = meaning(name), numbers_of(each.table, name)
        if told.quantity != "position" or name in each.track.used or values is None or values.ndim != 1:
            continue
        (entry["angle"],) = add_columns([Component(name)], source)
        unit = told.unit if told.unit in ("rad", "deg") else ""
        guess = "deg" if float(np.nanmax(np.abs(values))) > 4 * np.pi else "rad"
        entry["angle_unit"] = unit or guess
        question = "" if unit else f"is {name!r} in {guess}?"
        draft.note("bodies.track.angle", f"{name!r} beside the position", question)
        return


def _describe_up(chosen: SeenTrack, fall: FreeFall | None, maybe_pushed: bool, draft: Draft) -> None:
    axes, key = chosen.each.track.axes, "bodies.gravity"
    if fall is not None:
        letter = axes[fall.axis]
        gravity = [0.0, 0.0, 0.0]
        gravity["xyz".index(letter)] = -G * fall.up
        sign = "+" if fall.up > 0 else "-"
        question = ""
        if fall.lean > SURE_LEAN:
            lean = float(np.degrees(fall.lean))
            question = f"gravity leans by {lean:.0f} degrees from {letter}: is it {sign}{letter} up?"
        elif maybe_pushed:
            question = f"it stays in a plane along {letter}: is {sign}{letter} up, or was it pushed there?"
        draft.note(key, f"{sign}{letter} is up: that is where what is tossed comes back from", question)
        draft.bodies["gravity"], draft.falls = gravity, True
        return
    if chosen.curve is not None:
        axis, up = chosen.curve
        gravity = [0.0, 0.0, 0.0]
        gravity["xyz".index(axes[axis])] = -G * up
        sign = "+" if up > 0 else "-"
        draft.note(key, f"{sign}{axes[axis]} is up: what is tossed comes back from there, in whatever unit")
        draft.bodies["gravity"] = gravity  # not proven by 9.81 m/s^2: what is carried bends its path, too
        return
    if "z" in axes:
        letter, up, why = _guess_up(chosen)
        draft.bodies["gravity"] = [-G * up * (letter == axis) + 0.0 for axis in "xyz"]
        sign = "+" if up > 0 else "-"
        draft.note(
            key, f"nothing falls in this track, so nothing tells which way is up{why}",
            f"is {sign}{letter} up? Else write gravity in the track's axes [m/s^2], and the support's normal"
            " against it; on an incline gravity has two components",
        )  # fmt: skip
        return
    draft.note(
        key, f"the track has {' and '.join(axes)} alone, and nothing falls along them",
        "is it a level plane seen from above? Else state `incline` (degrees, +x downhill), or `gravity`",
    )  # fmt: skip


def _guess_up(chosen: SeenTrack) -> tuple[str, int, str]:
    """The axis that is likely up in a track where nothing falls, its sign, and why."""
    each = chosen.each
    words = {word for name in (*each.track.used, each.path.stem, each.part) for word in words_in(name)}
    down = -1 if words & DOWNWARDS else 1
    if (across := plane_across(chosen)) is not None:
        letter = each.track.axes[across]
        return letter, down if letter == "z" else 1, f"; it stays in a plane across {letter}"
    if each.table.maker == "Motive" and not down < 0:
        return "y", 1, "; Motive's y is up unless it was exported otherwise"
    return "z", down, ""


def _describe_contact(runs: Sequence[SeenTrack], fall: FreeFall | None, draft: Draft) -> None:
    """Whether the body touches something, and what would have to be stated of it."""
    key, gravity = "bodies.support", np.asarray(draft.bodies.get("gravity", [0.0, 0.0, -G]))
    up = -gravity / G
    if fall is None and runs[0].curve is not None:
        draft.note(key, "it falls; what it touches is not looked for while the unit is open")
        return
    if fall is None:
        draft.bodies["support"] = {"normal": [float(x) + 0.0 for x in up]}
        words = {*runs[0].each.words, *words_in(runs[0].each.path.stem)}
        question = ROLLS.format(", ".join(sorted(words & ROUND))) if words & ROUND else ""
        draft.note(
            key, "what does not fall slides; no coefficient is stated, so it is solved for and not judged:"
            " write `friction` beside `normal` to have yours judged", question,
        )  # fmt: skip
        return
    along = np.array([up["xyz".index(a)] for a in runs[0].each.track.axes])
    touching = sum(contact_seconds(run, fall, along) for run in runs[:MOST_RUNS])
    if not touching:
        draft.note(
            key, "it flies, and nothing is stated of what it hits: rebounds, rest and hands are left out;"
            " write `support: {normal: ..., restitution: ...}` to have rebounds judged",
        )  # fmt: skip
        return
    draft.bodies["support"] = {"normal": [float(x) + 0.0 for x in up]}
    draft.note(
        key, f"it moves on something for {touching:.2g} s; friction and restitution that nobody states are"
        " solved for and not judged: write them beside `normal` to have yours judged",
        "what is its shape? Write `body: {box: [a, b, c]}`, `{sphere: radius}` or `{cylinder: [radius,"
        " height]}` in m: a ball rolls, and a box that tumbles is mistaken for one that flies. A puck needs"
        " none",
    )  # fmt: skip


def _add_recordings(runs: Sequence[SeenTrack], draft: Draft) -> None:
    """One, or one for each file; which are held out is left to the import."""
    paths = [run.each.path for run in runs]
    if len(runs) == 1:
        draft.recordings = [{"name": paths[0].stem}]
        return
    if all(run.each.run for run in runs) and len(set(paths)) == 1:
        draft.note("recordings", f"{len(runs)} groups with the same columns: motions of one body")
        draft.sources["track"]["part"] = "{name}"
        draft.recordings = [{"name": run.each.run} for run in runs]
        return
    suffix = paths[0].suffix
    if any(path.suffix != suffix or path.parent != paths[0].parent for path in paths):
        raise InputError(f"files of one body lie in several folders or are of several kinds: {paths[0]}, ...")
    draft.note("recordings", f"{len(paths)} files with the same columns: motions of one body")
    if set(paths) == set(paths[0].parent.glob(f"*{suffix}")):
        draft.recordings = [{"glob": f"*{suffix}"}]
        del draft.sources["track"]["file"]
        return
    draft.recordings = [{"name": path.stem} for path in paths]
    draft.sources["track"]["file"] = f"{{name}}{suffix}"
