"""Reads and checks a mapping file."""

from __future__ import annotations

import keyword
from pathlib import Path
from typing import Any

import yaml

from samrl_core.common.errors import InputError
from samrl_ros.log_import.formulas import FUNCTIONS
from samrl_ros.log_import.keys import Keys
from samrl_ros.log_import.specs import (
    ChannelSpec,
    ColumnSpec,
    Filter,
    Mapping,
    QuantitySpec,
    RecordingSpec,
    Resample,
    SourceSpec,
    TimeSpec,
)
from samrl_ros.log_import.tables import CsvOptions
from samrl_ros.log_import.units import UNITS, factor

ROLES = ("fit", "held_out")
MISSING = ("error", "drop_row", "hold", "linear")
CHANNELS = {
    "states": ("position", "velocity", "effort"),
    "command": ("position", "velocity", "acceleration", "effort"),
    "commanded_effort": ("effort",),
}
_DEFAULT_UNIT = {"position": "rad", "velocity": "rad/s", "acceleration": "rad/s2", "effort": "N m"}
_OF_A_RECORDING = ("name", "role", "files", "rows", "time_range")


def read_mapping(path: Path | str) -> Mapping:
    """Read and check a mapping. Raises `InputError` with the exact key path of what is wrong."""
    path = Path(path)
    try:
        content = yaml.safe_load(path.read_text())
    except OSError as error:
        raise InputError(f"cannot read the mapping {path}: {error.strerror or error}") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is no YAML: {' '.join(str(error).split())}") from error
    whole = Keys(content, f"{path.name}:")
    general = {k: v for k, v in whole.items().items() if k not in ("recordings", "about")}
    listed = whole.list("recordings")
    recordings = []
    for number, entry in enumerate(listed):
        where = f"{path.name}: recordings[{number}]"
        own = Keys(entry, where).items()
        recordings.append(_recording(Keys({**general, **own}, where)))
    names = [recording.name for recording in recordings]
    if not names or len(set(names)) != len(names):
        raise InputError(f"{path.name}: recordings {names}: at least one, and each name once")
    return Mapping(path, tuple(recordings))


def _recording(keys: Keys) -> RecordingSpec:
    name = keys.text("name")
    if not name or "/" in name or name.startswith("."):
        raise InputError(f"{keys.at('name')} is {name!r}, must be usable as a file name")
    joints = keys.list("joints")
    if not joints or not all(isinstance(j, str) for j in joints) or len(set(joints)) != len(joints):
        raise InputError(f"{keys.at('joints')} is {joints!r}, must be a list of different names")
    files = keys.keys("files", None)
    own_files = files.items() if files is not None else {}
    general = _resample(keys.keys("resample", None), keys.at("resample"), Resample())
    sources_keys = keys.keys("sources")
    sources = {
        str(source): _source(Keys(value, sources_keys.at(source)), own_files.pop(source, None), name)
        for source, value in sources_keys.items().items()
    }
    if own_files:
        raise InputError(f"{keys.at('files')}: no source {sorted(own_files)}; there are {sorted(sources)}")
    channels_keys = keys.keys("channels")
    channels = {
        channel: _channel(Keys(value, channels_keys.at(channel)), channel, sources, len(joints), general)
        for channel, value in channels_keys.items().items()
    }
    if "states" not in channels or "position" not in channels["states"].quantities:
        raise InputError(f"{keys.at('channels')}.states.position is missing; nothing can be said without it")
    spec = RecordingSpec(
        name=name,
        role=_one_of(keys, "role", ROLES, "fit"),
        path=keys.path,
        arm=keys.text("arm", "tool_arm"),
        joints=tuple(joints),
        urdf=keys.text("urdf", None),
        strip=tuple(map(str, keys.list("strip", ["visual", "collision"]))),
        controller=_plain(keys, "controller"),
        tool=_plain(keys, "tool"),
        tolerances=_plain(keys, "tolerances"),
        constants=_constants(keys),
        sources=sources,
        channels=channels,
        rows=keys.pair("rows"),
        time_range=keys.pair("time_range"),
    )
    keys.end()
    return spec


def _plain(keys: Keys, key: str) -> dict[str, Any] | None:
    inside = keys.keys(key, None)
    return None if inside is None else inside.items()


def _one_of(keys: Keys, key: str, allowed: tuple[str, ...], default: str) -> str:
    value = keys.text(key, default)
    if value not in allowed:
        raise InputError(f"{keys.at(key)} is {value!r}, must be one of {', '.join(allowed)}")
    return value


def _identifier(name: str, where: str) -> str:
    if not name.isidentifier() or keyword.iskeyword(name) or name in FUNCTIONS or name == "pi":
        raise InputError(f"{where}: {name!r} cannot be a name in formulas; use letters, digits and _")
    return name


def _constants(keys: Keys) -> dict[str, Any]:
    inside = keys.keys("constants", None)
    return {} if inside is None else {_identifier(k, inside.path): v for k, v in inside.items().items()}


def _source(keys: Keys, own: Any, name: str) -> SourceSpec:
    files = own if own is not None else keys.any("file")
    keys.has("file")
    files = [files] if isinstance(files, str) else files
    if not isinstance(files, list) or not files or not all(isinstance(f, str) for f in files):
        raise InputError(f"{keys.at('file')} is {files!r}, must be a path or a list of paths")
    spec = SourceSpec(
        path=keys.path,
        files=tuple(f.replace("{name}", name) for f in files),
        csv=_csv(keys.keys("csv", None)),
        time=_time(keys.keys("time")),
        columns=_columns(keys, len(files)),
        values=_values(keys),
    )
    keys.end()
    return spec


def _csv(keys: Keys | None) -> CsvOptions:
    if keys is None:
        return CsvOptions()
    header = keys.any("header", True)
    if not isinstance(header, bool):
        raise InputError(f"{keys.at('header')} is {header!r}, must be true or false")
    delimiter = keys.text("delimiter", ",")
    if len(delimiter) != 1:
        raise InputError(f"{keys.at('delimiter')} is {delimiter!r}, must be one character")
    options = CsvOptions(
        delimiter,
        header,
        int(keys.number("skip_lines", 0)),
        keys.text("comment", ""),
        keys.text("decimal", "."),
    )
    keys.end()
    return options


def _time(keys: Keys) -> TimeSpec:
    offset = keys.number("offset_s", 0.0)
    if keys.has("rate_hz"):
        spec = TimeSpec(None, rate_hz=keys.positive("rate_hz"), offset_s=offset)
        keys.end()
        return spec
    column = str(keys.any("column"))
    iso = keys.any("iso", False) is True
    scale = 1.0 if iso else factor("time", keys.text("unit", "s"), keys.at("unit"))
    repeated = _one_of(keys, "repeated", ("error", "drop"), "error")
    keys.end()
    return TimeSpec(column, scale, iso, None, offset, repeated == "drop")


def _columns(keys: Keys, files: int) -> dict[str, ColumnSpec]:
    inside = keys.keys("columns")
    general = _one_of(keys, "missing", MISSING, "error")
    columns = {}
    for name, value in inside.items().items():
        _identifier(name, inside.path)
        if not isinstance(value, dict):
            columns[name] = ColumnSpec(str(value), missing=general)
            continue
        one = Keys(value, inside.at(name))
        number = int(one.number("file", 0))
        if not 0 <= number < files:
            raise InputError(f"{one.at('file')} is {number}, the source has {files} files (from 0)")
        columns[name] = ColumnSpec(
            str(one.any("column")),
            number,
            _one_of(one, "missing", MISSING, general),
            one.any("transpose", False) is True,
        )
        one.end()
    return columns


def _values(keys: Keys) -> dict[str, str | float]:
    inside = keys.keys("values", None)
    if inside is None:
        return {}
    return {_identifier(name, inside.path): value for name, value in inside.items().items()}


def _channel(
    keys: Keys, channel: str, sources: dict[str, SourceSpec], joints: int, general: Resample
) -> ChannelSpec:
    if channel not in CHANNELS:
        raise InputError(f"{keys.path} is no channel; there are {', '.join(CHANNELS)}")
    source = keys.text("source", next(iter(sources)) if len(sources) == 1 else None)
    if source not in sources:
        raise InputError(f"{keys.at('source')} is {source!r}; sources are {sorted(sources)}")
    quantities = {
        quantity: _quantity(keys, quantity, joints) for quantity in CHANNELS[channel] if keys.has(quantity)
    }
    if not quantities:
        raise InputError(f"{keys.path} carries none of {', '.join(CHANNELS[channel])}")
    spec = ChannelSpec(
        keys.path, source, quantities, _resample(keys.keys("resample", None), keys.at("resample"), general)
    )
    keys.end()
    return spec


def _quantity(keys: Keys, quantity: str, joints: int) -> QuantitySpec:
    value, path = keys.any(quantity), keys.at(quantity)
    unit, smoothing, formula = _DEFAULT_UNIT[quantity], None, value
    if isinstance(value, dict):
        inside = Keys(value, path)
        formula = inside.any("formula")
        unit = inside.text("unit", unit)
        if unit not in UNITS[quantity] or inside.has("unit"):
            factor(quantity, unit, inside.at("unit"))
        smoothing = _filter(inside.keys("filter", None))
        inside.end()
    scale = factor(quantity, unit, path)
    if formula == "derivative":
        if quantity != "velocity" or not keys.has("position"):
            raise InputError(f"{path}: only velocity can be the derivative, and of a position beside it")
        return QuantitySpec(path, (), False, unit, 1.0, smoothing)
    if isinstance(formula, list):
        if len(formula) != joints:
            raise InputError(f"{path} has {len(formula)} formulas for {joints} joints; give one per joint")
        return QuantitySpec(path, tuple(formula), False, unit, scale, smoothing)
    return QuantitySpec(path, (formula,), True, unit, scale, smoothing)


def _resample(keys: Keys | None, path: str, general: Resample) -> Resample:
    if keys is None:
        return general
    rate = keys.positive("rate_hz", None)
    if keys.any("filter", None) is None and rate is not None:
        raise InputError(
            f"{path}.filter is missing: state {{kind: butterworth, order: 4, cutoff_hz: ...}}, or none"
        )
    smoothing = None if keys.any("filter", "none") == "none" else _filter(keys.keys("filter"))
    if smoothing is not None and rate is not None and smoothing.cutoff_hz >= 0.5 * rate:
        raise InputError(
            f"{path}.filter.cutoff_hz is {smoothing.cutoff_hz}, must be below half the new rate {rate} Hz"
        )
    keys.end()
    return Resample(rate, smoothing)


def _filter(keys: Keys | None) -> Filter | None:
    if keys is None:
        return None
    _one_of(keys, "kind", ("butterworth",), "butterworth")
    order = int(keys.positive("order", 4))
    if order > 10:
        raise InputError(f"{keys.at('order')} is {order}, at most 10")
    smoothing = Filter(order, keys.positive("cutoff_hz"))
    keys.end()
    return smoothing
