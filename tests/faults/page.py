"""The table of results: as a picture, coloured, and as Markdown with what was measured."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

MOMENTS = ("before", "motion", "contact", "stopping")
PASSED, FAILED, ABSENT = "#2f9e6e", "#d1495b", "#e9ecef"


def read_results(folder: Path) -> list[dict[str, Any]]:
    """All results, sorted by fault."""
    return [json.loads(path.read_text()) for path in sorted(folder.glob("*.json"))]


def draw(folder: Path, picture: Path) -> None:
    """Faults down, moments across: green for a kept promise, red for a broken one."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.patches import Rectangle

    results = read_results(folder)
    faults = list(dict.fromkeys(r["fault"] for r in results))
    figure, axes = pyplot.subplots(figsize=(7.0, 0.9 + 0.22 * len(faults)))
    verdict = {(r["fault"], r["moment"]): r["passed"] for r in results}
    for row, fault in enumerate(faults):
        for column, moment in enumerate(MOMENTS):
            passed = verdict.get((fault, moment))
            color = ABSENT if passed is None else PASSED if passed else FAILED
            axes.add_patch(Rectangle((column, row), 0.94, 0.86, color=color))
            if passed is not None:
                text = "kept" if passed else "BROKEN"
                axes.text(
                    column + 0.47, row + 0.43, text, ha="center", va="center", color="white", fontsize=6
                )
    axes.set_xlim(0, len(MOMENTS))
    axes.set_ylim(len(faults), 0)
    axes.set_xticks(
        [c + 0.47 for c in range(len(MOMENTS))],
        ["before the first\naction", "in motion", "in contact", "while stopping"],
    )
    axes.set_yticks([r + 0.43 for r in range(len(faults))], [f.replace("_", " ") for f in faults], fontsize=7)
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    figure.tight_layout()
    figure.savefig(picture, dpi=130)
    pyplot.close(figure)


def _overview(results: list[dict[str, Any]]) -> list[str]:
    """A line per fault, and how near to the limits the arms came over all of them."""
    lines = ["| fault | promise | before | motion | contact | stopping |", "|---|---|---|---|---|---|"]
    verdict = {(r["fault"], r["moment"]): "kept" if r["passed"] else "**broken**" for r in results}
    for fault, promise in {r["fault"]: r["promise"] for r in results}.items():
        row = " | ".join(verdict.get((fault, moment), "") for moment in MOMENTS)
        lines.append(f"| {fault.replace('_', ' ')} | {promise} | {row} |")
    highest: dict[str, float] = {}
    for result in results:
        for what, share in result.get("shares", {}).items():
            highest[what] = max(share, highest.get(what, 0.0))
    periods = sum(result.get("periods", 0) for result in results)
    lines += ["", f"{periods} controller periods of 1 ms; highest share of a limit over all of them:", ""]
    lines += ["| limit | highest share |", "|---|---|"]
    return lines + [f"| {what} | {share:.3f} |" for what, share in highest.items()]


def write_page(folder: Path, page: Path) -> str:
    """Overview, and a line per cell with what was measured; returns the count in words."""
    results = read_results(folder)
    kept = sum(r["passed"] for r in results)
    word = {True: "yes", False: "NO"}
    lines = ["| fault | moment | promise | measured | kept |", "|---|---|---|---|---|"]
    for r in results:
        shown = [c for c in r["checks"] if not c["ok"]] or r["checks"]
        measured = (
            "; ".join(f"{c['what']}: {c['measured']}" for c in shown).replace("|", "/").replace("\n", " ")
        )
        lines.append(f"| {r['fault']} | {r['moment']} | {r['promise']} | {measured} | {word[r['passed']]} |")
    page.write_text("\n".join([*_overview(results), "", *lines]) + "\n")
    said = f"{kept} of {len(results)} promises kept; table: {page}"
    broken = [f"{r['fault']} @ {r['moment']}" for r in results if not r["passed"]]
    return "\n".join([said, *(f"  broken: {name}" for name in broken)])
