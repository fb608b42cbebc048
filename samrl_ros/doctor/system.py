"""The computer: processors, GPU, disk, shared memory, compiled kernels."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path

from samrl_ros.doctor.check import Check, ok, problem, warning
from samrl_ros.hosting.shared_memory import SHARED_MEMORY, leftovers, remove_leftovers

MIB = 2**20
NEEDED_SHARED_MIB = 256  # five processes with a segment of 16 MiB for each of their participants, and room
LEFTOVER_MIB = 64  # of segments that no process has open
LEAST_DISK_MIB = 512  # less, and a bag of one episode may not fit
ROOMY_DISK_MIB = 5 * 1024
DRIVER = Path("/proc/driver/nvidia/version")


def check_python() -> Check:
    """The interpreter that the wheels are made for."""
    found = f"{sys.version_info.major}.{sys.version_info.minor}.{sys.version_info.micro} at {sys.prefix}"
    if (3, 11) <= sys.version_info < (3, 13):
        return ok("python", found)
    return problem("python", found, "make an environment with Python 3.11 or 3.12: make PYTHON=python3.11")


def check_processors() -> Check:
    """Two processes compute beside the world's."""
    cores = len(os.sched_getaffinity(0))
    if cores >= 2:
        return ok("processors", f"{cores}")
    return warning("processors", f"{cores}", "give it two or more; on one an episode takes minutes")


def check_gpu(driver: Path = DRIVER) -> Check:
    """No GPU is needed; one that is there and unused is told."""
    import torch

    if torch.cuda.is_available():
        names = [torch.cuda.get_device_name(k) for k in range(torch.cuda.device_count())]
        return ok("gpu", f"{', '.join(names)}; training uses it with --device cuda:0")
    if driver.is_file():
        return warning(
            "gpu",
            f"an NVIDIA driver is loaded, but torch {torch.__version__} finds no device",
            "the cell needs none; for training install torch's CUDA build (constraints.txt, torch)",
        )
    return ok("gpu", "none; everything runs on the CPU")


def check_disk(folder: Path) -> Check:
    """Room for bags, where they will lie."""
    there = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.is_dir())
    free = shutil.disk_usage(there).free // MIB
    found = f"{free} MiB free at {there}"
    if not os.access(there, os.W_OK):
        return problem("disk", f"{there} is not writable", "give another folder with --out")
    if free < LEAST_DISK_MIB:
        return problem("disk", found, f"free {LEAST_DISK_MIB} MiB, or give another folder with --out")
    if free < ROOMY_DISK_MIB:
        return warning(
            "disk", found, f"long runs want {ROOMY_DISK_MIB} MiB; free some, or give another --out"
        )
    return ok("disk", found)


def check_shared_memory(folder: Path = SHARED_MEMORY) -> Check:
    """Images travel through it; what killed processes left is told."""
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        return problem(
            "shared memory",
            f"{folder} is missing or not writable",
            "mount it (docker run --shm-size=1g), or set FASTDDS_BUILTIN_TRANSPORTS=UDPv4",
        )
    free = shutil.disk_usage(folder).free // MIB
    left = leftovers(folder)
    size = sum(one.size for one in left) // MIB
    if free < NEEDED_SHARED_MIB:
        return problem(
            "shared memory",
            f"{free} MiB free at {folder}, needed {NEEDED_SHARED_MIB}; {size} MiB are left over",
            "samrl doctor --clean; in a container: --shm-size=1g",
        )
    if size > LEFTOVER_MIB:
        return warning(
            "shared memory",
            f"{free} MiB free; {size} MiB in {len(left)} segments of processes that are gone",
            "samrl doctor --clean; the next `samrl cell` removes them too",
        )
    return ok("shared memory", f"{free} MiB free at {folder}")


def clean_shared_memory(folder: Path = SHARED_MEMORY) -> Check:
    """Remove what killed processes left."""
    gone = remove_leftovers(folder)
    size = sum(one.size for one in gone) / MIB
    return ok(
        "clean", f"{len(gone)} segments of processes that are gone removed from {folder} ({size:.1f} MiB)"
    )


def check_kernel_cache() -> Check:
    """Where compiled kernels lie; without them the first start compiles for a minute."""
    from samrl_core.common.warp_runtime import kernel_cache

    folder = kernel_cache()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        return problem(
            "kernel cache",
            f"{folder} cannot be written ({error.strerror})",
            "set SAMRL_WARP_CACHE to a folder that can be written",
        )
    modules = len([p for p in folder.iterdir() if p.is_dir()])
    if not modules:
        return warning(
            "kernel cache", f"{folder} is empty", "nothing; the first start compiles for about a minute"
        )
    return ok("kernel cache", f"{modules} compiled modules in {folder}")
