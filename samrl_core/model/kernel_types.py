"""Vector types of the renderer's kernels."""

from __future__ import annotations

import warp as wp

CHANNELS = 7  # colour r, g, b, world x, y, z [m], target indicator

Pixel = wp.types.vector(length=CHANNELS, dtype=wp.float32)
Clip = wp.types.vector(length=2, dtype=wp.float32)
EdgeRow = wp.types.vector(length=8, dtype=wp.int32)
