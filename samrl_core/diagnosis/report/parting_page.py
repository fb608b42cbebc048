"""parting.html: two logs on one clock, what parts first in front."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape

import matplotlib.pyplot as plt

from samrl_core.common.figure_file import picture_bytes
from samrl_core.diagnosis.two_logs import Parting

MOST_PANELS = 6
_STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;
padding:0 1rem;color:#222}
table{border-collapse:collapse}td,th{padding:.2rem .8rem .2rem 0;text-align:left}img{max-width:100%}"""


def parting_page(found: Parting, real: str, simulated: str, notes: Sequence[str]) -> str:
    """The page as one file."""
    rows = "".join(
        "<tr>"
        + "".join(
            f"<td>{escape(cell)}</td>"
            for cell in (
                c.joint, c.quantity, "never" if c.parts_at is None else f"{c.parts_at:.2f} s",
                f"{c.share:.0%}", f"{c.rms:.3g} {c.unit}", f"{c.relative:.1%}", c.phase,
            )
        )
        + "</tr>"
        for c in found.channels
    )  # fmt: skip
    head = "".join(
        f"<th>{h}</th>"
        for h in ("joint", "quantity", "parts at", "of the time", "rms", "of its range", "most at")
    )
    told = "".join(f"<li>{escape(note)}</li>" for note in notes)
    picture = base64.b64encode(_picture(found)).decode()
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>Two logs</title>'
        f"<style>{_STYLE}</style><h1>{escape(real)} beside {escape(simulated)}</h1>"
        f"<p>The simulator's clock is moved by {found.shift_s:.3f} s. What parts first stands"
        " first: the cause is near"
        f" it, the rest follows.</p><ul>{told}</ul>"
        f'<img alt="both logs" src="data:image/png;base64,{picture}">'
        f"<table><tr>{head}</tr>{rows}</table></html>\n"
    )


def _picture(found: Parting) -> bytes:
    best = found.channels[:MOST_PANELS]
    figure, axes = plt.subplots(len(best), 1, figsize=(9, 2 * len(best)), squeeze=False, sharex=True)
    for axis, c in zip(axes[:, 0], best, strict=True):
        axis.plot(c.time, c.real, color="black", lw=1.3, label="machine")
        axis.plot(c.time, c.simulated, color="#c2611f", lw=1, label="simulator")
        if c.parts_at is not None:
            axis.axvline(c.parts_at, color="#2a6fbb", lw=1, ls="--", label="they part")
        axis.set_ylabel(f"{c.joint}\n{c.quantity} [{c.unit}]", fontsize=8)
    axes[0, 0].legend(ncol=3, fontsize=8, loc="upper right")
    axes[-1, 0].set_xlabel("time [s]")
    figure.tight_layout()
    picture = picture_bytes(figure, dpi=100)
    plt.close(figure)
    return picture
