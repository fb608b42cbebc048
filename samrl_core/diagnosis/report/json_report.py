"""report.json, schema 1, for programs: all keys of the contract, null where nothing is known."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.common.text_files import parse_json, read_text
from samrl_core.diagnosis.report.report_schema import SCHEMA, check_report
from samrl_core.diagnosis.result import Diagnosis, HeldOutGap, NamedEffect

_NO_GAP = HeldOutGap("", "", math.nan, None, None, None, None, None, None)


def to_json(diagnosis: Diagnosis) -> dict:
    """The diagnosis as plain JSON values; what is not finite becomes null.

    Beyond the contract: reasons, alarms, notes, runner_ups, tracked, nearest, signatures, couplings, heatmap,
    tiles, information, least_sizes, timelines, curves, timings, settings, arm. The traces of overlays and
    the data points of curves are left to report.html.

    Raises:
        InputError: a value in `settings` that JSON cannot hold, or a report that breaks its own schema.
    """
    d = diagnosis
    report = {
        "schema": SCHEMA,
        "verdict": d.verdict,
        "where": [asdict(item) for item in d.where],
        "effects": [_effect(e) for e in d.effects],
        "ambiguity_set": d.ambiguity_set,
        "next_experiment": asdict(d.next_experiment) if d.next_experiment else None,
        "gap": {"held_out": _held_out(d.gap or _NO_GAP)},
        "unexplained_fraction": d.unexplained_fraction,
        "not_testable": d.not_testable,
        "inputs": [asdict(item) for item in d.inputs],
        "seed": d.seed,
        "version": d.version,
        "arm": d.arm,
        "reasons": d.reasons,
        "alarms": d.alarms,
        "notes": d.notes,
        "runner_ups": [_effect(e) for e in d.runner_ups],
        "tracked": [_effect(e) for e in d.tracked],
        "nearest": _effect(d.nearest) if d.nearest else None,
        "signatures": [
            {
                "place": s.place,
                "channel": s.channel,
                "hints": [{"what": w, "correlation": c} for w, c in s.hints],
            }
            for s in d.signatures
        ],
        "couplings": [
            {"joint": joint, "driven_by": source, "quantity": quantity, "correlation": correlation}
            for joint, source, quantity, correlation in d.couplings
        ],
        "heatmap": None
        if d.heatmap is None
        else {
            "places": d.heatmap.places,
            "columns": [{"channel": channel, "phase": phase} for channel, phase in d.heatmap.columns],
            "values": d.heatmap.values,
            "threshold": d.heatmap.threshold,
        },
        "tiles": [asdict(t) for t in d.tiles],
        "information": d.information,
        "least_sizes": [asdict(s) for s in d.least_sizes],
        "timelines": [
            {
                "recording": t.recording,
                "time": t.time,
                "energy": t.energy,
                "threshold": t.threshold,
                "onset": t.onset,
            }
            for t in d.timelines
        ],
        "curves": [
            {
                "effect": c.effect,
                "x_label": c.x_label,
                "y_label": c.y_label,
                "fit_x": c.fit_x,
                "fit_y": c.fit_y,
            }
            for c in d.curves
        ],
        "timings": d.timings,
        "settings": d.settings,
    }
    plain = {key: _plain(value, f"report.{key}") for key, value in report.items()}
    check_report(plain)
    return plain


def json_text(report: dict) -> str:
    """A report as its file holds it.

    Raises:
        InputError: it breaks the schema.
    """
    check_report(report)
    return json.dumps(report, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def read_report(path: Path) -> dict:
    """Read a report.json and check it.

    Raises:
        InputError: no such file, no JSON, or it breaks the schema.
    """
    try:
        report = parse_json(read_text(path, "the report"), str(path))
    except InputError as error:
        raise InputError(f"cannot read the report {path}: {error}") from error
    check_report(report)
    return report


def _effect(e: NamedEffect) -> dict:
    return {**asdict(e), "name": e.name}


def _held_out(gap: HeldOutGap) -> dict:
    values = asdict(gap)
    values["metric"] = gap.metric or None
    values["unit"] = gap.unit if gap.metric else None
    values["channels"] = [
        {"quantity": quantity, "unit": unit, "nominal": nominal, "with_effect": with_effect}
        for quantity, unit, nominal, with_effect in gap.channels
    ]
    return values


def _plain(value: object, where: str) -> object:
    """JSON's own types only; NumPy's become Python's and numbers that are not finite become None."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if value is None or isinstance(value, bool | str | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): _plain(item, f"{where}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item, f"{where}[{i}]") for i, item in enumerate(value)]
    if isinstance(value, Path):
        return str(value)
    raise InputError(
        f"{where} is a {type(value).__name__}, which JSON cannot hold; hand in numbers, text or lists"
    )
