"""export.html: what was changed, what the simulator lacks and what comes nearest, before and after."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from samrl_core.common.array_file import unpacked
from samrl_core.common.figure_file import picture_bytes
from samrl_core.common.files import read_whole
from samrl_core.diagnosis.export.correction import MOST_BYTES, Correction
from samrl_core.diagnosis.export.statement import CONTROLLER, EXACT, MISSING, NEAREST, Statement

TITLES = {
    EXACT: "In the model, as diagnosed",
    NEAREST: "In the model, by what comes nearest",
    CONTROLLER: "Not in the model: for the code that commands the simulator",
    MISSING: "Not in the model",
}
UNITS = {"position": "rad", "velocity": "rad/s", "effort": "N m", "commanded_effort": "N m"}
MOST_PANELS = 4
_STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;
padding:0 1rem;color:#222}
table{border-collapse:collapse}td,th{padding:.2rem .8rem .2rem 0;text-align:left;vertical-align:top}
pre{background:#f5f5f3;padding:.8rem;overflow:auto;font-size:13px}.add{color:#05630c}.del{color:#9c1c1c}
img{max-width:100%}h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:1.8rem}"""


def page_of(
    correction: Correction,
    target: str,
    statements: Sequence[Statement],
    diff: str,
    found: dict[str, Any] | None,
    why_not: str,
    folder: Path,
) -> str:
    """The page as one file."""
    parts = [
        f"<h1>The correction in {escape(target)}</h1>",
        f"<p>{escape(', '.join(correction.effects))}</p>",
        _shrinks(correction, found, why_not),
    ]
    picture = folder / "resimulated.png"
    if found is not None:
        data = base64.b64encode(picture.read_bytes()).decode()
        parts.append(f'<img alt="held-out signals before and after" src="data:image/png;base64,{data}">')
    for how, title in TITLES.items():
        rows = [s for s in statements if s.how == how]
        if rows:
            parts.append(
                f"<h2>{title}</h2><table><tr><th>place</th><th>change</th><th>here</th><th>left</th></tr>"
            )
            parts += [_row(s) for s in rows]
            parts.append("</table>")
    if any(s.error is not None for s in statements):
        parts.append(
            "<p>Left: root mean square of what the nearest form misses over the recorded motion, relative to"
            " the effect it stands for.</p>"
        )
    lines = [f'<span class="{_class(line)}">{escape(line)}</span>' for line in diff.splitlines()]
    parts += [
        "<h2>Difference of the files</h2>",
        "<pre>" + "\n".join(lines) + "</pre>" if diff else "<p>none</p>",
    ]
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Export to {escape(target)}</title>'
        f"<style>{_STYLE}</style>{''.join(parts)}</html>\n"
    )


def _row(s: Statement) -> str:
    left = "" if s.error is None else f"{s.error:.0%}"
    cells = (escape(s.place), escape(s.what), escape(s.said), left)
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def _class(line: str) -> str:
    return "add" if line.startswith("+") else "del" if line.startswith("-") else ""


def _shrinks(c: Correction, found: dict[str, Any] | None, why_not: str) -> str:
    promised = c.promise.get("shrink")
    said = "" if promised is None else f" The report promises {promised:.0%} by its own simulation."
    if found is None:
        return f"<p>Not re-simulated: {escape(why_not)}.{said}</p>"
    rows = "".join(
        f"<tr><td>{escape(q)}</td><td>{v['before']:.3g}</td><td>{v['after']:.3g}</td></tr>"
        for q, v in found["quantities"].items()
    )
    return (
        f"<p>Held-out recordings re-simulated in {escape(found['engine'])}: the gap shrinks by"
        f" <b>{found['shrink']:.0%}</b>, from {found['before']:.3g} to {found['after']:.3g}"
        f" tolerances.{said}</p>"
        f"<table><tr><th>quantity</th><th>before</th><th>after</th></tr>{rows}</table>"
        "<p>Again by <code>python resimulate.py</code>, which needs NumPy and that simulator alone.</p>"
    )


def picture_of(correction: Correction, file: Path, target: str) -> bytes:
    """Held-out signals that the original model misses most: measured, original, changed."""
    runs = unpacked(read_whole(file, MOST_BYTES), file)
    scored = []
    for k, held in enumerate(correction.held_out):
        for quantity, unit in UNITS.items():
            if f"measured_{quantity}" not in held:
                continue
            error = (held[f"measured_{quantity}"] - runs[f"{k}.original.{quantity}"]) / held[
                f"scale_{quantity}"
            ]
            scored += [(float(e), k, quantity, unit, j) for j, e in enumerate(np.mean(error**2, axis=0))]
    scored.sort(reverse=True)
    best = scored[:MOST_PANELS]
    figure, axes = plt.subplots(len(best), 1, figsize=(9, 2.2 * len(best)), squeeze=False)
    for axis, (_, k, quantity, unit, j) in zip(axes[:, 0], best, strict=True):
        held = correction.held_out[k]
        axis.plot(held["time"], held[f"measured_{quantity}"][:, j], color="black", lw=1.4, label="measured")
        axis.plot(
            held["time"], runs[f"{k}.original.{quantity}"][:, j], color="#c2611f", lw=1, label="original"
        )
        axis.plot(held["time"], runs[f"{k}.changed.{quantity}"][:, j], color="#2a6fbb", lw=1, label="changed")
        axis.set_ylabel(f"{correction.joints[j]}\n{quantity} [{unit}]", fontsize=8)
    axes[0, 0].legend(ncol=3, fontsize=8, loc="upper right")
    axes[0, 0].set_title(f"held out, re-simulated in {target}", fontsize=10)
    axes[-1, 0].set_xlabel("time [s]")
    figure.tight_layout()
    picture = picture_bytes(figure, dpi=100)
    plt.close(figure)
    return picture
