"""Drafts a mapping of poses: which track is the target, which the flange, and what the poses prove.

Who carries the camera and how a quaternion is ordered shows in the poses: the chain closes to millimetres
with the right description, to decimetres with a wrong one. That a track is not its inverse does not show: a
camera on the flange is as good as a still one whose log gives poses the other way round. Names say it, or the
user is asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.poses.seen_size import SeenSize, best_size
from samrl_ros.log_import.draft.column_names import BASES, CAMERAS, CARRIED, SEEN, words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.poses.aligned_source import align_flange
from samrl_ros.log_import.draft.poses.descriptions import (
    CLEARLY,
    Description,
    close_descriptions,
    is_base_in_flange,
    is_inverse,
    list_descriptions,
)
from samrl_ros.log_import.draft.poses.pose_turns import LEAST_TURN, second_turn
from samrl_ros.log_import.draft.tracks.angle_names import are_makers_letters
from samrl_ros.log_import.draft.tracks.logged_tracks import LoggedTrack
from samrl_ros.log_import.draft.tracks.pose_runs import PoseRuns, find_pose_runs, one_of_each_side
from samrl_ros.log_import.draft.tracks.pose_tracks import lettered_frames
from samrl_ros.log_import.draft.tracks.track_entries import (
    FAR,
    FoundTime,
    add_track_entry,
    add_track_source,
    every_nth,
    find_time,
    length_unit,
    repeats_time,
    source_data,
    track_numbers,
)
from samrl_ros.log_import.draft.tracks.transform_chains import FoundChains
from samrl_ros.log_import.formats.views import STAR, is_of_views
from samrl_ros.log_import.pose_importer import SLOW_HZ
from samrl_ros.log_import.sources import SourceData

NOTHING_M = 1e-4  # that two descriptions must differ by at least: poses that stand still close any chain
LONGEST_REST_S = 600.0  # from one pair of poses at rest to the next
CLOSES_M = 0.05  # beyond it no description fits
MOST_SIZED = 4  # descriptions, of which a size of the target is tried
MOST_VIEWS = 300  # by which descriptions are compared
MOST_CM = 250.0  # that a camera sees or an arm reaches


def draft_poses(
    tracks: Sequence[LoggedTrack], frames: tuple[FoundChains, PoseRuns | None] | None = None
) -> Draft | None:
    """A draft of a log that holds a target's poses and a flange's; None of any other log.

    Args:
        tracks: poses of the log.
        frames: what a bag's tree of frames says instead, if it says something.

    Raises:
        InputError: the two cannot be compared.
    """
    chains, runs = frames or (None, None)
    placed, asked = one_of_each_side([each for each in tracks if each.track.whole], side_of)
    if chains is not None:
        placed, asked = [chains.seen, chains.carried], ""
    if len(placed) < 2:
        return None
    draft = Draft(about="Drafted by samrl bag draft. Every entry has its reason beside it; check them.")
    runs = find_pose_runs(placed, side_of) if chains is None else runs
    used = placed if runs is None else [runs.seen[0], runs.carried[0]]
    seen, carried = _roles(used, asked, draft) if chains is None else _told_roles(chains, draft)
    draft.unused += [each.name for each in used if each is not seen and each is not carried]
    keys = {"target": seen} | ({"flange": carried} if carried.place != seen.place else {})
    times = {key: add_pose_source(key, each, (seen, carried), draft) for key, each in keys.items()}
    at_rest = any(slow for _, slow in times.values())
    entries = {
        "seen": add_track_entry(seen, "target", draft),
        "carried": add_track_entry(carried, list(keys)[-1], draft),
    }
    cache = {key: source_data([each], draft.sources[key], times[key][0]) for key, each in keys.items()}
    if len(cache) > 1 and not at_rest:
        cache["flange"] = align_flange(cache, entries, runs is not None, draft)
    if len(cache) > 1:  # where views stand for themselves, some tell as much as all
        cache["target"] = every_nth(cache["target"], MOST_VIEWS)
    _ask_of_units({"target_in_camera": seen, "flange": carried}, draft)
    _describe(seen, carried, entries, at_rest, cache, draft, chains)
    if runs is not None:
        _add_runs(runs, draft)
        return draft
    names = list(dict.fromkeys(_named(each.path) for each in (seen, carried)))
    draft.recordings = [{"name": names[0] if len(names) == 1 else common_name(names), "role": "fit"}]
    return draft


def _named(path: Path) -> str:
    """A recording's name by its file; of a file per view by their folder."""
    if is_of_views(path):
        return (path.parent.parent if STAR in path.parent.name else path.parent).name or "views"
    return path.stem


def _add_runs(runs: PoseRuns, draft: Draft) -> None:
    """One recording for each run; the last is held out."""
    for source, file in zip(draft.sources.values(), runs.files, strict=False):
        source["file"] = file
    for source, side in zip(draft.sources.values(), (runs.seen, runs.carried), strict=False):
        used = [name for each in side for name in each.track.used]
        repeats = any(repeats_time(found) for each in side if (found := find_time(each, used)) is not None)
        if repeats and "repeated" not in source.get("time", {"repeated": ""}):
            source["time"] = {**source["time"], "repeated": "drop"}
            draft.note("recordings", "in some a stamp stands twice; such rows are left out")
    if any(not np.isfinite(track_numbers(each)).all() for each in (*runs.seen, *runs.carried)):
        for source in draft.sources.values():
            source["missing"] = "drop_row"
    draft.note("recordings", "files with the same columns: one chain; the last by name is held out")
    last = len(runs.names) - 1
    draft.recordings = [
        {"name": name, "role": "held_out" if k == last else "fit"} for k, name in enumerate(runs.names)
    ]


def are_roles_sure(tracks: Sequence[LoggedTrack]) -> bool:
    """Whether names say that one track is a target's and another a flange's."""
    told = {side_of(each) for each in tracks if each.track.whole}
    return {1, -1} <= told


def side_of(each: LoggedTrack) -> int:
    """1 of what a camera sees, -1 of what an arm carries, 0 where no name says it."""
    if each.role:
        return each.role
    if each.is_camera_in_map:
        return 1
    if each.is_camera_in_world:
        return -1
    words = each.words | set().union(*each.frames or ())
    if not each.track.stem and each.track.named:  # rvec_x, tvec_x; X, Y, Z, A, B, C
        words |= {word for name in each.track.used for word in words_in(name)}
        words |= {"robot"} if are_makers_letters(each.track.used) else set()
    return bool(words & SEEN) - bool(words & CARRIED and not words & SEEN)


def _roles(placed: list[LoggedTrack], asked: str, draft: Draft) -> tuple[LoggedTrack, LoggedTrack]:
    """The target's poses and the flange's, by their names; `asked` of others that were left out."""
    # A world in the camera beside a flange is a board, beside an object in the camera it is what moves that.
    ranked = sorted(placed, key=lambda each: (side_of(each), each.is_camera_in_world), reverse=True)
    seen, carried = ranked[0], ranked[-1]
    sure = side_of(seen) > 0 > side_of(carried) and len(placed) == 2
    question = asked if sure else f"is it the target as the camera sees it, and {carried.name} the flange's?"
    draft.note("poses.target_in_camera", f"{seen.name}: {'by its name' if sure else 'a guess'}", question)
    return seen, carried


def _told_roles(chains: FoundChains, draft: Draft) -> tuple[LoggedTrack, LoggedTrack]:
    """Likewise where a bag's tree of frames tells them."""
    said = f"{chains.seen.name}, and the flange {chains.carried.name}: by the bag's frames"
    draft.note("poses.target_in_camera", said, chains.question)
    draft.unused += chains.unused
    return chains.seen, chains.carried


def add_pose_source(
    key: str, each: LoggedTrack, both: Sequence[LoggedTrack], draft: Draft
) -> tuple[np.ndarray, bool]:
    """A file with its time; times (N,) [s] of its rows, and whether poses were taken at rest."""
    source, path = add_track_source(key, each, draft), f"sources.{key}.time"
    found = find_time(each, [name for one in both for name in one.track.used])
    if found is None or are_numbered(both):
        said = "no column is named as time" if found is None else "the first column counts the pairs"
        draft.note(path, f"{said}: rows are pairs, taken at rest")
        return np.arange(float(len(each.position))), True
    unit, step = found.units[0], _typical_step(found)
    # Poses at rest may be seconds apart: steps of 1 are as good 1 s as 1 ms.
    open_ = len(found.units) != 1 or (unit != "s" and 1.0 / SLOW_HZ < step < LONGEST_REST_S)
    named = found.entry.get("column")
    question = f"is {named!r} in {unit}, and not in s?" if open_ and not found.proof else ""
    draft.note(path, found.proof or f"{named!r} in {unit}: steps of {step:g}", question)
    if found.entry:
        plain = found.entry.get("iso") or "nanoseconds" in found.entry
        source["time"] = found.entry if plain else {**found.entry, "unit": unit}
    time = found.seconds(unit)
    if "time" in source and (backwards := repeats_time(found)):
        source["time"] = {**source["time"], "repeated": "drop"}
        draft.note(path, f"{backwards} steps do not increase; such rows are left out")
    return time, bool(np.nanmedian(np.diff(time)) > 1.0 / SLOW_HZ)


def draft_pairs(tracks: Sequence[LoggedTrack]) -> Draft | None:
    """A draft of two files without times whose rows are pairs: poses that close a chain are no free body's.

    Returns:
        None where there are no two such files, or where their rows close no chain.
    """
    placed = [each for each in tracks if each.track.whole]
    if len(placed) != 2 or len(tracks) != 2 or len({each.path for each in placed}) != 2:
        return None
    same = len(placed[0].position) == len(placed[1].position)
    timed = any(find_time(each, each.track.used) is not None for each in placed)
    if not same or (timed and not are_numbered(placed)):
        return None
    try:
        draft = draft_poses(placed)
    except InputError:
        return None
    reach = min(float(np.linalg.norm(np.nanstd(each.position, axis=0))) for each in placed)
    unit = {"mm": 1e-3, "cm": 1e-2}.get(length_unit(placed[0]), 1.0)
    return draft if draft is not None and draft.closes_m < min(CLOSES_M, unit * reach / CLEARLY) else None


def are_numbered(both: Sequence[LoggedTrack]) -> bool:
    """Whether what stands before the poses of two files without names counts their pairs, as 1, 2, 4, ..."""
    if len(both) != 2 or any(each.track.named for each in both):
        return False
    first, second = (find_time(each, each.track.used) for each in both)
    if first is None or second is None or len(first.values) != len(second.values):
        return False
    values = first.values
    counts = bool((values == second.values).all() and (values == np.round(values)).all())
    return counts and float(np.median(np.diff(values))) == 1.0


def _ask_of_units(tracks: dict[str, LoggedTrack], draft: Draft) -> None:
    """Between cm and mm only a size decides: an arm does not reach far beyond two metres."""
    for key, each in tracks.items():
        farthest = float(np.nanmax(np.abs(each.position)))
        if not each.track.unit and FAR < farthest < MOST_CM:
            draft.note(
                f"poses.{key}", f"numbers up to {farthest:.4g} are no metres", "is the unit mm, and not cm?"
            )


def _typical_step(found: FoundTime) -> float:
    return float(np.nanmedian(np.diff(found.values)))


def _describe(
    seen: LoggedTrack,
    carried: LoggedTrack,
    entries: dict[str, dict[str, Any]],
    at_rest: bool,
    cache: dict[str, SourceData],
    draft: Draft,
    chains: FoundChains | None,
) -> None:
    """Who carries the camera and what the log leaves open, by which description closes the chain."""
    found = close_descriptions(list_descriptions(seen, carried, entries, at_rest, cache, draft))
    if not found:
        raise InputError(
            f"{seen.name} and {carried.name} are no poses of one target and one flange that can be compared;"
            " write the mapping by hand"
        )
    told = [one for one in found if chains is not None and one.arm == chains.arm]
    sized = (told or found)[:MOST_SIZED]
    size, number = best_size([(one.recording, one.closes_m) for one in sized])
    chosen = sized[number]
    reason = f"{chosen.says}: the chain then closes to {1e3 * chosen.closes_m:.1f} mm"
    if told:
        reason = f"the frames say that {reason}"
    elif len(found) > 1 and number == 0:
        reason += f", to {1e3 * found[1].closes_m:.0f} mm if {found[1].says}"
    if size is not None:
        reason += (
            f", to {1e3 * size.closes_m:.1f} mm if all that is seen is {size.factor:.2f} times as far away"
        )
    draft.poses, draft.closes_m = chosen.poses, chosen.closes_m
    question = _asked_of_chain(chosen, found, bool(told), size) or _asked_of_frames(seen, carried, chosen.arm)
    draft.note(f"poses.{chosen.arm}", reason, question)
    if carried.is_camera_in_world and chosen.arm == "camera_arm":
        draft.poses["camera_in_flange"] = {"position": [0.0, 0.0, 0.0], "rpy": [0.0, 0.0, 0.0]}
        draft.note("poses.camera_in_flange", f"{carried.name} is the camera itself, by its letters")
    state(chosen.arm, chains, draft)
    stated = {"camera_in_flange", "camera_in_base"} & set(draft.poses)
    if not stated and (turn := second_turn(chosen.recording)) < LEAST_TURN:
        draft.note(
            "poses", f"the flange turns by no more than {np.degrees(turn):.2f} degrees about a second axis",
            "without turns about two axes it does not show where the camera sits: record some, or state it?",
        )  # fmt: skip


def _asked_of_chain(
    chosen: Description, found: Sequence[Description], is_told: bool, size: SeenSize | None
) -> str:
    """What the chain leaves open of the chosen description; `is_told` where a bag's frames chose it."""
    if size is not None:
        return (
            f"which size was the detector told? {size.factor:.2f} times that size closes the chain"
            f" to {1e3 * size.closes_m:.1f} mm: correct the poses that it gave, or the unit of the arm's"
        )
    if chosen.closes_m > CLOSES_M:
        return "no description closes the chain; are these one target and one flange, in these units?"
    if is_told:
        best = found[0]
        if chosen.closes_m > CLEARLY * best.closes_m + NOTHING_M:
            return f"it closes to {1e3 * best.closes_m:.1f} mm if {best.says}; which of them is it?"
    elif len(found) > 1 and found[1].closes_m < CLEARLY * chosen.closes_m + NOTHING_M:
        return f"is it so, and not that {found[1].says}?"
    return ""


def state(arm: str, chains: FoundChains | None, draft: Draft) -> None:
    """Transforms that a bag's frames give, and what nothing states."""
    wanted = {
        "camera_arm": ["camera_in_flange", "target_in_base"],
        "tool_arm": ["camera_in_base", "target_in_flange"],
    }[arm]
    if chains is not None:
        draft.poses |= chains.stated
        for key, why in chains.reasons.items():
            draft.note(f"poses.{key}" if key in wanted else key, why)
    missing = [key for key in wanted if key not in draft.poses]
    if len(missing) == 1:
        draft.note("poses", f"nothing states {missing[0]}: it is solved for, and its error is nobody's")
        return
    draft.note(
        "poses",
        f"nothing states {' and '.join(missing)}: both are solved for, and only clocks and lasting errors are"
        " then told; write down what your calibration says to have that judged",
    )


def _asked_of_frames(seen: LoggedTrack, carried: LoggedTrack, arm: str) -> str:
    """What only names say: that no track is given the other way round."""
    if carried.is_camera_in_world and lettered_frames(seen.track.stem):
        return ""
    if seen.frames and carried.frames:
        (child, parent), (flange, base) = seen.frames, carried.frames
        told = seen.of_frames or is_inverse(seen) or (parent & CAMERAS and not child & CAMERAS)
        if told and (carried.of_frames or (base & BASES and not flange & BASES)):
            return ""
    other = "stands still" if arm == "camera_arm" else "rides on the arm"
    turned = {seen.name: is_inverse(seen), carried.name: is_base_in_flange(carried)}
    names = " and ".join(name for name, is_turned in turned.items() if is_turned)
    if names:
        return (
            f"by the order of its frames {names} is taken as inverse: is that so? Without `inverse` the"
            f" camera {other}"
        )
    if arm == "camera_arm" and "robot" in carried.words and {"tracking", "optical"} & set(seen.words):
        return (
            "was the camera on the arm (eye in hand)? Where it stood still, easy_handeye logs the base in the"
            " flange: then write `tool_arm` for `camera_arm`, with `inverse: true` of its flange"
        )
    return (
        "are these the target in the camera and the flange in its base? If either is given the other way"
        f" round (set `inverse: true`), the camera {other}"
    )


def common_name(names: Sequence[str]) -> str:
    """What names of files begin with alike."""
    shared = names[0]
    for name in names[1:]:
        while not name.startswith(shared):
            shared = shared[:-1]
    return shared.rstrip("_-. ") or "poses"
