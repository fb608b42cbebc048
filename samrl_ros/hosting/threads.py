"""How many threads the numerical libraries may use in a process of the cell."""

from __future__ import annotations

import os


def one_thread_per_library() -> None:
    """Keep OpenMP and BLAS to one thread; call before NumPy and torch do any work.

    The nodes are the parallelism here. Worker threads that spin between small tensor operations take the
    cores from the other nodes: with two torch threads on two cores an update took ten times as long.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    import torch

    torch.set_num_threads(int(os.environ["OMP_NUM_THREADS"]))
