"""Settings of Warp, made once before its first kernel is loaded."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import Any

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
    _announce_compilation()
    _started = True


_started = False

COMPILING = "compiling kernels"  # how the line begins that tells of it


def kernel_cache() -> Path:
    """Folder of compiled kernels."""
    start()
    return Path(str(wp.config.kernel_cache_dir))


def _announce_compilation() -> None:
    """Say on the error stream what is compiled: the first start is otherwise silent for a minute.

    Warp tells of a module only when it is compiled, so its compiler is asked through. A Warp without that
    inner function compiles in silence.
    """
    compiler = getattr(wp.Module, "_compile", None)
    if compiler is None:
        return

    told: set[tuple[str, str]] = set()

    def compile_and_tell(module: Any, device: Any, folder: str, output: str, *rest: Any, **named: Any) -> Any:
        name = str(module.name).removeprefix("samrl_core.")
        if not (Path(folder) / output).exists() and (name, str(device)) not in told:
            told.add((name, str(device)))  # threads that need the same kernels all compile them
            print(f"{COMPILING}: {name} for {device}; kept for the next start", file=sys.stderr, flush=True)
        return compiler(module, device, folder, output, *rest, **named)

    setattr(wp.Module, "_compile", compile_and_tell)  # noqa: B010 (no attribute that types know)
