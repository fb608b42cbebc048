"""A bar over items that are worked on side by side."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from samrl_core.common import executor

SIDE_BY_SIDE = 2  # worlds or sets of recordings, unless told otherwise


def with_progress(
    what: str,
    work: Callable[[Any], Any],
    todo: Sequence[Any],
    total: int,
    mapping: Callable[..., Iterator[executor.Done]],
    workers: int,
) -> Iterator[executor.Done]:
    """What `mapping`, of `samrl_core.common.executor`, yields, shown on stderr; `total` has finished ones."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    with Progress(*columns, console=Console(stderr=True)) as bar:
        shown = bar.add_task(what, total=total, completed=total - len(todo))
        for done in mapping(work, todo, workers) if todo else ():
            bar.advance(shown)
            yield done
