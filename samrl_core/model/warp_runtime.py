"""Settings of Warp, made once before its first kernel is loaded, and the vector types of the kernels."""

from __future__ import annotations

import os

import warp as wp

CHANNELS = 7  # colour r, g, b, world x, y, z [m], target indicator

if "SAMRL_WARP_CACHE" in os.environ:
    wp.config.kernel_cache_dir = os.environ["SAMRL_WARP_CACHE"]

Pixel = wp.types.vector(length=CHANNELS, dtype=wp.float32)
Clip = wp.types.vector(length=2, dtype=wp.float32)
EdgeRow = wp.types.vector(length=8, dtype=wp.int32)


def start() -> None:
    """Initialise Warp once, without its banner and its remark that there is no GPU."""
    level = wp.config.log_level
    wp.config.log_level = 40  # errors only
    wp.init()
    wp.config.log_level = max(level, 30)  # afterwards warnings too, but no line per loaded kernel
