"""Which files of a folder are one run: a target's and a flange's poses under one name."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from samrl_ros.log_import.draft.tracks.logged_tracks import LoggedTrack

_WORD = re.compile(r"[^\W_]+")  # of a file's name


@dataclass(frozen=True, eq=False)
class PoseRuns:
    """Runs of one chain, alike in their columns."""

    names: tuple[str, ...]
    seen: tuple[LoggedTrack, ...]
    carried: tuple[LoggedTrack, ...]
    files: tuple[str, str]  # of the target and of the flange, with {name}


def find_pose_runs(placed: Sequence[LoggedTrack], side: Callable[[LoggedTrack], int]) -> PoseRuns | None:
    """Runs of the poses of several files; None where they are not alike, or are one run.

    Args:
        placed: every pose.
        side: 1 of a target's, -1 of a flange's, 0 where nothing says it.
    """
    seen, carried = _sides(placed, side)
    alike = len({tuple(e.track.used) for e in seen}) == len({tuple(e.track.used) for e in carried}) == 1
    whole = len(seen) == len(carried) > 1 and len(seen) + len(carried) == len(placed)
    parts = {(side, each.part) for side, group in enumerate((seen, carried)) for each in group if each.part}
    labels = all(each.csv.label for each in placed if each.part) and len(parts) < 2
    if not (alike and whole) or not labels:
        return None
    if len({each.path.parent for each in placed}) > 1:
        return _by_folder(seen, carried)
    if [each.path for each in seen] == [each.path for each in carried]:
        names = tuple(each.path.stem for each in seen)
        file = f"{{name}}{seen[0].path.suffix}"
        return PoseRuns(names, tuple(seen), tuple(carried), (file, file)) if len(set(names)) > 1 else None
    for cut in (_before_common_end, _after_common_begin):
        one, file = cut([each.path.stem for each in seen])
        other, other_file = cut([each.path.stem for each in carried])
        if sorted(one) == sorted(other) and all(one) and len(set(one)) == len(one):
            by_name = dict(zip(other, carried, strict=True))
            files = (file + seen[0].path.suffix, other_file + carried[0].path.suffix)
            return PoseRuns(tuple(one), tuple(seen), tuple(by_name[name] for name in one), files)
    return None


def _by_folder(seen: Sequence[LoggedTrack], carried: Sequence[LoggedTrack]) -> PoseRuns | None:
    """Runs in a folder each, with files of the same names; None where they are not."""
    names = [each.path.parent.name for each in seen]
    files = [{each.path.name for each in side} for side in (seen, carried)]
    together = len({each.path.parent.parent for each in (*seen, *carried)}) == 1
    if not together or any(len(each) != 1 for each in files) or len(set(names)) < len(names):
        return None
    by_name = {each.path.parent.name: each for each in carried}
    if sorted(by_name) != sorted(names):
        return None
    one, other = (f"{{name}}/{file}" for (file,) in files)
    return PoseRuns(tuple(names), tuple(seen), tuple(by_name[name] for name in names), (one, other))


def one_of_each_side(
    placed: Sequence[LoggedTrack], side: Callable[[LoggedTrack], int]
) -> tuple[list[LoggedTrack], str]:
    """Of several targets that every file shows the one that was seen most often, and what to ask.

    Args:
        placed: every pose.
        side: as `find_pose_runs`.
    """
    kept, asked = list(placed), []
    for each_side in (1, -1):
        by_file: dict[object, dict[object, LoggedTrack]] = {}
        for each in placed:
            if side(each) == each_side:
                by_file.setdefault(each.path, {})[each.part, tuple(each.track.used)] = each
        keys = [tuple(group) for group in by_file.values()]
        labelled = any(each.csv.label for group in by_file.values() for each in group.values())
        common = [key for key in keys[0] if all(key in group for group in keys)] if keys else []
        if not common or max(map(len, keys)) < 2 or not (len(keys) > 1 or labelled):
            continue
        best = max(common, key=lambda key: sum(_count_seen(group[key]) for group in by_file.values()))
        chosen = [group[best] for group in by_file.values()]
        others = [each for group in by_file.values() for each in group.values() if each not in chosen]
        kept = [each for each in kept if each not in others]
        names = ", ".join(dict.fromkeys(each.name for each in others if each.path == chosen[0].path))
        asked.append(f"is it {chosen[0].name}, and not {names}?")
    return kept, " ".join(asked)


def _count_seen(each: LoggedTrack) -> int:
    return int(np.isfinite(each.position).all(axis=1).sum())


def _sides(
    placed: Sequence[LoggedTrack], side: Callable[[LoggedTrack], int]
) -> tuple[list[LoggedTrack], list[LoggedTrack]]:
    """Poses of targets and of flanges; where names do not say it of all, those of two layouts, by likelihood.

    Two trackers write the same layout: run1_left, run1_right, run2_left, ... are two ends, by their names.
    Who is who is then asked; which files are one run is told by their names alone.
    """
    seen, carried = ([each for each in placed if side(each) == s] for s in (1, -1))
    layouts: dict[tuple[str, ...], list[LoggedTrack]] = {}
    for each in placed:
        layouts.setdefault(tuple(each.track.used), []).append(each)
    if len(seen) + len(carried) == len(placed):
        return seen, carried
    groups = list(layouts.values()) if len(layouts) == 2 else _by_word(placed)
    if len(groups) != 2:
        return seen, carried
    first, second = sorted(groups, key=lambda group: -sum(map(side, group)))
    return first, second


def _by_word(placed: Sequence[LoggedTrack]) -> list[list[LoggedTrack]]:
    """Poses by the word that their files' names end or else begin with; empty where that makes no two sides.

    A word of letters: the 1 and 2 of `run_1` and `run_2` count runs and name no tracker.
    """
    words = [_WORD.findall(each.path.stem) or [""] for each in placed]
    for end in (-1, 0):
        groups: dict[str, list[LoggedTrack]] = {}
        rests: dict[str, list[tuple[str, ...]]] = {}
        for each, said in zip(placed, words, strict=True):
            groups.setdefault(said[end], []).append(each)
            rests.setdefault(said[end], []).append(tuple(said[:-1] if end else said[1:]))
        one_run, *others = (sorted(rest) for rest in rests.values())
        if len(groups) == 2 and others == [one_run] and all(word.isalpha() for word in groups):
            return list(groups.values())
    return []


def _before_common_end(stems: Sequence[str]) -> tuple[list[str], str]:
    """Names without what all end with, and the pattern of the whole: run1_tag, run2_tag."""
    tail = _common_begin([stem[::-1] for stem in stems])[::-1]
    return [stem[: len(stem) - len(tail)] for stem in stems], f"{{name}}{tail}"


def _after_common_begin(stems: Sequence[str]) -> tuple[list[str], str]:
    """Likewise of what all begin with: tag_1, tag_2."""
    head = _common_begin(stems)
    return [stem[len(head) :] for stem in stems], f"{head}{{name}}"


def _common_begin(stems: Sequence[str]) -> str:
    """What all begin with, letter by letter."""
    first, last = min(stems), max(stems)
    count = next(
        (k for k, (a, b) in enumerate(zip(first, last, strict=False)) if a != b), min(map(len, stems))
    )
    return first[:count]
