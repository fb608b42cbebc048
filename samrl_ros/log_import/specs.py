"""A mapping file: recordings, sources, columns, channels, quantities, and what each may hold."""

from __future__ import annotations

import keyword
from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Protocol, Self

from pydantic import AfterValidator, BeforeValidator, Field, NonNegativeInt, PrivateAttr, model_validator

from samrl_core.common.errors import InputError
from samrl_core.common.names import known_are
from samrl_core.common.validation import Checked, fault
from samrl_ros.log_import.formulas import FUNCTIONS
from samrl_ros.log_import.units import SI, factor

CHANNELS = {
    "states": ("position", "velocity", "effort"),
    "command": ("position", "velocity", "acceleration", "effort"),
    "commanded_effort": ("effort",),
    "torque_enabled": ("enabled",),
}
Missing = Literal["error", "drop_row", "drop_cell", "hold", "linear"]  # drop_cell: of trials of a depth
Formula = Any  # text or number; `evaluate` refuses the rest with the key path


def _name(value: str) -> str:
    if not value.isidentifier() or keyword.iskeyword(value) or value in FUNCTIONS or value == "pi":
        raise fault(f": {value!r} cannot be a name in formulas; use letters, digits and _")
    return value


def file_name(value: str) -> str:
    """The name, if it is usable as a file's. Raises a fault of validation otherwise."""
    if not 0 < len(value) <= 200 or "/" in value or value.startswith(".") or not value.isprintable():
        raise fault(f" is {value[:80]!r}, must be usable as a file name of at most 200 letters")
    return value


def _joints(value: list[str]) -> list[str]:
    if not value or len(set(value)) != len(value):
        raise fault(f" is {value!r}, must be a list of different names")
    return value


def _pair(value: Any) -> Any:
    good = isinstance(value, list) and len(value) == 2
    if not good or not all(v is None or (isinstance(v, int | float) and v is not True) for v in value):
        raise fault(f" is {value!r}, must be [begin, end]; null is open")
    return tuple(value)


Name = Annotated[str, AfterValidator(_name)]
Files = Annotated[
    list[str],
    BeforeValidator(lambda value: [value] if isinstance(value, str) else value),
    Field(min_length=1),
]
Header = Annotated[str, BeforeValidator(lambda value: str(value) if isinstance(value, int) else value)]
Positive = Annotated[float, Field(gt=0)]
Pair = Annotated[tuple[int | float | None, int | float | None], BeforeValidator(_pair)]


class CsvOptions(Checked):
    """How a text file is written."""

    delimiter: Annotated[str, Field(min_length=1, max_length=1)] = ","  # a blank: any white space
    # First line names the columns; else they are called 0, 1, ..., or as listed here, and every line is data.
    header: bool | Annotated[list[str], Field(min_length=1)] = True
    skip_lines: NonNegativeInt = 0  # before the header
    header_lines: Annotated[int, Field(ge=1)] = 1  # lines of names: of groups, and of what is in them
    pairs: Literal["", ":", "="] = ""  # mark between a name and its number, where each line repeats the names
    comment: str = ""  # lines that start with it are left out
    decimal: Annotated[str, Field(min_length=1, max_length=1)] = "."
    rows_per_sample: Annotated[int, Field(ge=1)] = 1  # lines of a matrix that are one; its numbers are `data`
    label: str = ""  # column whose text says what a row is of; `part` names the rows that are read

    @model_validator(mode="after")
    def _one_header(self) -> CsvOptions:
        if self.header_lines > 1 and (self.header is not True or self.pairs):
            raise fault(" has header_lines, whose names are the columns'; leave header and pairs out")
        return self


class ImageOptions(Checked):
    """Depth images of a plane: scale, intrinsics of the camera, and a table with a row for each image."""

    per_metre: Positive  # raw numbers of one metre
    fx: Positive  # [pixels], as the others
    fy: Positive
    cx: float
    cy: float
    surfaces: Annotated[int, Field(ge=1, le=5)] = 1  # planes that read; more where a board is before a wall
    list: str | None = None  # a text table in the folder of the images; ".": arrays of the stack's own file
    name: str = ""  # its column that names the image; else its rows are in the images' order
    csv: CsvOptions = CsvOptions()  # how it is written


class TimeSpec(Checked):
    """Where a source's time comes from: a column, a rate, or a column that counts frames at a rate."""

    column: Header | None = None
    unit: str = "s"
    iso: bool = False
    nanoseconds: Header | None = None  # a second column that is added, such as a ROS stamp's nanosec
    microseconds: Header | None = None  # likewise, as ABB's EGM and C's timeval have it
    rate_hz: Positive | None = None  # without a column: of all rows
    offset_s: float = 0.0
    repeated: Literal["error", "drop"] = "error"

    @model_validator(mode="after")
    def _either(self) -> TimeSpec:
        if self.column is None and self.rate_hz is None:
            raise fault(" must have column or rate_hz; both where the column counts frames")
        rests = [rest for rest in (self.nanoseconds, self.microseconds) if rest is not None]
        if len(rests) > 1:
            raise fault(" has nanoseconds and microseconds; the rest of a second is one of them")
        if self.rate_hz is not None and (self.iso or rests or self.unit != "s"):
            raise fault(" with rate_hz counts frames: leave unit, iso, nanoseconds and microseconds out")
        _known_unit("time", self.unit)
        return self


class ColumnSpec(Checked):
    """One column under the name that formulas use."""

    column: Header
    file: NonNegativeInt = 0
    missing: Missing | None = None  # None: the source's
    empty: float | None = None  # cells of this number are empty: what a tracker writes for lost frames
    transpose: bool = False


def _column(value: Any) -> Any:
    if isinstance(value, bool) or value is None:
        raise fault(f" is {value} to YAML; put the column's name in quotes, as in 'true'")
    return value if isinstance(value, dict) else {"column": str(value)}


Part = Annotated[str, BeforeValidator(lambda value: str(value) if isinstance(value, int) else value)]


class SourceSpec(Checked):
    """Files of equal length, side by side, and their time."""

    file: Files | None = None  # None: `files` of the recording names it
    # Topic of a bag, episode of a dataset, group of HDF5, keys down to JSON's samples, label of rows.
    part: Part = ""
    csv: CsvOptions = CsvOptions()
    joint_column: str = ""  # says which joint a row is of; the rows of a sample become columns `q.J1`
    images: ImageOptions | None = None  # the file is a folder or a stack of depth images
    time: TimeSpec | None = None  # None: the file's own, such as a bag's stamps
    columns: dict[Name, Annotated[ColumnSpec, BeforeValidator(_column)]]
    missing: Missing = "error"
    values: dict[Name, Formula] = Field({})  # intermediate formulas, in order


class Filter(Checked):
    """Butterworth, forwards and backwards: no phase, twice the order."""

    kind: Literal["butterworth"] = "butterworth"
    order: Annotated[int, Field(gt=0, le=10)] = 4
    cutoff_hz: Positive


class Resample(Checked):
    """A new even rate (None: as recorded) after a filter (None: none)."""

    rate_hz: Positive | None = None
    filter: Annotated[Filter | None, BeforeValidator(lambda v: None if v == "none" else v)] = None

    @model_validator(mode="after")
    def _stated(self) -> Resample:
        if self.rate_hz is not None and "filter" not in self.model_fields_set:
            raise fault(" is missing: state {kind: butterworth, order: 4, cutoff_hz: ...}, or none", "filter")
        if self.rate_hz is not None and self.filter and self.filter.cutoff_hz >= 0.5 * self.rate_hz:
            raise fault(
                f" is {self.filter.cutoff_hz}, must be below half the new rate {self.rate_hz} Hz",
                "filter",
                "cutoff_hz",
            )
        return self


class QuantitySpec(Checked):
    """One quantity: a formula per joint (a list), one for all, or `derivative` of the position."""

    formula: Formula
    unit: str | None = None  # None: SI
    source: str | None = None  # None: the channel's; of another it is taken at the channel's times
    filter: Filter | None = None

    @property
    def derivative(self) -> bool:
        """Whether it is computed from the position beside it."""
        return self.formula == "derivative"

    @property
    def formulas(self) -> list[Formula]:
        """One per joint, or one that gives all joints; none for a derivative."""
        if self.derivative:
            return []
        return self.formula if isinstance(self.formula, list) else [self.formula]


Quantity = Annotated[
    QuantitySpec, BeforeValidator(lambda value: value if isinstance(value, dict) else {"formula": value})
]


class ChannelSpec(Checked):
    """One channel of the recording."""

    source: str | None = None  # None: the only one
    resample: Resample | None = None  # None: the recording's
    position: Quantity | None = None
    velocity: Quantity | None = None
    acceleration: Quantity | None = None
    effort: Quantity | None = None
    enabled: Quantity | None = None  # other than zero: the drive gives torque

    @property
    def quantities(self) -> dict[str, QuantitySpec]:
        """Those that are there, by name."""
        found = ((name, getattr(self, name)) for name in SI)
        return {name: quantity for name, quantity in found if quantity is not None}


class Formulas(Protocol):
    """A quantity's formulas."""

    @property
    def formulas(self) -> list[Formula]:
        """One per component, or one that gives all."""
        ...


class Reader(Protocol):
    """What computes quantities from one source: a channel, a track, an arm's joints."""

    @property
    def source(self) -> str | None:
        """Its name; None: the only one."""
        ...

    @property
    def quantities(self) -> Mapping[str, Formulas]:
        """Formulas by key."""
        ...


def source_of_quantity(quantity: Formulas) -> str | None:
    """The source that a quantity names for itself; None: what its channel reads."""
    return getattr(quantity, "source", None)


class LoggedSpec(Checked):
    """What a recording of any kind states of its logs, general keys and its own merged."""

    name: Annotated[str, AfterValidator(file_name)]
    tolerances: dict[str, Any] | None = None
    constants: dict[Name, Any] = Field({})
    sources: Annotated[dict[str, SourceSpec], Field(min_length=1)]
    files: dict[str, Files] = Field({})  # of a source, instead of its own
    parts: dict[str, Part] = Field({})  # of a source, instead of its own
    rows: Pair | None = None
    _path: str = PrivateAttr("")

    @classmethod
    def read(cls, value: Any, where: str) -> Self:
        """As `Checked.read`; `where` is stored for later messages."""
        spec = super().read(value, where)
        spec._path = where
        return spec

    @property
    def path(self) -> str:
        """Of its keys, for messages."""
        return self._path

    def files_of(self, source: str) -> list[str]:
        """Paths of a source, with the recording's name in them."""
        files = self.files.get(source) or self.sources[source].file or []
        return [file.replace("{name}", self.name) for file in files]

    def part_of(self, source: str) -> str:
        """Part of a source's files that is read, with the recording's name in it; empty for all."""
        return (self.parts.get(source) or self.sources[source].part).replace("{name}", self.name)

    @abstractmethod
    def readers(self) -> Mapping[str, Reader]:
        """What reads the sources, by its key path in the recording."""

    def source_of(self, reader: Reader) -> str:
        """The source that its formulas read."""
        return reader.source or next(iter(self.sources))

    def sources_of(self, reader: Reader) -> list[str]:
        """That, and those that quantities of it name for themselves."""
        own = [source_of_quantity(quantity) for quantity in reader.quantities.values()]
        return list(dict.fromkeys([self.source_of(reader), *filter(None, own)]))

    @model_validator(mode="after")
    def _sources_fit(self) -> Self:
        for key, named in (("files", self.files), ("parts", self.parts)):
            if unknown := sorted(set(named) - set(self.sources)):
                raise fault(f": no source {unknown}; there are {sorted(self.sources)}", key)
        for path, reader in self.readers().items():
            if (reader.source or len(self.sources) > 1) and reader.source not in self.sources:
                known = sorted(self.sources)
                raise fault(f" is {reader.source!r}; sources are {known}", *path.split("."), "source")
            for key, quantity in reader.quantities.items():
                if (own := source_of_quantity(quantity)) is not None and own not in self.sources:
                    known = sorted(self.sources)
                    raise fault(f" is {own!r}; sources are {known}", *path.split("."), key, "source")
        used = [name for reader in self.readers().values() for name in self.sources_of(reader)]
        for name in dict.fromkeys(used):
            count = len(self.files_of(name))
            if not count:
                raise fault(" is missing; name a path or a list of paths", "sources", name, "file")
            for key, column in self.sources[name].columns.items():
                if column.file >= count:
                    raise fault(
                        f" is {column.file}, the source has {count} files (from 0)",
                        *("sources", name, "columns", key, "file"),
                    )
        return self


class RecordingSpec(LoggedSpec):
    """Everything about one recording, general keys and its own merged."""

    role: Literal["fit", "held_out"] = "fit"
    arm: Literal["tool_arm", "camera_arm"] = "tool_arm"
    joints: Annotated[list[str], AfterValidator(_joints)]
    urdf: str | None = None  # path of a URDF, xacro or MJCF, or the URDF's text
    xacro_args: dict[str, str] = Field({})
    strip: list[str] = Field(["visual", "collision"])
    controller: dict[str, Any] | None = None
    tool: dict[str, Any] | None = None
    channels: dict[str, ChannelSpec]
    resample: Resample = Resample()  # of channels without their own
    time_range: Pair | None = None

    def with_model(self, urdf: str) -> RecordingSpec:
        """The same with a URDF's text in place of its own."""
        return self.model_copy(update={"urdf": urdf, "xacro_args": {}})

    def readers(self) -> dict[str, ChannelSpec]:
        """Its channels."""
        return {f"channels.{name}": channel for name, channel in self.channels.items()}

    @model_validator(mode="after")
    def _channels_fit(self) -> RecordingSpec:
        for name, channel in self.channels.items():
            at = ("channels", name)
            if name not in CHANNELS:
                raise fault(f" is no channel; there are {', '.join(CHANNELS)}", *at)
            if not channel.quantities:
                raise fault(f" carries none of {', '.join(CHANNELS[name])}", *at)
            for quantity, one in channel.quantities.items():
                self._quantity_fits(one, name, quantity)
        if "states" not in self.channels or self.channels["states"].position is None:
            raise fault(".states.position is missing; nothing can be said without it", "channels")
        return self

    def _quantity_fits(self, one: QuantitySpec, channel: str, quantity: str) -> None:
        at = ("channels", channel, quantity)
        if quantity not in CHANNELS[channel]:
            listed = known_are(quantity, CHANNELS[channel], "known keys are")
            raise fault(f" is not known here; {listed}", *at)
        _known_unit(quantity, one.unit, *at)
        if one.derivative and (quantity != "velocity" or self.channels[channel].position is None):
            raise fault(": only velocity can be the derivative, and of a position beside it", *at)
        count = len(one.formulas)
        if isinstance(one.formula, list) and count != len(self.joints):
            raise fault(f" has {count} formulas for {len(self.joints)} joints; give one per joint", *at)


def _known_unit(quantity: str, unit: str | None, *below: str) -> None:
    try:
        factor(quantity, unit, "")
    except InputError as error:
        raise fault(str(error), *below, "unit") from error
