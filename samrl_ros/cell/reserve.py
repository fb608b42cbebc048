"""Room on the disk that a run keeps free for its summary."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from samrl_core.common.files import room_for

RESERVE_BYTES = 4 * 2**20  # a summary of 200 episodes takes one


class Reserve:
    """A file without a name: it is gone with the process, whatever ends that."""

    def __init__(self, folder: Path) -> None:
        """Take the room.

        Raises:
            InputError: there is not even as much.
        """
        with room_for(folder):
            self._file = tempfile.TemporaryFile(dir=folder)
            os.posix_fallocate(self._file.fileno(), 0, RESERVE_BYTES)

    def give_up(self) -> None:
        """Leave the room to others; once more does no harm."""
        self._file.close()
