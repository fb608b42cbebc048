"""run.html: one file that shows a run without network, server or ROS; made from bag and summary.json."""

from __future__ import annotations

import base64
import json
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment

from samrl_core.cell.tasks import task_named
from samrl_core.common.errors import InputError
from samrl_core.common.files import read_whole, write_whole
from samrl_core.common.templates import read_templates, sources_of
from samrl_core.diagnosis.report.figures import figure_json
from samrl_core.diagnosis.report.html_report import TEMPLATES as SHARED
from samrl_core.diagnosis.report.html_report import packed_plotly
from samrl_ros.cell.report import figures
from samrl_ros.cell.report.pictures import Card, Cards, Video
from samrl_ros.cell.report.run_record import RunRecord, empty_run, read_run, task_of
from samrl_ros.cell.report.view_sphere import view_figure

TEMPLATES = Path(__file__).parent / "templates"
PAGE, VIDEO, SUMMARY = "run.html", "run.webm", "summary.json"
SUMMARY_BYTES = 200_000_000  # at most; 10,000 episodes have about 150 MB
EPISODES = 6  # shown with pictures; failures first
EMBEDDED_VIDEO = 6_000_000  # bytes; a longer video only lies beside the page


def write_run_page(folder: Path) -> list[Path]:
    """Write `run.html` and `run.webm` into a run's folder; of an unfinished run, with what there is.

    Returns:
        The files written, the page first.

    Raises:
        InputError: the folder holds neither a bag nor a summary, or `summary.json` is no summary.
        OSError: the folder cannot be written.
    """
    bag, summary_file = folder / "bag", folder / SUMMARY
    if not bag.exists() and not summary_file.exists():
        raise InputError(
            f"{folder} holds neither bag/ nor {SUMMARY}: no run of `samrl cell`; give its --out folder"
        )
    summary = _read_summary(summary_file)
    notes: list[str] = [] if summary else [f"there is no {SUMMARY}: the run did not come to its end"]
    cards: dict[int, list[Card]] = {}
    video, speed = b"", 1.0
    try:
        watched = Cards({e["episode"] for e in summary.get("episodes", []) if e.get("success")}, EPISODES)
        with Video(bag) as filmed:
            run = read_run(bag, (watched, filmed))
            video, speed = filmed.made()
        cards = watched.shown()
    except InputError as error:
        run = empty_run(error)
    page = _render(folder, run, summary, cards, video, speed, notes)
    written = [folder / PAGE]
    if video:
        write_whole(folder / VIDEO, video)
        written.append(folder / VIDEO)
    write_whole(folder / PAGE, page)
    return written


def _read_summary(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {}
    try:
        summary = json.loads(read_whole(path, SUMMARY_BYTES))
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"{path} is no JSON ({error}); remove it, and the page is made from the bag"
        ) from error
    if not isinstance(summary, dict) or not isinstance(summary.get("episodes"), list):
        raise InputError(
            f"{path} has no list `episodes`: no summary of a run;"
            " remove it, and the page is made from the bag"
        )
    return summary


def _render(
    folder: Path,
    run: RunRecord,
    summary: dict[str, Any],
    cards: dict[int, list[Card]],
    video: bytes,
    speed: float,
    notes: list[str],
) -> str:
    task = task_of(run, summary)
    region = None
    if task:
        try:
            region = task_named(task).view_region()
        except InputError as error:
            notes = [*notes, str(error)]
    state, headline = choose_headline(run, summary)
    return (
        _environment()
        .get_template("run.html.j2")
        .render(
            folder=folder.resolve().name,
            task=task or "unknown task",
            state=state,
            headline=headline,
            run=run,
            error=tell_trouble(summary),
            version=summary.get("version", ""),
            chosen=summary.get("settings", {}),
            acting=() if _observes(summary) else ("policy", "strategy"),
            sources=tell_sources(summary),
            rows=_episode_rows(run, summary),
            incidents=_incident_rows(summary),
            cards=cards,
            fitted=len({f.episode for f in run.fits}),
            notes=notes,
            figure=figure_json,
            figures=figures,
            view_figure=view_figure,
            region=region,
            video=base64.b64encode(video).decode() if 0 < len(video) <= EMBEDDED_VIDEO else "",
            has_video=bool(video),
            speed=speed,
            key_figures=_key_figures(run, summary),
            settings=json.dumps(summary.get("settings", {}), indent=1, ensure_ascii=False),
            library=packed_plotly(),
        )
    )


@cache
def _environment() -> Environment:
    return read_templates(
        [TEMPLATES, SHARED],
        source=sources_of(SHARED),
        own_source=sources_of(TEMPLATES),
        encoded=lambda data: base64.b64encode(data).decode(),
        clip=lambda fraction: min(max(fraction, 0.0), 1.0),
    )


def choose_headline(run: RunRecord, summary: dict[str, Any]) -> tuple[str, str]:
    """Name of the page's colours, and its first line."""
    episodes, error = summary.get("episodes", []), summary.get("error", "")
    good, judged = _successes(summary)
    count = f"{good} of {_episodes(judged)} succeeded"
    if judged < len(episodes):
        unknown = len(episodes) - judged
        count = f"{count}, {unknown} not judged" if judged else f"{_episodes(unknown)}, not judged"
    if _observes(summary) and not tell_trouble(summary):
        return "not_testable", f"Recorded what the drivers said, {run.duration:.1f} s"
    if error.startswith("interrupted"):
        return "ambiguous", f"Interrupted: {count}"
    if error:
        return "failed", f"The cell stopped: {count}"
    if not summary:
        return "not_testable", f"Unfinished run: {_episodes(len(run.outcomes))} ended"
    if episodes and not judged:
        return "not_testable", count
    return ("no_gap" if good == len(episodes) and episodes else "ambiguous"), count


def _observes(summary: dict[str, Any]) -> bool:
    """Whether the run only recorded (`--observe`): it has no episodes, and who acts was not asked."""
    return bool(summary.get("settings", {}).get("observe"))


def tell_trouble(summary: dict[str, Any]) -> str:
    """What a run ended with that it should not; one that only records ends by an interrupt."""
    error = summary.get("error", "")
    return "" if _observes(summary) and error.startswith("interrupted") else error


def tell_sources(summary: dict[str, Any]) -> str:
    """Who says what of the page's numbers."""
    if not summary.get("settings", {}).get("hardware"):
        return "Success, seed and distance are ground truth; all else is what the cell recorded."
    if summary.get("judged_by") == "operator":
        return "Success is the operator's word; all else is what the cell recorded."
    return "All of it is what the cell recorded; nobody judged an episode."


def _episodes(count: int) -> str:
    return f"{count} episode{'s' if count != 1 else ''}"


def _successes(summary: dict[str, Any]) -> tuple[int, int]:
    """Of the episodes that somebody judged: how many succeeded, and how many there are."""
    judged = [e["success"] for e in summary.get("episodes", []) if e.get("success") is not None]
    return sum(map(bool, judged)), len(judged)


def _key_figures(run: RunRecord, summary: dict[str, Any]) -> list[tuple[str, str, str, str]]:
    """Title, number, unit, note."""
    found: list[tuple[str, str, str, str]] = []
    interval = summary.get("success_rate_wilson95")
    good, judged = _successes(summary)
    if judged and interval:
        note = f"95 % interval {100 * interval[0]:.0f}-{100 * interval[1]:.0f} %"
        judge = "the operator" if summary.get("judged_by") == "operator" else "ground truth"
        found.append((f"success by {judge}", f"{good} of {judged}", "", note))
    if run.duration:
        found.append(("recorded", f"{run.duration:.1f}", "s", f"of robot time, {run.messages} messages"))
    if run.actions:
        found.append(("actions", str(len(run.actions)), "", f"{len(run.fits)} model updates"))
    if run.views:
        moved = sum(v.moved for v in run.views)
        found.append(("views taken", f"{moved} of {len(run.views)}", "", "that were considered"))
    factor = (summary.get("timing") or {}).get("real_time_factor_median")
    if factor is not None:
        gap = summary["timing"].get("longest_wall_gap_s")
        note = f"longest gap {1e3 * gap:.0f} ms" if gap is not None else ""
        found.append(("real-time factor", f"{factor:.2f}", "", note))
    for tracking in run.tracking:
        worst = float(abs(tracking.error).max())
        found.append((f"largest joint error, {tracking.role}", f"{1e3 * worst:.2f}", "mrad", ""))
    if run.messages:
        alarms = sum(e.safety and e.level != "ok" for e in run.events)
        warnings = sum(e.count for e in run.events if not e.safety)
        note = f"and {warnings} warnings of nodes" if warnings else "and no warning of a node"
        found.append(("safety events", str(alarms), "", note))
    return found


def _episode_rows(run: RunRecord, summary: dict[str, Any]) -> list[tuple[str, ...]]:
    """One row per episode: number, seed, result, its reason, actions, robot time, wall time, end."""
    rows = []
    told = {e["episode"]: e for e in summary.get("episodes", [])}
    for number in sorted({*told, *run.episodes, *run.outcomes}):
        e = told.get(number)
        if e is None:
            reason = run.outcomes.get(number, "not ended")
            rows.append((str(number), "-", "unfinished", reason, "-", "-", "-", "-"))
            continue
        result = {True: "success", False: "failure", None: "not judged"}[e.get("success")]
        rows.append(
            (
                str(number),
                "-" if e.get("seed") is None else str(e["seed"]),
                result,
                e.get("reason", ""),
                str(e.get("actions", "-")),
                _number(e.get("sim_time_s"), 1.0, 1),
                _number(e.get("wall_time_s"), 1.0, 1),
                _number(e.get("final_error_m"), 1e3, 2),
            )
        )
    return rows


def _incident_rows(summary: dict[str, Any]) -> list[tuple[str, ...]]:
    """One row per incident: wall time, episode, what, in words. Emergency stops, restarts of nodes, drops."""
    rows = []
    for one in summary.get("incidents", []):
        episode = one.get("episode", -1)
        number = "-" if episode < 0 else str(episode)
        rows.append((_number(one.get("wall_s"), 1.0, 1), number, one.get("what", ""), one.get("text", "")))
    return rows


def _number(value: float | None, scale: float, digits: int) -> str:
    return "-" if value is None else f"{scale * value:.{digits}f}"
