"""What `samrl forge score` shows: the scores in the terminal, and one line per world for score.json."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from samrl_core.blind_test.scores.outcome import Outcome
from samrl_core.blind_test.scores.tile_scores import tile_iou


def show(scores: dict[str, Any], baseline_rows: Sequence[dict[str, Any]]) -> None:
    """Print the scores, and the baselines where there are any."""
    from samrl_core.blind_test.scores.page import share_text
    from samrl_core.blind_test.scores.table import score_rows

    screen, group = console(), ""
    table = Table(title="Blind test", title_justify="left", box=None, header_style="bold")
    for name in ("", "score", "value", "95 %", "cases", "aim"):
        table.add_column(name, justify="right" if name in ("value", "95 %", "cases") else "left")
    for row in score_rows(scores):
        colour = "" if row.met is None else ("green" if row.met else "red")
        aim = f"[{colour}]{row.aim}[/]" if colour else row.aim
        table.add_row(
            row.group if row.group != group else "", escape(row.name), row.value, row.interval, row.cases, aim
        )
        group = row.group
    screen.print(table)
    if baseline_rows:
        compared = Table(title="Baselines, same worlds", title_justify="left", box=None, header_style="bold")
        columns = {
            "top1_family": "family",
            "top1_family_place": "family and place",
            "false_alarms": "false alarms",
            "unknown_named": "unknown named",
        }
        for name in ("", *columns.values()):
            compared.add_column(name)
        for row in baseline_rows:
            compared.add_row(row["name"], *(share_text(row[c]) for c in columns))
        screen.print(compared)


def line(o: Outcome) -> dict[str, Any]:
    """One world in score.json: truth and diagnosis."""
    return {
        "id": o.truth.id,
        "set": o.truth.set,
        "true": o.truth.names,
        "form": o.truth.form,
        "severity": o.truth.severity,
        "engine": o.truth.engine,
        "background_scale": o.truth.background_scale,
        "withheld": o.withheld,
        "verdict": o.verdict,
        "named": [f"{e['family']}@{e['place']}" for e in o.named],
        "candidates": o.candidates[:5],
        "probability": None if o.primary is None else o.primary.get("probability"),
        "shrink": None if o.shrinks is None else o.shrinks.shrink,
        "oracle_shrink": o.shrinks.oracle_shrink if o.shrinks is not None else o.detail.get("oracle_shrink"),
        "unexplained_fraction": None if o.report is None else o.report.get("unexplained_fraction"),
        "tile_iou": tile_iou(o) if o.tiles else None,
        "seconds": o.seconds,
        "problem": o.detail.get("resimulation")
        or (o.detail.get("output", "")[-300:] if o.report is None else ""),
    }


def console(stderr: bool = False) -> Console:
    """As wide as the terminal; a pipe gets lines long enough for the tables."""
    tty = (sys.stderr if stderr else sys.stdout).isatty()
    return Console(stderr=stderr, width=None if tty else 150, highlight=False)
