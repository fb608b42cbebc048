"""Vector types of the renderer's kernels."""

from __future__ import annotations

import warp as wp

CHANNELS = 7  # colour r, g, b, world x, y, z [m], target indicator

Pixel = wp.types.vector(length=CHANNELS, dtype=wp.float32)
EdgeUse = wp.types.vector(length=4, dtype=wp.int32)
LightRow = wp.types.vector(length=5, dtype=wp.float32)  # unit direction towards it, intensity, ambient
