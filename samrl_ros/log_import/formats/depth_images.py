"""Depth images of a plane as readings: how far each part of an image says the plane is.

A plane's inverse depth is linear in the pixels: 1 / z = n . (x, y, 1) / d with x = (u - cx) / fx, likewise y
(Hartley & Zisserman 2004). Its normal n comes from the image itself, which a factor of depth leaves as it is.
Each part of the image then reads the plane's distance d = z n . (x, y, 1), which is what a tape measures. An
error that grows with the square of the depth bends n by its size times the plane's tilt: of planes that are
nearly across the axis this is nothing; of others, the board's own pose gives n.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from samrl_core.common.array_file import UNREADABLE
from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file, is_folder
from samrl_ros.log_import.formats.point_clouds import SUFFIXES as CLOUDS
from samrl_ros.log_import.formats.point_clouds import read_cloud
from samrl_ros.log_import.formats.text import read_text_table
from samrl_ros.log_import.specs import ImageOptions
from samrl_ros.log_import.table import Table

SUFFIXES = (".png", ".tif", ".tiff", ".pgm", ".npy")
STACKS = (".npy", ".npz")
OWN = "."  # `images.list` of a stack whose own file lists a number for each image
OTHERS = frozenset("rgb color colour gray grey ir infra infrared left right mask seg image images".split())
GRID = (4, 5)  # parts of an image that read, down and across
MARGIN = 0.1  # of the image on each side, where lenses and stereo are at their worst
FILLED = 0.5  # of a part that must be depth on the plane
PLANE = 0.03  # relative distance from a plane within which a pixel is on it
ON_PLANE = 0.4  # of an image's depth that must be
SAMPLED, DRAWS, ROUNDS = 4000, 60, 5  # pixels and triples that a plane is looked for by, and refinements
LEAST_PIXELS = 200
NARROWEST = 30  # pixels of an image; less is a stack of matrices


def read_depth_images(path: Path, options: ImageOptions, where: str) -> Table:
    """A table with a row for each part of each image.

    Columns: `plane_distance` and `depth` [m], `ray_x`, `ray_y` (of the ray at depth one), `image` (from 0),
    `surface` (from 0, that of most depth first; more than one with `surfaces`),
    `named_distance` [m] where names of files or folders say one, and those of the list of images.

    Raises:
        InputError: no images, one that is no depth, sizes that differ, or none that shows a plane.
    """
    names, rows, notes = [], [], []
    for number, (name, image) in enumerate(images_in(path, where)):
        found = _readings(image / options.per_metre, options)
        if found is None:
            notes.append(name)
        else:
            rows.append(np.column_stack([np.full(len(found), number), found]))
        names.append(name)
    if not rows:
        raise InputError(
            f"{where}: no image of {path.name} shows a plane: {ON_PLANE:.0%} of the depth must be on one,"
            f" within {PLANE:.0%}. Film a wall or a table that fills the image"
        )
    table = Table(path)
    made = np.concatenate(rows)
    for column, name in enumerate(("image", "surface", "ray_x", "ray_y", "depth", "plane_distance")):
        table.columns[name] = made[:, column]
    at = made[:, 0].astype(int)
    distances = [distance_in(name) for name in names]
    if any(d is not None for d in distances):
        table.columns["named_distance"] = np.array([np.nan if d is None else d for d in distances])[at]
    if options.list is not None:
        _add_list(table, path, names, at, options, where)
    if notes:
        table.notes.append(
            f"{len(notes)} of {len(names)} images show no plane and are left out: {notes[0]}, ..."
        )
    return table


def image_files(folder: Path) -> list[Path]:
    """Depth images of a folder and of the folders in it, by name, none of colour; else its point clouds."""
    there = sorted(
        file for file in folder.glob("**/*") if len(file.relative_to(folder).parts) <= 3 and is_file(file)
    )  # fmt: skip
    found = [file for file in there if file.suffix.lower() in SUFFIXES]
    if not found:
        return [file for file in there if file.suffix.lower() in CLOUDS]
    named = [f for f in found if "depth" in str(f.relative_to(folder)).lower()]
    plain = [
        f for f in found if f.suffix.lower() != ".npy" and not set(_words(f.relative_to(folder))) & OTHERS
    ]
    return named or plain


def images_in(path: Path, where: str) -> Iterator[tuple[str, np.ndarray]]:
    """Name and raw depth (H, W) of each image of a folder or of a stack; zero or NaN where there is none.

    Raises:
        InputError: none, one that cannot be read or is no depth, or sizes that differ.
    """
    size: tuple[int, ...] = ()
    first = ""
    for name, image in _stack(path, where) if not is_folder(path) else _folder(path, where):
        size, first = size or image.shape, first or name
        if image.shape != size:
            raise InputError(
                f"{where}: {name} has {_size(image.shape)} pixels, {first} {_size(size)}; put images of one"
                " camera and one size into a folder"
            )
        yield name, np.where(np.isfinite(image), image, 0.0).astype(float)
    if not size:
        raise InputError(
            f"{where}: {path} holds no depth images; they are {', '.join(SUFFIXES)} of 16 bits or floats"
        )


def distance_in(name: str) -> float | None:
    """Distance [m] that the last name with one says (`0.8m`, `wall_500mm_03.png`); None without a unit."""
    pattern = r"(?<![\d.])(\d+(?:[.,]\d+)?)[ _]?(mm|cm|m)(?![a-zA-Z])"
    for part in reversed(Path(name).parts):
        found = re.findall(pattern, part)
        if len(found) == 1:
            return float(found[0][0].replace(",", ".")) * {"mm": 1e-3, "cm": 1e-2, "m": 1.0}[found[0][1]]
    return None


def _folder(path: Path, where: str) -> Iterator[tuple[str, np.ndarray]]:
    for file in image_files(path):
        name = str(file.relative_to(path))
        image = _image(file, where)
        if not _is_depth(image):
            raise InputError(
                f"{where}: {name} is a picture of 8 bits or in colour, no depth; depth has one channel of 16"
                " bits or floats"
            )
        yield name, image


def is_depth_file(file: Path) -> bool:
    """Whether an image is depth and no picture. Raises `InputError` where it cannot be read."""
    return _is_depth(_image(file, "the log"))


def _is_depth(image: np.ndarray) -> bool:
    return image.ndim == 2 and image.dtype.kind in "uif" and image.dtype.itemsize > 1


def _image(file: Path, where: str) -> np.ndarray:
    if file.suffix.lower() == ".npy":
        return next(iter(arrays_in(file, where).values()), np.zeros(0))
    if file.suffix.lower() in CLOUDS:
        return read_cloud(file, where)
    try:
        image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise InputError(
            f"{where}: {file.name} states a size that OpenCV refuses ({error.err}); is it whole?"
        ) from error
    if image is None:
        raise InputError(f"{where}: {file.name} cannot be read as an image; is it whole?")
    return image


def _stack(path: Path, where: str) -> Iterator[tuple[str, np.ndarray]]:
    if not is_file(path):
        raise InputError(f"{where}: no file or folder {path}; paths count from `--data`, or from the mapping")
    images = stack_of(path, where)
    if images is None:
        raise InputError(
            f"{where}: {path.name} holds no stack of depth images (N, H, W) of 16 bits or floats"
        )
    for number, image in enumerate(images):
        yield str(number), image


def stack_of(path: Path, where: str) -> np.ndarray | None:
    """Images (N, H, W) of a .npy or .npz; None where it holds none."""
    if path.suffix.lower() not in STACKS:
        return None
    fits = [
        a
        for a in arrays_in(path, where).values()
        if a.ndim == 3 and a.dtype.kind in "uif" and a.dtype != np.uint8 and min(a.shape[1:]) > NARROWEST
    ]
    return fits[0] if len(fits) == 1 else None


def arrays_in(path: Path, where: str) -> dict[str, np.ndarray]:
    """Arrays of a .npy or .npz by name; that of a .npy, whatever its file is called, has none.

    Raises:
        InputError: it cannot be read.
    """
    try:
        loaded = np.load(path, allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            return {"": loaded}
        with loaded:
            return {name: loaded[name] for name in loaded.files}
    except UNREADABLE as error:
        raise InputError(f"{where}: {path} cannot be read: {error}") from error


def stacks_in(folder: Path) -> list[Path]:
    """Stacks of depth images that lie in a folder, by name."""
    files = sorted(f for f in folder.iterdir() if f.suffix.lower() in STACKS and is_file(f))
    return [file for file in files if stack_of(file, "the log") is not None]


def beside_stack(path: Path, count: int, where: str) -> Table:
    """What a .npz holds beside its stack: a number for each of `count` images, by the array's name."""
    table = Table(path)
    for name, values in arrays_in(path, where).items():
        if name and values.size == count and values.ndim <= 2 and values.dtype.kind in "uif":
            table.columns[name] = values.reshape(-1).astype(float)
    return table


def _readings(z: np.ndarray, options: ImageOptions) -> np.ndarray | None:
    """(K, 5) surface, ray at depth one, depth and plane's distance [m] by parts of an image.

    The first surface is the plane that most of the depth is on, read over the image; each further one that of
    what is on none before, read where it stands. None without a plane.
    """
    height, width = z.shape
    rows, columns = np.mgrid[0:height, 0:width]
    rays = np.stack(
        [(columns - options.cx) / options.fx, (rows - options.cy) / options.fy, np.ones(z.shape)], 2
    )
    seen, out = z > 0, []
    down = np.linspace(MARGIN * height, (1 - MARGIN) * height, GRID[0] + 1).astype(int)
    across = np.linspace(MARGIN * width, (1 - MARGIN) * width, GRID[1] + 1).astype(int)
    for surface in range(options.surfaces):
        plane = _fit_plane(rays[seen], z[seen])
        if plane is None:
            break
        on = seen & (np.abs(z * (rays @ plane) - 1.0) < PLANE)
        if surface:
            down, across = (_spread(np.flatnonzero(on.any(axis=1 - k)), n) for k, n in enumerate(GRID))
        out += [[surface, *part] for part in _parts(z, rays, plane, on, down, across)]
        seen = seen & ~on
    return np.array(out) if out else None


def _spread(pixels: np.ndarray, parts: int) -> np.ndarray:
    """Borders (parts + 1,) of parts of a stretch of rows or columns."""
    return np.linspace(pixels[0], pixels[-1] + 1, parts + 1).astype(int)


def _parts(
    z: np.ndarray, rays: np.ndarray, plane: np.ndarray, on: np.ndarray, down: np.ndarray, across: np.ndarray
) -> Iterator[list[float]]:
    """Ray, depth and plane's distance of each part of a grid that most of its pixels are on the plane of."""
    along = rays @ (plane / np.linalg.norm(plane))  # distance of the plane over depth
    for top, bottom in zip(down[:-1], down[1:], strict=True):
        for left, right in zip(across[:-1], across[1:], strict=True):
            part = (slice(top, bottom), slice(left, right))
            there = on[part]
            if not there.size or there.mean() < FILLED:
                continue
            distance = float(np.median((z * along)[part][there]))
            ray = rays[part][there].mean(axis=0)  # of a part that is half filled it is not the middle
            depth = distance / float(ray @ plane) * float(np.linalg.norm(plane))
            yield [float(ray[0]), float(ray[1]), depth, distance]


def _fit_plane(rays: np.ndarray, z: np.ndarray) -> np.ndarray | None:
    """n / d (3,) of the plane that most of the depth is on; None where that is too little."""
    if len(z) < LEAST_PIXELS:
        return None
    rng = np.random.default_rng(len(z))  # the same plane of the same image
    picked = rng.choice(len(z), min(SAMPLED, len(z)), replace=False)
    a, depth = rays[picked], z[picked]
    best, most = None, 0
    for _ in range(DRAWS):
        three = rng.choice(len(depth), 3, replace=False)
        if abs(np.linalg.det(a[three])) < 1e-6:
            continue
        plane = np.linalg.solve(a[three], 1.0 / depth[three])
        count = int(np.count_nonzero(np.abs(depth * (a @ plane) - 1.0) < PLANE))
        if count > most:
            best, most = plane, count
    if best is None or most < ON_PLANE * len(depth):
        return None
    for _ in range(ROUNDS):
        on = np.abs(depth * (a @ best) - 1.0) < PLANE
        best = np.linalg.lstsq(a[on], 1.0 / depth[on], rcond=None)[0]
    return best if np.linalg.norm(best) > 0 else None


def _add_list(
    table: Table, path: Path, names: list[str], at: np.ndarray, options: ImageOptions, where: str
) -> None:
    """Columns of the list of images, each row's for every reading of its image."""
    stacked = options.list == OWN
    file = path if stacked else (path if is_folder(path) else path.parent) / str(options.list)
    if not is_file(file):
        raise InputError(f"{where}: no file {file}; `images.list` counts from the folder of the images")
    listed = (
        beside_stack(file, len(names), where) if stacked else read_text_table(file, "", options.csv, where)
    )
    count = len(next(iter(listed.columns.values()), ()))
    rows = match_rows(listed, names, options.name)
    if rows is None:
        raise InputError(
            f"{where}: {file.name} has {count} rows for {len(names)} images; `images.name` says which column"
            " names the image, else there must be one row for each"
        )
    missing = [name for name, row in zip(names, rows, strict=True) if row < 0]
    if missing:
        table.notes.append(f"{len(missing)} images are not in {file.name}: {missing[0]}, ...")
    for name in listed.columns:
        if name != options.name:
            values = np.append(np.asarray(listed.numbers(name, where), dtype=float), np.nan)
            table.columns[name] = values[np.array(rows)][at]


def match_rows(listed: Table, names: list[str], column: str) -> list[int] | None:
    """Row of each image, -1 without one: by the column of names, else in order; None where neither fits."""
    cells = listed.columns.get(column)
    if isinstance(cells, pd.Series):
        by_name = {Path(str(cell).strip()).stem: row for row, cell in enumerate(cells)}
        rows = [by_name.get(Path(name).stem, -1) for name in names]
        return rows if max(rows, default=-1) >= 0 else None
    count = len(next(iter(listed.columns.values())))
    return list(range(count)) if count == len(names) else None


def _words(path: Path) -> list[str]:
    return re.findall(r"[a-z]+", str(path).lower())


def _size(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, reversed(shape)))
