"""What the table and the floor look like from above, painted from a generator: grain, stains, prints, tape.

Textures are there to be seen by a camera that resolves 2 mm: what is smaller is left out.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from samrl_core.cell.world.table import TABLE_COLOR, TABLE_SIZE

PIXEL = 0.002  # edge of a texture's pixel [m]
FLOOR_SIZE = 512  # edge of the floor's texture, which is repeated [px]
_GAMMA = 255.0
_INKS = ((35, 35, 40), (200, 40, 30), (40, 70, 160), (30, 120, 60))


def paint_table(rng: np.random.Generator, contrast: float, offset: np.ndarray, prints: int) -> np.ndarray:
    """Colours (X, Y, 3) uint8 of the table; first axis along world's x, second along y.

    Args:
        rng: of all that is painted.
        contrast: of grain and stains, 0 plain to 1.
        offset: of the table's colour (3,), linear RGB.
        prints: sheets, tape, cables and pen strokes.
    """
    rows, columns = (round(size / PIXEL) for size in TABLE_SIZE[:2])
    base = np.clip(np.array(TABLE_COLOR) + offset, 0.05, 0.95).astype(np.float32)
    wood = rng.random() < 0.6
    grain = _grain(rng, rows, columns) if wood else _speckles(rng, rows, columns)
    stains = _smooth(rng, rows, columns, 60.0)
    worn = _smooth(rng, rows, columns, 12.0)
    shade = 1.0 + contrast * (0.16 * grain + 0.10 * stains + 0.05 * worn)
    image = np.clip(base * shade[..., None], 0.0, 1.0) * _GAMMA
    image = np.ascontiguousarray(image.astype(np.uint8))
    kinds: tuple[Callable[[np.random.Generator, np.ndarray], None], ...]
    kinds = (_sheet, _tape, _cable, _stroke, _ring)
    for _ in range(prints):
        kinds[int(rng.integers(len(kinds)))](rng, image)
    return image


def paint_floor(rng: np.random.Generator) -> np.ndarray:
    """Colours (F, F, 3) uint8 of a floor of tiles or concrete, to be repeated."""
    size = FLOOR_SIZE
    base = rng.uniform(0.25, 0.6) * np.array([1.0, 0.98, 0.95]) * rng.uniform(0.95, 1.05, 3)
    shade = 1.0 + 0.15 * _smooth(rng, size, size, 40.0) + 0.06 * _speckles(rng, size, size)
    image = np.clip(base * shade[..., None], 0.0, 1.0) * _GAMMA
    image = np.ascontiguousarray(image.astype(np.uint8))
    if rng.random() < 0.6:
        for place in range(0, size, size // 4):
            joint = (image[place] * 0.7).astype(np.uint8)
            image[place : place + 3] = joint
            image[:, place : place + 3] = joint[:, None]
    return image


def _smooth(rng: np.random.Generator, rows: int, columns: int, length: float) -> np.ndarray:
    """A field of about unit variance, smooth over `length` [px]."""
    shape = (max(3, round(columns / length) + 2), max(3, round(rows / length) + 2))
    coarse = rng.standard_normal(shape[::-1]).astype(np.float32)
    return cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_CUBIC)


def _grain(rng: np.random.Generator, rows: int, columns: int) -> np.ndarray:
    """Boards with long streaks along one axis."""
    board = rng.uniform(40.0, 90.0)
    streaks = _smooth(rng, rows, columns, 3.0)
    streaks = cv2.blur(streaks, (1, 61)) * 4.0 + _smooth(rng, 4, columns, 4.0)[:1]
    number = (np.arange(columns) / board).astype(int)
    tone = rng.standard_normal(number[-1] + 1)[number].astype(np.float32)
    seam = (np.diff(number, prepend=number[0]) > 0).astype(np.float32)
    return 0.6 * streaks + 0.8 * tone[None] - 4.0 * seam[None]


def _speckles(rng: np.random.Generator, rows: int, columns: int) -> np.ndarray:
    """Laminate or concrete: fine and coarse dots."""
    fine = rng.standard_normal((rows, columns)).astype(np.float32)
    return 0.5 * fine + _smooth(rng, rows, columns, 4.0)


def _place(rng: np.random.Generator, image: np.ndarray) -> np.ndarray:
    return rng.random(2) * image.shape[1::-1]


def _quad(middle: np.ndarray, size: np.ndarray, angle: float) -> np.ndarray:
    """Corners (4, 2) of a turned rectangle [px]."""
    c, s = np.cos(angle), np.sin(angle)
    corners = 0.5 * size * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return middle + corners @ np.array([[c, s], [-s, c]])


def _fill(image: np.ndarray, corners: np.ndarray, color: tuple[float, ...]) -> None:
    cv2.fillConvexPoly(image, np.rint(corners).astype(np.int32), color, cv2.LINE_AA)


def _sheet(rng: np.random.Generator, image: np.ndarray) -> None:
    """A sheet of paper, blank, with lines of text, or a board of squares."""
    middle, angle = _place(rng, image), rng.uniform(0, np.pi)
    size = np.array([0.148, 0.210]) / PIXEL * rng.uniform(0.6, 1.2)
    tone = rng.uniform(205, 250)
    _fill(image, _quad(middle, size, angle), (tone, tone, tone * rng.uniform(0.85, 1.0)))
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    kind = rng.random()
    if kind < 0.5:
        for row in np.arange(-0.4, 0.4, 0.06):
            length = size[0] * rng.uniform(0.3, 0.8)
            start = middle + axes[1] * row * size[1] - axes[0] * 0.4 * size[0]
            ends = np.rint(np.stack([start, start + axes[0] * length])).astype(int)
            cv2.line(image, ends[0].tolist(), ends[1].tolist(), (110, 110, 115), 1, cv2.LINE_AA)
    elif kind < 0.7:
        step = size[0] / 8
        for i in range(-3, 3):
            for j in range(-3, 4):
                if (i + j) % 2:
                    spot = middle + axes[0] * (i + 0.5) * step + axes[1] * j * step
                    _fill(image, _quad(spot, np.array([step, step]), angle), (30, 30, 30))


def _tape(rng: np.random.Generator, image: np.ndarray) -> None:
    size = np.array([rng.uniform(0.04, 0.25), rng.uniform(0.012, 0.025)]) / PIXEL
    color = ((225, 205, 60), (60, 110, 190), (215, 210, 190), (40, 40, 40))[int(rng.integers(4))]
    _fill(image, _quad(_place(rng, image), size, rng.uniform(0, np.pi)), color)


def _cable(rng: np.random.Generator, image: np.ndarray) -> None:
    """A curve of constant width, with its own thin shade."""
    t = np.linspace(0.0, 1.0, 60)[:, None]
    points = [_place(rng, image) for _ in range(4)]
    way = (1 - t) ** 3 * points[0] + 3 * t * (1 - t) ** 2 * points[1]
    way = np.rint(way + 3 * t**2 * (1 - t) * points[2] + t**3 * points[3]).astype(np.int32)
    width = int(rng.integers(2, 5))
    tone = (image.mean(axis=(0, 1)) * 0.6).tolist()
    color = ((25, 25, 28), (190, 190, 185), (170, 40, 35), (40, 60, 130))[int(rng.integers(4))]
    cv2.polylines(image, [way + [1, 2]], False, tone, width, cv2.LINE_AA)
    cv2.polylines(image, [way], False, color, width, cv2.LINE_AA)


def _stroke(rng: np.random.Generator, image: np.ndarray) -> None:
    """A pen line, or a crossed mark."""
    middle, ink = _place(rng, image), _INKS[int(rng.integers(len(_INKS)))]
    for angle in rng.uniform(0, np.pi, int(rng.integers(1, 3))):
        half = 0.5 * rng.uniform(10, 60) * np.array([np.cos(angle), np.sin(angle)])
        ends = np.rint(np.stack([middle - half, middle + half])).astype(int)
        cv2.line(image, ends[0].tolist(), ends[1].tolist(), ink, 1, cv2.LINE_AA)


def _ring(rng: np.random.Generator, image: np.ndarray) -> None:
    """Where a cup stood."""
    middle = np.rint(_place(rng, image)).astype(int).tolist()
    tone = (image.mean(axis=(0, 1)) * rng.uniform(0.6, 0.8)).tolist()
    cv2.circle(image, middle, int(rng.integers(16, 24)), tone, 2, cv2.LINE_AA)
