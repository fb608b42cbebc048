"""The index of a bag's chunks, kept on disk while the bag is written.

It belongs at a file's end, and mcap's writer keeps it in memory until then: 1.4 kB a chunk, 47 MB in an hour
of the cell.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.records import ChunkIndex
from mcap.writer import Writer

_INDICES = "_Writer__chunk_indices"  # the writer appends to it, and goes over it once at the end
_HEADER = 9  # opcode and length of a record [bytes]


def keep_index_on_disk(writer: Writer, folder: Path) -> None:
    """Give a new writer a list that keeps its records in a file without a name, in the bag's folder.

    Raises:
        OSError: the file cannot be made. The writer passes on what appending raises.
    """
    assert getattr(writer, _INDICES) == []
    setattr(writer, _INDICES, _IndicesOnDisk(folder))


class _IndicesOnDisk:
    """What a writer needs of its list."""

    def __init__(self, folder: Path) -> None:
        self._file = tempfile.TemporaryFile(dir=folder)

    def append(self, index: ChunkIndex) -> None:
        builder = RecordBuilder()
        index.write(builder)
        self._file.write(builder.end())

    def __iter__(self) -> Iterator[ChunkIndex]:
        end = self._file.tell()
        self._file.seek(0)
        stream = ReadDataStream(self._file)
        while stream.count < end:
            stream.read(_HEADER)
            yield ChunkIndex.read(stream)
        self._file.close()
