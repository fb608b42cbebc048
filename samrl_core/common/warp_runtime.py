"""Settings of Warp, made once before its first kernel is loaded."""

from __future__ import annotations

import os
import sys
import tempfile

import torch
import warp as wp

if "SAMRL_WARP_CACHE" in os.environ:
    wp.config.kernel_cache_dir = os.environ["SAMRL_WARP_CACHE"]

_NO_GPU = b"Could not find or load the NVIDIA CUDA driver"


def start() -> None:
    """Initialise Warp once, without its banner and its remark that there is no GPU.

    The remark is written by Warp's library itself, past every setting; so what is written to the error
    stream during the start is kept, and all but that line is passed on.
    """
    global _started
    if _started:
        return
    level = wp.config.log_level
    wp.config.log_level = 40  # errors only
    sys.stderr.flush()
    stream = os.dup(2)
    with tempfile.TemporaryFile() as kept:
        os.dup2(kept.fileno(), 2)
        try:
            wp.init()
        finally:
            os.dup2(stream, 2)
            os.close(stream)
            kept.seek(0)
            for line in kept:
                if _NO_GPU not in line:
                    os.write(2, line)
    wp.config.log_level = max(level, 30)  # afterwards warnings too, but no line per loaded kernel
    _started = True


_started = False


def numbered_device(name: str) -> torch.device:
    """A device by torch's name, with its number: torch takes "cuda" for the current one, Warp takes no name
    without a number.
    """
    device = torch.device(name)
    if device.type == "cuda" and device.index is None:
        return torch.device("cuda", torch.cuda.current_device())
    return device
