"""Drafts a mapping of depth images of a plane: scale, intrinsics, and how far the plane was.

A factor of some per cent is what is looked for, so the unit shows where a distance is known: half a metre is
500, 2500 or 0.5 whatever the camera is off by. Where nothing says how far the plane was, nothing can be told.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file, is_folder
from samrl_ros.log_import.draft.column_names import is_time, words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.places import named
from samrl_ros.log_import.draft.readings.plane_of_pose import plane_formulas
from samrl_ros.log_import.draft.readings.reading_draft import says_truth
from samrl_ros.log_import.draft.text_layout import stated_options, text_options
from samrl_ros.log_import.draft.tracks.pose_tracks import find_tracks
from samrl_ros.log_import.formats.depth_images import (
    OWN,
    STACKS,
    arrays_in,
    beside_stack,
    distance_in,
    image_files,
    images_in,
    is_depth_file,
    match_rows,
    stack_of,
    stacks_in,
)
from samrl_ros.log_import.formats.intrinsics import Intrinsics, of_matrix, read_cameras
from samrl_ros.log_import.formats.parquet import is_lerobot
from samrl_ros.log_import.formats.point_clouds import CAMERA as CLOUD_CAMERA
from samrl_ros.log_import.formats.point_clouds import SUFFIXES as CLOUDS
from samrl_ros.log_import.formats.rosbag import is_bag
from samrl_ros.log_import.pose_specs import LENGTHS
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table
from samrl_ros.log_import.tables import RARELY_LOGS, SUFFIXES, TEXT_SUFFIXES, read_table

SCALES = (1000.0, 5000.0, 10000.0, 4000.0, 1.0)  # raw numbers of a metre that cameras and data sets use
OFF = 0.1  # by which a depth may be off where its unit is to be told
CENTRAL = 0.2, 0.8  # share of the image's size within which the optical axis is
SURFACES = 3  # of an image that may be a board's: a wall and a table are often larger
MIDDLE = 0.25  # of the image, whose depth stands for the plane's


def draft_depth_images(paths: Sequence[Path]) -> Draft | None:
    """A draft of one folder or stack of depth images, or several alike; None where there are none.

    Raises:
        InputError: images that are no depth, or cannot be read.
    """
    paths = [named(path) for path in paths]
    if len(paths) == 1 and is_folder(paths[0]) and not _holds_images(paths[0]):
        paths = _stacks_of(paths[0])
    if not paths or not all(_holds_images(path) for path in paths):
        return None
    path, draft = (
        paths[0],
        Draft(about="Drafted by samrl bag draft. Every entry has its reason beside it; check them."),
    )
    folder = path if is_folder(path) else path.parent
    names, middle, width, height = _look(path)
    images: dict[str, Any] = {}
    columns: dict[str, str] = {"reading": "plane_distance"}
    source = draft.sources["log"] = {
        "file": path.name,
        "images": images,
        "columns": columns,
        "missing": "drop_row",
    }
    reference, stated = _reference(path, folder, names, images, source, draft)
    cameras = read_cameras([folder, *([folder.parent] if is_folder(path) else [])])
    scale = next((c for c in cameras if c.per_metre is not None), None)
    said = (None, "") if scale is None else (scale.per_metre, scale.path.name)
    images |= {"per_metre": _per_metre(middle, stated, said, path, draft)}
    images |= asdict(_intrinsics(path, [c for c in cameras if c.intrinsics], width, height, draft))
    draft.readings = {"quantity": "depth", "reading": "reading", "reference": reference, "unit": "m"}
    which = "the image's plane"
    if "surfaces" in images:
        draft.readings |= {"image": "image", "surface": "surface"}
        which = f"one of its {SURFACES} largest planes; the one nearest to the board's pose counts"
    draft.note("readings", f"each part of an image is a reading, where most of its depth is on {which}")
    draft.recordings = [{"name": each.stem, "role": "fit", "files": {"log": each.name}} for each in paths]
    if len(paths) > 1:
        draft.recordings[-1]["role"] = "held_out"
    else:
        del draft.recordings[0]["files"]
    return draft


def _holds_images(path: Path) -> bool:
    if is_folder(path) and not is_bag(path) and not is_lerobot(path):
        files = image_files(path)
        suffixes = {file.suffix.lower() for file in path.iterdir()}
        # Pictures beside logs are plots and photographs of them.
        return bool(files) and (not suffixes & set(SUFFIXES) - set(RARELY_LOGS) or is_depth_file(files[0]))
    return path.suffix.lower() in STACKS and is_file(path) and stack_of(path, "the log") is not None


def _stacks_of(folder: Path) -> list[Path]:
    """Stacks of images in a folder of nothing else but tables and texts."""
    return [] if is_bag(folder) or is_lerobot(folder) or image_files(folder) else stacks_in(folder)


def _look(path: Path) -> tuple[list[str], np.ndarray, int, int]:
    """Names, median raw depth in the middle (N,), NaN where there is none, width and height of the images."""
    names, middle, shape = [], [], (0, 0)
    for name, image in images_in(path, "the log"):
        shape = image.shape
        down, across = (slice(int((0.5 - MIDDLE / 2) * n), int((0.5 + MIDDLE / 2) * n) + 1) for n in shape)
        part = image[down, across]
        middle.append(float(np.median(part[part > 0])) if (part > 0).any() else np.nan)
        names.append(name)
    if not np.isfinite(middle).any():
        raise InputError(f"{path}: no image holds depth in its middle, only zeros; was depth switched on?")
    return names, np.array(middle), shape[1], shape[0]


def _reference(
    path: Path, folder: Path, names: list[str], images: dict[str, Any], source: dict[str, Any], draft: Draft
) -> tuple[str, np.ndarray | None]:
    """Formula of the plane's distance [m] and its values (N,) by image, where something says them."""
    if path.suffix.lower() == ".npz":
        listed = beside_stack(path, len(names), "the log")
        if found := _listed_distance(listed, list(range(len(names))), source, draft):
            images["list"] = OWN
            return found
    for file in sorted(f for f in folder.iterdir() if f.suffix.lower() in TEXT_SUFFIXES and is_file(f)):
        try:
            options = text_options(file)
            listed = read_table(file, options, "the log")
        except InputError:
            continue
        column = next((n for n, v in listed.columns.items() if _names_images(v, names)), "")
        rows = match_rows(listed, names, column)
        if rows is None:
            continue
        images |= {"list": file.name} | ({"name": column} if column else {})
        if options != CsvOptions():
            images["csv"] = stated_options(options)
        if found := _listed_distance(listed, rows, source, draft):
            return found
        if found := _listed_pose(listed, source, draft):
            source["columns"] |= {"reading": "depth", "image": "image", "surface": "surface"}
            images["surfaces"] = SURFACES
            return found, None
        for key in ("list", "name", "csv"):
            images.pop(key, None)
    named = [distance_in(name) for name in names]
    if all(d is not None for d in named):
        source["columns"]["reference"] = "named_distance"
        draft.note("readings", f"the plane's distance is what names say, such as {names[0]!r}")
        return "reference", np.array(named, dtype=float)
    draft.note(
        "readings", "nothing says how far the plane was",
        "how far was it? Name folders by it (0.8m/), or list `image,distance_m` in a table beside the"
        " images and draft again; at one distance write a number [m] into `reference`",
    )  # fmt: skip
    return "1.0", None


def _names_images(cells: Any, names: list[str]) -> bool:
    stems = {Path(name).stem for name in names}
    return isinstance(cells, pd.Series) and any(Path(str(cell).strip()).stem in stems for cell in cells)


def _listed_distance(
    listed: Table, rows: list[int], source: dict[str, Any], draft: Draft
) -> tuple[str, np.ndarray] | None:
    columns = [n for n in listed.columns if isinstance(listed.columns[n], np.ndarray) and not is_time(n)]
    truths = [n for n in columns if says_truth(n) or set(words_in(n)) & {"dist", "tape", "wall", "plane"}]
    if not truths:
        return None
    name = truths[0]
    source["columns"]["reference"] = name
    values = np.append(np.asarray(listed.columns[name], dtype=float), np.nan)[np.array(rows)]
    said = [unit for unit in LENGTHS if unit in words_in(name)]
    typical = float(np.nanmedian(values))
    known = said or [unit for unit, factor in LENGTHS.items() if 0.1 < factor * typical < 15.0]
    unit = (known or ["m"])[0]
    question = "" if len(known) == 1 else f"is {name!r} in {unit}?"
    several = f"is it {name!r}, and not {', '.join(truths[1:])}?" if len(truths) > 1 else ""
    draft.note("readings", f"{name!r} is how far the plane was: by its name", several)
    draft.note("readings", f"{name!r} in {unit}: {'its name' if said else 'its size'}", question)
    return ("reference" if unit == "m" else f"{LENGTHS[unit]:g} * reference"), LENGTHS[unit] * values


def _listed_pose(listed: Table, source: dict[str, Any], draft: Draft) -> str | None:
    for track in find_tracks(listed):
        made = plane_formulas(track)
        if made is None:
            continue
        columns, values = made
        source["columns"] |= columns
        source["values"] = values
        draft.note(
            "readings", f"{track.names}: poses of a board on the plane, whose z axis is across it",
            "are they poses in the depth camera (depth aligned to the camera that saw the board), in m?",
        )  # fmt: skip
        return "plane"
    return None


def _per_metre(
    middle: np.ndarray, stated: np.ndarray | None, said: tuple[float | None, str], path: Path, draft: Draft
) -> float:
    """Raw numbers of one metre."""
    typical, where = float(np.nanmedian(middle)), "sources.log.images"
    tum = is_folder(path) and (path / "depth.txt").exists() and (path / "rgb.txt").exists()
    if stated is not None:
        ratio = float(np.nanmedian(middle / stated))
        fits = [s for s in SCALES if abs(ratio / s - 1.0) < OFF]
        if said[0] is not None and abs(ratio / said[0] - 1.0) < OFF:
            fits = [said[0]]
        if len(fits) == 1 and (said[0] is None or fits[0] == said[0]):
            draft.note(where, f"{ratio:.4g} raw numbers make a metre of the stated distances: {fits[0]:g}")
            return fits[0]
        best = fits[0] if fits else said[0] or 1000.0
        other = f", {said[1]} says {said[0]:g}" if said[0] else ""
        draft.note(where, f"{ratio:.4g} raw numbers make a metre of the distances{other}", "how many should?")
        return best
    if said[0] is not None:
        draft.note(where, f"{said[0]:g} raw numbers make a metre: {said[1]}")
        return said[0]
    best = 5000.0 if tum else 1.0 if typical < 30.0 else 1000.0
    why = "the TUM RGB-D format's" if tum else f"half of the images are beyond {typical:.4g} in the middle"
    draft.note(
        where, f"{best:g} raw numbers make a metre: {why}", "" if tum else f"do {best:g} make a metre?"
    )
    return best


def _intrinsics(path: Path, cameras: list[Any], width: int, height: int, draft: Draft) -> Intrinsics:
    where = "sources.log.images"
    if is_folder(path) and image_files(path)[0].suffix.lower() in CLOUDS:
        draft.note(
            where, "points have rays of their own: they are put into a camera that is none of the log's"
        )
        return CLOUD_CAMERA
    if path.suffix.lower() == ".npz":
        matrices = arrays_in(path, "the log").values()
        found = [k for each in matrices if (k := of_matrix(each)) is not None]
        if found:
            draft.note(where, f"intrinsics: a matrix in {path.name}")
            return found[0]
    low, high = CENTRAL
    fits = [
        c for c in cameras if low < c.intrinsics.cx / width < high and low < c.intrinsics.cy / height < high
    ]
    if fits:
        differ = [
            c
            for c in fits[1:]
            if c.intrinsics != fits[0].intrinsics and "depth" not in fits[0].path.name.lower()
        ]
        question = f"are they the depth camera's, and not {differ[0].path.name}'s?" if differ else ""
        draft.note(where, f"intrinsics: {fits[0].path.name}", question)
        return fits[0].intrinsics
    why = (
        f"{cameras[0].path.name} is of images of another size"
        if cameras
        else "no file beside the images says them"
    )
    draft.note(
        where, f"intrinsics: {why}", "what are fx, fy, cx and cy of the depth camera? These are placeholders"
    )
    return Intrinsics(0.95 * width, 0.95 * width, 0.5 * (width - 1), 0.5 * (height - 1))
