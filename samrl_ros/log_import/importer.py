"""Runs a mapping: files to columns, columns to quantities, quantities to recordings and bags."""

from __future__ import annotations

import hashlib
import json
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.robots.urdf_text import parse_urdf
from samrl_core.cell.types.arm_description import ArmController, ArmDescription, Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.cell.types.controllers import KINDS
from samrl_core.cell.types.drive_law import DriveLaw
from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file
from samrl_core.diagnosis.nominal_model.nominal_model import NominalModel
from samrl_core.diagnosis.nominal_model.read_model import read_model
from samrl_core.diagnosis.recordings import check_recording
from samrl_ros.log_import.formulas import evaluate
from samrl_ros.log_import.mapping import Mapping
from samrl_ros.log_import.resampling import are_between, even, find_gaps, low_pass, resample
from samrl_ros.log_import.sources import SourceData, read_source, update_digest
from samrl_ros.log_import.specs import Filter, QuantitySpec, RecordingSpec
from samrl_ros.log_import.units import DEFAULT_UNIT, SI, drive_factor, factor
from samrl_ros.recordings.described import described_by
from samrl_ros.recordings.nominal_texts import LAW, lenient_tolerances, parse_controller, parse_tool
from samrl_ros.recordings.read import RAW, moving_joints
from samrl_ros.recordings.write import write_recording


@dataclass(frozen=True, eq=False)
class ImportedRecording:
    """A recording made from logs, and what became of them."""

    recording: ArmRecording
    role: str  # fit or held_out
    report: tuple[str, ...]  # what each channel became
    notes: tuple[str, ...]  # what is odd
    raw: tuple[str, ...] = ()  # channels whose effort has no SI unit


def import_recording(spec: RecordingSpec, mapping: Mapping, data: Path) -> ImportedRecording:
    """Make one recording.

    Args:
        spec: one of the mapping.
        mapping: whose file the URDF is looked for beside as well.
        data: folder that paths count from.

    Raises:
        InputError: with the key path of what is wrong, or as `check_recording`.
    """
    report: list[str] = []
    notes: list[str] = []
    constants = {
        name: _constant(value, f"{spec.path}.constants.{name}") for name, value in spec.constants.items()
    }
    cache: dict[str, SourceData] = {}
    for source in (name for channel in spec.channels.values() for name in spec.sources_of(channel)):
        if source not in cache:
            cache[source] = read_source(spec, source, constants, data, notes)
    zero = float(cache[spec.source_of(spec.channels["states"])].time[0])
    arm = _arm(spec, constants, mapping.path, data, notes)
    law = None if arm.controller is None else arm.controller.law
    signals = {name: _signal(name, spec, cache, zero, law, report, notes) for name in spec.channels}
    digest = hashlib.sha256(mapping.text.encode() + spec.name.encode())
    for source in cache.values():
        for file in source.files:
            update_digest(digest, file)
    recording = ArmRecording(
        name=spec.name,
        source=", ".join(dict.fromkeys(str(f) for s in cache.values() for f in s.files)),
        sha256=digest.hexdigest(),
        arm=arm,
        states=signals["states"],
        command=signals.get("command"),
        commanded_effort=signals.get("commanded_effort"),
        torque_enabled=signals.get("torque_enabled"),
    )
    notes.extend(check_recording(recording))
    raw = tuple(
        name
        for name, channel in spec.channels.items()
        if "effort" in channel.quantities and channel.quantities["effort"].unit == "raw"
    )
    return ImportedRecording(recording, spec.role, tuple(report), tuple(notes), raw)


def write_bag(made: ImportedRecording, file: Path, mapping: str) -> None:
    """Write a bag whose metadata name the mapping, the role, and channels without an SI unit."""
    about = {"imported_by": mapping, "role": made.role}
    if made.raw:
        about[RAW] = ", ".join(made.raw)
    write_recording(made.recording, file, custom_data=about)


def _constant(value: Any, where: str) -> Any:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{where} is {value!r}, must be a number, a list or a matrix") from error
    if array.ndim > 2 or not np.isfinite(array).all():
        raise InputError(f"{where} is {value!r}, must be a finite number, list or matrix")
    return float(array) if array.ndim == 0 else array


def _signal(
    name: str,
    spec: RecordingSpec,
    sources: dict[str, SourceData],
    zero: float,
    law: DriveLaw | None,
    report: list[str],
    notes: list[str],
) -> JointSignal:
    """One channel from its sources; times count from `zero` [s]."""
    channel, where = spec.channels[name], f"{spec.path}.channels.{name}"
    plan = channel.resample or spec.resample
    time = sources[spec.source_of(channel)].time
    known = np.ones(len(time), dtype=bool)  # where every quantity is
    values: dict[str, np.ndarray] = {}
    for quantity, one in channel.quantities.items():
        path, own = f"{where}.{quantity}", sources[one.source or spec.source_of(channel)]
        if one.derivative:
            block = np.gradient(values["position"], time, axis=0)
        else:
            block = _in_si(quantity, one, own, len(spec.joints), law, path)
        _check_finite(block, own.time - zero, spec.joints, path)
        if one.filter is not None:
            block = _filtered(own.time, block, one.filter, f"{path}.filter")
        if own.time is not time:
            block = np.column_stack([np.interp(time, own.time, c) for c in block.T])
            known &= are_between(time, own.time)
        values[quantity] = block
    if not known.all():
        notes.append(f"{name}: {(~known).sum()} samples at which a quantity of another source is unknown")
        if known.sum() < 2:
            raise InputError(
                f"{where}: its sources have {known.sum()} moments in common; they share one clock"
            )
        time, values = _only(known, time, values)
    raw_rate = _rate(time)
    if (plan.rate_hz is not None or plan.filter is not None) and (gaps := find_gaps(time)).any():
        notes.append(
            f"{name}: {gaps.sum()} gaps of up to {np.diff(time).max():.3g} s are filled by straight lines, as"
            " it is resampled: nobody measured them; import without `resample`, or cut by `time_range`"
        )
    time, values = resample(time, values, plan, f"{where}.resample")
    if (rate := _rate(time)) < 0.9 * raw_rate and plan.filter is None:
        notes.append(f"{name}: {raw_rate:.5g} Hz down to {rate:.5g} Hz without a filter; expect aliasing")
    time = time - zero
    if spec.time_range is not None:
        low, high = spec.time_range
        keep = (time >= (-np.inf if low is None else low)) & (time < (np.inf if high is None else high))
        if not keep.any():
            raise InputError(f"{spec.path}.time_range {list(spec.time_range)} s holds no sample of {name}")
        time, values = _only(keep, time, values)
    report.extend(_describe(name, spec, time, values, raw_rate))
    if "enabled" in values:
        values = {"effort": (values["enabled"] != 0).astype(float)}
    return JointSignal(time, **values)


def _in_si(
    quantity: str, one: QuantitySpec, own: SourceData, joints: int, law: DriveLaw | None, path: str
) -> np.ndarray:
    """Values of a quantity (N, J) by its formulas, in SI units; efforts of a drive as torques by its law."""
    block = _block(one, own.values, (len(own.time), joints), path) * factor(quantity, one.unit, path)
    return block * drive_factor(one.unit, law, joints, path) if quantity == "effort" else block


def _check_finite(block: np.ndarray, time: np.ndarray, joints: Sequence[str], path: str) -> None:
    bad = ~np.isfinite(block)
    if bad.any():
        row, column = np.argwhere(bad)[0]
        raise InputError(
            f"{path}: {bad.sum()} numbers are not finite, first {joints[column]} at {time[row]:.4f} s; set"
            " what to do with empty cells by `missing` of the source"
        )


def _filtered(time: np.ndarray, block: np.ndarray, plan: Filter, path: str) -> np.ndarray:
    """A block (N, J) smoothed on an even grid, at its own times again."""
    grid, on_grid, uneven = even(time, block)
    smooth = low_pass(grid, on_grid, plan, path)
    return np.column_stack([np.interp(time, grid, c) for c in smooth.T]) if uneven else smooth


def _only(
    keep: np.ndarray, time: np.ndarray, values: dict[str, np.ndarray]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    return time[keep], {quantity: block[keep] for quantity, block in values.items()}


def _rate(time: np.ndarray) -> float:
    return 1.0 / float(np.median(np.diff(time)))


def _block(one: QuantitySpec, values: dict[str, Any], shape: tuple[int, int], where: str) -> np.ndarray:
    """Values of a quantity (N, J), as the formulas give them."""
    parts = [evaluate(formula, values, where) for formula in one.formulas]
    if isinstance(one.formula, list):
        block = np.column_stack([_column(part, shape[0], where) for part in parts])
    else:
        block = np.asarray(parts[0], dtype=float)
        if block.ndim == 0:
            block = np.full(shape, block)
        elif block.ndim == 1:
            block = _column(block, shape[0], where)[:, None]
    if block.shape != shape:
        raise InputError(f"{where} has shape {block.shape}, must be {shape}: one per joint")
    return block


def _column(value: Any, count: int, where: str) -> np.ndarray:
    array = np.asarray(value, dtype=float)
    if array.ndim == 0 or array.shape == (1,):
        return np.full(count, float(array.ravel()[0]))
    if array.shape != (count,):
        raise InputError(f"{where} gives shape {array.shape}, must be one number per sample, ({count},)")
    return array


def _describe(
    name: str, spec: RecordingSpec, time: np.ndarray, values: dict[str, np.ndarray], raw_rate: float
) -> list[str]:
    channel = spec.channels[name]
    rate = 1.0 / float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    plan = (channel.resample or spec.resample).filter
    how = f", Butterworth order {plan.order} zero-phase {plan.cutoff_hz:g} Hz" if plan is not None else ""
    lines = [
        f"{name} from {spec.source_of(channel)}: {len(time)} samples at {rate:.5g} Hz"
        f" (log {raw_rate:.5g} Hz{how}), {time[0]:.3f} to {time[-1]:.3f} s"
    ]
    for quantity, block in values.items():
        one = channel.quantities[quantity]
        origin = "derivative of position" if one.derivative else f"from {one.unit or DEFAULT_UNIT[quantity]}"
        if one.filter is not None:
            origin += f", Butterworth order {one.filter.order} zero-phase {one.filter.cutoff_hz:g} Hz"
        unit = "raw" if one.unit == "raw" else SI[quantity]
        spans = ", ".join(
            f"{j} {c.min():.4g} .. {c.max():.4g}" for j, c in zip(spec.joints, block.T, strict=True)
        )
        lines.append(f"  {quantity} [{unit}] ({origin}): {spans}")
    return lines


def _arm(
    spec: RecordingSpec, constants: dict[str, Any], mapping: Path, data: Path, notes: list[str]
) -> ArmDescription:
    model = None if spec.urdf is None else _model(spec, mapping, data)
    urdf = None if model is None else model.urdf
    if urdf is not None and (missing := [j for j in spec.joints if j not in moving_joints(urdf)]):
        raise InputError(
            f"{spec.path}.urdf moves {list(moving_joints(urdf))}, it lacks {missing} of joints"
            f" {list(spec.joints)}; names must be the same"
        )
    tolerances = Tolerances()
    if spec.tolerances is not None:
        tolerances, more = lenient_tolerances(spec.tolerances, f"{spec.path}.tolerances")
        notes.extend(more)
    controller = None if spec.controller is None else _controller(spec, spec.controller, constants, notes)
    tool = None
    if spec.tool is not None:
        tool, more = parse_tool(json.dumps(spec.tool), f"{spec.path}.tool")
        notes.extend(more)
    arm = ArmDescription(spec.arm, tuple(spec.joints), urdf, controller, tool, tolerances)
    if model is not None:
        arm, more = described_by(arm, model)
        notes.extend(more)
    return arm


def _controller(
    spec: RecordingSpec, given: dict[str, Any], constants: dict[str, Any], notes: list[str]
) -> ArmController | None:
    where = f"{spec.path}.controller"
    law = given.get("type", LAW)
    if law not in KINDS:
        raise InputError(f"{where}.type is {law!r}; known are {', '.join(KINDS)}")
    words = ("gravity_compensation", "between_commands", *KINDS[law].choices)
    about = {
        k: v if k in words else _numbers(v, constants, f"{where}.{k}")
        for k, v in given.items()
        if k not in ("type", "joints")
    }
    about |= {"type": law, "joints": list(spec.joints)}
    parsed = parse_controller(json.dumps(about), where)
    notes.extend(parsed.notes)
    return parsed.controller


def _numbers(value: Any, constants: dict[str, Any], where: str) -> Any:
    """Numbers or formulas over the constants, one or a list."""
    if isinstance(value, list):
        return [_numbers(each, constants, f"{where}[{k}]") for k, each in enumerate(value)]
    return np.asarray(evaluate(value, constants, where), dtype=float).tolist()


def _model(spec: RecordingSpec, mapping: Path, data: Path) -> NominalModel:
    """The model that a mapping names, without what dynamics do not need."""
    text = spec.urdf or ""
    if text.lstrip().startswith("<"):
        model = NominalModel("urdf", None, text, text)
    else:
        candidates = [folder / text for folder in (data, mapping.parent)]
        found = next((candidate for candidate in candidates if is_file(candidate)), None)
        if found is None:
            raise InputError(f"{spec.path}.urdf: no file {' or '.join(map(str, candidates))}")
        try:
            model = read_model(found, spec.xacro_args)
        except InputError as error:
            raise InputError(f"{spec.path}.urdf: {error}") from error
    root = parse_urdf(model.urdf, f"{spec.path}.urdf")
    for link in root.findall("link"):
        for part in [child for child in link if child.tag in spec.strip]:
            link.remove(part)
    return replace(model, urdf=ElementTree.tostring(root, encoding="unicode"))
