"""Drafts a mapping of poses: which track is the target, which the flange, and what the poses prove.

Who carries the camera and how a quaternion is ordered shows in the poses: the chain closes to millimetres
with the right description, to decimetres with a wrong one. That a track is not its inverse does not show: a
camera on the flange is as good as a still one whose log gives poses the other way round. Names say it, or the
user is asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.poses.solve import closing_error
from samrl_ros.log_import.draft import evidence
from samrl_ros.log_import.draft.column_names import is_time, meaning
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.logged_poses import LoggedPose, read_logged_poses
from samrl_ros.log_import.draft.pose_tracks import position_of
from samrl_ros.log_import.pose_importer import SLOW_HZ, import_poses
from samrl_ros.log_import.pose_specs import PoseRecordingSpec

SEEN = frozenset(
    "tag tags marker markers target aruco apriltag april board charuco checkerboard chessboard object cam"
    " camera detection detected vision optical pattern".split()
)
CARRIED = frozenset(
    "robot flange ee eef tcp tool tool0 gripper hand effector fk arm wrist base link7 link8 body".split()
)
CAMERAS = frozenset("cam camera optical rgb".split())
BASES = frozenset("base world link0 root origin".split())
FAR = 20.0  # of a position: no arm and no camera is so far off in metres
CLEARLY = 4.0  # times better than the next description: that is proof
NOTHING_M = 1e-4  # that two descriptions must differ by at least: poses that stand still close any chain
LONGEST_REST_S = 600.0  # from one pair of poses at rest to the next
CLOSES_M = 0.05  # beyond it no description fits
FULL_TURN = 2.0 * np.pi + 0.1
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def draft_poses(paths: Sequence[Path]) -> Draft | None:
    """A draft of a log that holds a target's poses and a flange's; None of any other log.

    Raises:
        InputError: a file that cannot be read.
    """
    placed = read_logged_poses(paths)
    if placed is None or len(placed) < 2:
        return None
    draft = Draft(about="Drafted by samrl bag draft. Every entry has its reason beside it; check them.")
    seen, carried = _roles(placed, draft)
    draft.unused += [each.name for each in placed if each is not seen and each is not carried]
    at_rest = _add_sources(seen, carried, draft)
    tracks = {"seen": _entry(seen, draft), "carried": _entry(carried, draft)}
    _describe(seen, carried, tracks, at_rest, draft)
    names = list(dict.fromkeys(each.path.stem for each in (seen, carried)))
    draft.recordings = [{"name": names[0] if len(names) == 1 else _common(names), "role": "fit"}]
    return draft


def _roles(placed: list[LoggedPose], draft: Draft) -> tuple[LoggedPose, LoggedPose]:
    """The target's poses and the flange's, by their names."""

    def says(each: LoggedPose) -> int:
        words = each.words | set().union(*each.frames or ())
        return bool(words & SEEN) - bool(words & CARRIED and not words & SEEN)

    ranked = sorted(placed, key=says, reverse=True)
    seen, carried = ranked[0], ranked[-1]
    sure = says(seen) > 0 > says(carried) and len(placed) == 2
    question = "" if sure else f"is it the target as the camera sees it, and {carried.name} the flange's?"
    draft.note("poses.target_in_camera", f"{seen.name}: {'by its name' if sure else 'a guess'}", question)
    return seen, carried


def _add_sources(seen: LoggedPose, carried: LoggedPose, draft: Draft) -> bool:
    """The files with their times; whether poses were taken at rest."""
    at_rest = False
    for key, each in {"target": seen, "flange": carried}.items():
        if key == "flange" and (each.path, each.part) == (seen.path, seen.part):
            continue
        source: dict[str, Any] = {"file": each.path.name}
        if each.part:
            source["part"] = each.part
        used = {n for one in (seen, carried) for names in one.track.columns.values() for n in names}
        times = [n for n in each.table.columns if is_time(n) and n not in used]
        path = f"sources.{key}.time"
        if each.table.time is not None:
            draft.note(path, "the log's own")
            at_rest |= _slow(each.table.time)
        elif times:
            values = np.asarray(each.table.numbers(times[0], "the log"))
            said = meaning(times[0]).unit
            units = evidence.time_unit(np.diff(values))
            unit = said if said in _SECONDS else (units[0] if units else "s")
            step = float(np.median(np.diff(values)))
            # Poses at rest may be seconds apart: steps of 1 are as good 1 s as 1 ms.
            open_ = len(units) != 1 or (unit != "s" and 1.0 / SLOW_HZ < step < LONGEST_REST_S)
            question = f"is {times[0]!r} in {unit}, and not in s?" if open_ and said not in _SECONDS else ""
            draft.note(path, f"{times[0]!r} in {unit}: steps of {step:g}", question)
            source["time"] = {"column": times[0], "unit": unit}
            at_rest |= _slow(values * _SECONDS[unit])
        else:
            draft.note(path, "no column is named as time: rows are pairs, taken at rest")
            at_rest = True
        source["columns"] = {}
        draft.sources[key] = source
    return at_rest


def _slow(time: np.ndarray) -> bool:
    return bool(np.median(np.diff(time)) > 1.0 / SLOW_HZ)


def _entry(each: LoggedPose, draft: Draft) -> dict[str, Any]:
    """A track as the mapping names it, as far as its own names and numbers say."""
    key = next(
        k for k, s in draft.sources.items() if (s["file"], s.get("part", "")) == (each.path.name, each.part)
    )
    columns: dict[str, str] = draft.sources[key]["columns"]
    entry: dict[str, Any] = {"source": key}
    for kind, names in each.track.columns.items():
        if kind not in ("position", each.track.rotation):
            continue
        formulas = []
        for name in names:
            short = "".join(c if c.isalnum() else "_" for c in name)
            short = short if short.isidentifier() else f"c_{short}"
            columns[short] = name
            formulas.append(short)
        entry[kind] = formulas if len(formulas) > 1 else formulas[0]
    entry["unit"] = each.track.unit or (
        "mm" if np.abs(position_of(each.table, each.track)).max() > FAR else "m"
    )
    if each.track.rotation in ("rpy", "rotation_vector"):
        parts = [
            np.asarray(each.table.numbers(n, "the log")) for n in each.track.columns[each.track.rotation]
        ]
        turned = max(float(np.abs(p).max()) for p in parts)
        entry["angle_unit"] = each.track.angle_unit or ("deg" if turned > FULL_TURN else "rad")
    return entry


def _describe(
    seen: LoggedPose, carried: LoggedPose, tracks: dict[str, dict[str, Any]], at_rest: bool, draft: Draft
) -> None:
    """Who carries the camera and what the log leaves open, by which description closes the chain."""
    options = [
        ("order", ("xyzw", "wxyz")) if t.track.rotation == "quaternion" and not t.track.order else None
        for t in (seen, carried)
    ]
    found: list[tuple[float, dict[str, Any], str]] = []
    for arm, first, second in product(("camera_arm", "tool_arm"), *(o[1] if o else ("",) for o in options)):
        one, two = dict(tracks["seen"]), dict(tracks["carried"])
        for entry, order in ((one, first), (two, second)):
            if order:
                entry["order"] = order
        poses: dict[str, Any] = {"target_in_camera": one, arm: {"flange": two}}
        if at_rest:
            poses["at_rest"] = True
        said = "the arm carries the camera" if arm == "camera_arm" else "the camera stands still"
        said += "".join(f", {o} quaternions" for o in dict.fromkeys((first, second)) if o)
        if (left := _closing(poses, seen, draft)) is not None:
            found.append((left, poses, said))
    if not found:
        raise InputError(
            f"{seen.name} and {carried.name} are no poses of one target and one flange that can be compared;"
            " write the mapping by hand"
        )
    found.sort(key=lambda one: one[0])
    left, poses, said = found[0]
    arm = next(key for key in ("camera_arm", "tool_arm") if key in poses)
    reason = f"{said}: the chain then closes to {1e3 * left:.1f} mm"
    if len(found) > 1:
        reason += f", to {1e3 * found[1][0]:.0f} mm if {found[1][2]}"
    draft.poses = poses
    if left > CLOSES_M:
        question = "no description closes the chain; are these one target and one flange, in these units?"
    elif len(found) > 1 and found[1][0] < CLEARLY * left + NOTHING_M:
        question = f"is it so, and not that {found[1][2]}?"
    else:
        question = _asked_of_frames(seen, carried, arm)
    draft.note(f"poses.{arm}", reason, question)
    stated = (
        "camera_in_flange and target_in_base"
        if arm == "camera_arm"
        else "camera_in_base and target_in_flange"
    )
    draft.note(
        "poses",
        f"nothing states {stated}: both are solved for, and only clocks and lasting errors are then told;"
        " write down what your calibration says to have that judged",
    )


def _asked_of_frames(seen: LoggedPose, carried: LoggedPose, arm: str) -> str:
    """What only names say: that no track is given the other way round."""
    if seen.frames and carried.frames:
        (child, parent), (flange, base) = seen.frames, carried.frames
        if parent & CAMERAS and not child & CAMERAS and base & BASES and not flange & BASES:
            return ""
    other = "stands still" if arm == "camera_arm" else "rides on the arm"
    return (
        "are these the target in the camera and the flange in its base? If either is given the other way"
        f" round (set `inverse: true`), the camera {other}"
    )


def _closing(poses: dict[str, Any], seen: LoggedPose, draft: Draft) -> float | None:
    """Of one description [m]; None where it cannot be read or solved."""
    content = {"name": "drafted", "sources": draft.sources, "poses": poses}
    try:
        spec = PoseRecordingSpec.read(content, "draft")
        return closing_error(import_poses(spec, "", seen.path.parent, seen.path.parent).recording)
    except InputError:
        return None


def _common(names: Sequence[str]) -> str:
    """What names of files begin with alike."""
    shared = names[0]
    for name in names[1:]:
        while not name.startswith(shared):
            shared = shared[:-1]
    return shared.rstrip("_-. ") or "poses"
