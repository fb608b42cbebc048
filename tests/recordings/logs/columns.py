"""Small tables of named columns, as a bench's script writes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

TIME = np.arange(0.0, 6.0, 0.01)
WAVE, TURNED = np.sin(2.0 * TIME), np.cos(2.0 * TIME)


def write(path: Path, **columns: np.ndarray) -> Path:
    """A CSV file with one line of names."""
    table, head = np.column_stack(list(columns.values())), ",".join(columns)
    np.savetxt(path, table, delimiter=",", header=head, comments="", fmt="%.9g")
    return path
