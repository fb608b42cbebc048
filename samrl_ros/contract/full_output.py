"""A standard output that is full costs what would be printed there, not the work: files are still written."""

from __future__ import annotations

import io
import sys
from typing import TextIO


class _Lossy(io.FileIO):
    """Bytes for a descriptor; keeps the first refusal for lack of room in place of raising it."""

    lost: OSError | None = None

    def write(self, content, /) -> int:
        """See `io.RawIOBase`. A pipe that nobody reads ends the command, as any other does."""
        try:
            return super().write(content)
        except OSError as error:
            from samrl_core.common.files import NO_ROOM

            if error.errno not in NO_ROOM:
                raise
            self.lost = self.lost or error
            return memoryview(content).nbytes


class FullOutput:
    """From now on what does not fit into standard output is left out; `lost` says whether any was."""

    def __init__(self) -> None:
        before = sys.stdout
        self._bytes: _Lossy | None = None
        if not isinstance(before, io.TextIOWrapper):  # captured, or closed by whoever started this
            return
        before.flush()
        self._bytes = _Lossy(before.fileno(), "wb", closefd=False)
        sys.stdout = io.TextIOWrapper(
            io.BufferedWriter(self._bytes),
            before.encoding,
            before.errors,
            line_buffering=before.line_buffering,
            write_through=before.write_through,
        )

    def lost(self) -> str:
        """Why output was lost, in words; empty where all of it was printed."""
        if self._bytes is None:
            return ""
        stream: TextIO = sys.stdout
        stream.flush()
        return (self._bytes.lost.strerror or "") if self._bytes.lost else ""
