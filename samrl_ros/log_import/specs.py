"""What a mapping says, parsed: recordings, sources, columns, channels, quantities."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from samrl_ros.log_import.tables import CsvOptions


@dataclass(frozen=True)
class TimeSpec:
    """Where a source's time comes from: a column, or a rate."""

    column: str | None
    scale: float = 1.0  # to seconds
    iso: bool = False
    rate_hz: float | None = None
    offset_s: float = 0.0
    drop_repeated: bool = False


@dataclass(frozen=True)
class ColumnSpec:
    """One column under the name that formulas use."""

    column: str
    file: int = 0
    missing: str = "error"
    transpose: bool = False


@dataclass(frozen=True)
class SourceSpec:
    """Files of equal length, side by side, and their time."""

    path: str  # of the keys, for messages
    files: tuple[str, ...]
    csv: CsvOptions
    time: TimeSpec
    columns: dict[str, ColumnSpec]
    values: dict[str, str | float]  # intermediate formulas, in order


@dataclass(frozen=True)
class Filter:
    """Butterworth, forwards and backwards: no phase, twice the order."""

    order: int
    cutoff_hz: float


@dataclass(frozen=True)
class Resample:
    """A new even rate (None: as recorded) after a filter (None: none)."""

    rate_hz: float | None = None
    filter: Filter | None = None


@dataclass(frozen=True)
class QuantitySpec:
    """One quantity: a formula per joint, one for all, or the derivative of position."""

    path: str
    formulas: tuple[str | float, ...]  # empty for a derivative
    whole: bool  # one formula that gives (N, J)
    unit: str
    scale: float
    filter: Filter | None = None


@dataclass(frozen=True)
class ChannelSpec:
    """One channel of the recording."""

    path: str
    source: str
    quantities: dict[str, QuantitySpec]
    resample: Resample


@dataclass(frozen=True)
class RecordingSpec:
    """Everything about one recording, general keys and its own merged."""

    name: str
    role: str
    path: str
    arm: str
    joints: tuple[str, ...]
    urdf: str | None  # path, or XML text
    strip: tuple[str, ...]
    controller: dict[str, Any] | None
    tool: dict[str, Any] | None
    tolerances: dict[str, Any] | None
    constants: dict[str, Any]
    sources: dict[str, SourceSpec]
    channels: dict[str, ChannelSpec]
    rows: tuple[float | None, float | None] | None = None
    time_range: tuple[float | None, float | None] | None = None


@dataclass(frozen=True)
class Mapping:
    """A mapping file."""

    path: Path
    recordings: tuple[RecordingSpec, ...] = field(default=())
