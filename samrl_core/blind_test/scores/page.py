"""score.html: the scores, their pictures and provenance, in one self-contained file."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from typing import Any

from matplotlib.figure import Figure

from samrl_core.blind_test.scores import plots
from samrl_core.blind_test.scores.outcome import Outcome
from samrl_core.blind_test.scores.table import ScoreRow, score_rows

STYLE = """
:root{color-scheme:light}
body{font:15px/1.5 system-ui,sans-serif;color:#1f2933;margin:0 auto;max-width:70rem;padding:1.5rem}
h1{font-size:1.5rem;margin:.2rem 0}h2{font-size:1.1rem;margin:2rem 0 .5rem;border-bottom:1px solid #d9e2ec}
.scroll{overflow-x:auto}table{border-collapse:collapse;width:100%}
td,th{padding:.2rem .6rem;text-align:left;font-size:.88rem}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}tr:nth-child(even){background:#f5f7fa}
.met{color:#0b6e4f;font-weight:600}.missed{color:#c2410c;font-weight:600}figure{margin:0}figcaption{font-size:.85rem;color:#52606d}
td:nth-child(2){min-width:11rem}img{max-width:100%;height:auto}.wide{grid-column:1/-1}
.grid{display:grid;grid-template-columns:repeat(auto-fit,minmax(19rem,1fr));gap:1.2rem}
code{word-break:break-all;font-size:.8rem}
"""
WIDE = ("confusion",)  # pictures that need the page's whole width


def make_figures(scores: dict[str, Any], outcomes: Sequence[Outcome]) -> dict[str, tuple[str, Figure]]:
    """File name to caption and figure."""
    return {
        "severity": ("Seen, placed and named over severity", plots.severity_figure(scores["severity_curve"])),
        "families": ("Family right, per family", plots.family_figure(scores["which"]["per_family"])),
        "confusion": ("True family against the diagnosis", plots.confusion_figure(scores["confusion"])),
        "risk": (
            "Risk when only the most certain claims count",
            plots.risk_figure(scores["risk_coverage"]),
        ),
        "calibration": (
            "Stated probability against frequency",
            plots.calibration_figure(scores["calibration"]),
        ),
        "shrink": ("Held-out shrink, named against true effect", plots.shrink_figure(outcomes)),
    }


def score_page(
    scores: dict[str, Any],
    outcomes: Sequence[Outcome],
    facts: dict[str, Any],
    baselines: Sequence[dict[str, Any]] = (),
) -> str:
    """The whole page; `facts` is forge.json, `baselines` the rows of the comparison."""
    pictures = "".join(
        f"<figure class='{'wide' if name in WIDE else ''}'><img alt='{escape(caption)}' src="
        f"'data:image/png;base64,{base64.b64encode(plots.png(figure)).decode()}'><figcaption>{escape(caption)}</figcaption></figure>"
        for name, (caption, figure) in make_figures(scores, outcomes).items()
    )
    worlds = ", ".join(f"{n} {name.replace('_', ' ')}" for name, n in scores["worlds"].items())
    provenance = "".join(
        f"<tr><td>{escape(str(k).replace('_', ' '))}</td><td><code>{escape(_fact(v))}</code></td></tr>"
        for k, v in facts.items()
        if k != "worlds"
    )
    return (
        "<!doctype html><html lang='en'><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width,initial-scale=1'>"
        f"<title>Blind test</title><style>{STYLE}</style><h1>Blind test of the gap diagnosis</h1>"
        f"<p>{escape(worlds)}. Every world counts, whatever its diagnosis; intervals are 95 %: Wilson for "
        "shares, bootstrap for medians.</p>"
        f"<h2>Scores</h2>{_table(score_rows(scores))}"
        f"{_apart(scores['apart'])}{_baselines(baselines)}"
        f"<h2>Pictures</h2><div class='grid'>{pictures}</div>"
        f"<h2>Provenance</h2><div class='scroll'><table>{provenance}</table></div></html>\n"
    )


def _fact(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{k.replace('_', ' ')} {_fact(v)}" for k, v in value.items())
    return (
        "given by hand, sealed" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
    )


def _table(rows: list[ScoreRow]) -> str:
    body, group = "", ""
    for row in rows:
        mark = "" if row.met is None else ("met" if row.met else "missed")
        aim = f"{row.aim} {mark}" if mark else row.aim
        body += (
            f"<tr><td>{escape(row.group) if row.group != group else ''}</td><td>{escape(row.name)}</td>"
            f"<td class='n'>{row.value}</td><td class='n'>{row.interval}</td><td class='n'>{row.cases}</td>"
            f"<td class='n {mark}'>{escape(aim)}</td></tr>"
        )
        group = row.group
    head = "".join(f"<th class='n'>{name}</th>" for name in ("value", "95 %", "cases", "aim"))
    head = f"<tr><th></th><th>score</th>{head}</tr>"
    return f"<div class='scroll'><table>{head}{body}</table></div>"


def _apart(tables: dict[str, Any]) -> str:
    columns = ("detected", "top1_family", "top1_family_severe", "place", "false_alarms")
    rows = [((name, value), shares) for name, table in tables.items() for value, shares in table.items()]
    return f"<h2>Apart</h2>{_share_table(2, columns, rows)}"


def _baselines(rows: Sequence[dict[str, Any]]) -> str:
    if not rows:
        return ""
    columns = ("top1_family", "top1_family_severe", "top1_family_place", "false_alarms", "unknown_named")
    return f"<h2>Baselines, same worlds</h2>{_share_table(1, columns, [((r['name'],), r) for r in rows])}"


def _share_table(
    labels: int, columns: Sequence[str], rows: Sequence[tuple[tuple[str, ...], dict[str, Any]]]
) -> str:
    """Of shares by column, with so many labels in front of each row."""
    head = "<th></th>" * labels + "".join(
        f"<th class='n'>{c.replace('_', ' ').replace('top1', 'top-1')}</th>" for c in columns
    )
    body = "".join(
        "<tr>"
        + "".join(f"<td>{escape(name)}</td>" for name in names)
        + "".join(f"<td class='n'>{share_text(shares[c])}</td>" for c in columns)
        + "</tr>"
        for names, shares in rows
    )
    return f"<div class='scroll'><table><tr>{head}</tr>{body}</table></div>"


def share_text(s: dict[str, Any]) -> str:
    """A share with interval and cases in a few characters."""
    if s["value"] is None:
        return "–"
    return f"{s['value']:.0%} [{s['ci95'][0]:.0%}, {s['ci95'][1]:.0%}] {s['successes']}/{s['trials']}"
