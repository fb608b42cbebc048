"""Light, paint and hue: each colour of a surface against what the model expects of it.

Twice the light shows twice the paint as well: light adds to the logarithm of each colour, whatever the paint
is. Times what is expected it is the difference of brightness where that is small; a difference would take a
lamp on a dark paint for a weaker one. Colours are compared one by one and not by their mean: paint is off in
each by itself, so that three tell more of the light than one, and where one has ended at white two are left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.diagnosis.residuals.images.scene import OBJECT, STATIC
from samrl_core.diagnosis.residuals.images.white import DARK, WHITE, without_white

COLORS = 3
TINTS = np.array([[1.0, 0.0, -1.0], [0.5, -1.0, 0.5]])  # of the light's hue: warm to cold, magenta to green
ADDED = 0.1  # of full scale, at which what is added to a colour is as noisy as what it is multiplied by
MOST_AT_WHITE = 0.1  # share of a surface's tiles from which on a colour at white tells nothing of the light
UNKNOWN = 1.0  # standard deviation of the logarithm of such a colour


@dataclass(frozen=True, eq=False)
class ComparedColors:
    """Colours of N surfaces in tiles, one colour after the other."""

    value: np.ndarray  # (3 N,) e log(seen / e) for e expected
    noise: np.ndarray  # (3 N,) of each against that of others
    surface: np.ndarray  # (3 N,) index, another one for each colour of each surface
    columns: dict[str, np.ndarray]  # name -> (p, 3 N)


def compare_colors(
    expected: np.ndarray, seen: np.ndarray, group: np.ndarray, lit: np.ndarray
) -> ComparedColors:
    """Rows of N surfaces in tiles, one colour after the other: those of one tile are alike by its grain.

    Args:
        expected: (N, 3) colours of the model, 1 is white.
        seen: (N, 3) as recorded.
        group: (N,) what carries the surface, `OBJECT` or `STATIC`.
        lit: (N, 3) what is expected of the same paint where it is lit best. Another paint is darker by one
            share on all faces: as one difference it would be told from light by how they are shaded.
    """
    e = np.maximum(expected, DARK)
    whole, unsure = without_white(expected, seen, group)
    hidden = _hidden_by_white(unsure, seen, group)
    value = e * np.log(np.maximum(whole, DARK) / e)
    of_color = np.eye(COLORS)[:, None, :] * np.ones((1, len(e), 1))  # (3, N, 3)
    shade = e / np.maximum(lit, DARK)
    on_object, on_static = ((group == g).astype(float)[:, None] for g in (OBJECT, STATIC))
    common = np.concatenate([np.ones((1, COLORS)), TINTS])[:, None, :]
    columns = {
        "light": e[None],
        "tint": TINTS[:, None, :] * e,
        "shading": (e * on_object)[None],  # light from elsewhere reaches its faces otherwise than drawn
        "paint_object": of_color * shade * on_object,
        "paint_static": common * shade * on_static,  # one grey or another, and its hue
        "white_object": of_color * e * hidden * on_object,
        "white_static": of_color * e * hidden * on_static,
    }
    flat = {name: one.swapaxes(1, 2).reshape(len(one), -1) for name, one in columns.items()}
    surface = np.arange(COLORS)[:, None] + COLORS * (group == OBJECT)
    return ComparedColors(value.T.ravel(), np.hypot(e, ADDED).T.ravel(), surface.ravel(), flat)


def find_driven_to_white(expected: np.ndarray, surface: np.ndarray, light: float) -> np.ndarray:
    """Which rows (M,) of `compare_colors` tell nothing where the logarithm of the light is off by `light`.

    By what is expected, not by what is seen: an image that is bright already does not become so once more.

    Args:
        expected: (M,) brightness, of one or more frames.
        surface: (M,) index of each row's colour and surface.
        light: logarithm of the light against what is expected.
    """
    white = expected * np.exp(light) >= WHITE
    out = np.zeros(len(expected), dtype=bool)
    for one in np.unique(surface):
        out[surface == one] = white[surface == one].mean() > MOST_AT_WHITE
    return out


def _hidden_by_white(unsure: np.ndarray, seen: np.ndarray, group: np.ndarray) -> np.ndarray:
    """What may be off in the logarithm of all tiles of a surface by white (N, 3), of how unsure each tile is.

    A colour that has ended at white in many tiles is as bright as the others of its surface say: counted once
    more it would tell the light twice. Where no colour is left, light is at least what makes all white.
    """
    off = np.zeros_like(unsure)
    for one in np.unique(group):
        of = group == one
        share = (seen[of] >= WHITE).mean(axis=0)
        off[of] = unsure[of].mean(axis=0)
        if (share <= MOST_AT_WHITE).any():
            off[of] = np.where(share > MOST_AT_WHITE, UNKNOWN, off[of])
    return off
