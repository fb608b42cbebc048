"""Smooth displacements of an image that is read at whole pixels.

Depth and labels of an image that was undistorted, registered to colour or halved are those of the nearest
pixel: a lens that is off by less than half a pixel moves none of them, one that is off by more moves them by
steps. What is seen differs from what the lens does by up to half a pixel, alike over much of the image and in
all frames. Its smooth part looks like a lens' error, so it is open beside each of them.
"""

from __future__ import annotations

import numpy as np

ORDERS = tuple((i, n - i) for n in (1, 2, 3) for i in range(n, -1, -1))  # powers of right and below
BENDS = 2 * len(ORDERS)  # columns: along u, then along v


def bend_modes(right: np.ndarray, below: np.ndarray) -> np.ndarray:
    """Polynomials (9, ...) of places from -1 to 1 in the image, of mean square 1 over it."""
    means = [np.sqrt((2 * i + 1.0) * (2 * j + 1.0)) for i, j in ORDERS]
    return np.stack([m * right**i * below**j for m, (i, j) in zip(means, ORDERS, strict=True)])
