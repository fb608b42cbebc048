"""The page of a run: from whole, interrupted, cut and unreadable runs; no network; what it says is true."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_ros.cell.report.figures import extremes
from samrl_ros.cell.report.page import choose_headline, tell_sources, tell_trouble, write_run_page
from samrl_ros.cell.report.run_record import RunRecord, losses_of, read_run
from samrl_ros.cell.report.view_sphere import view_figure
from tests.ros.bag_files import record
from tests.ros.run.small_run import ERROR_RAD, new, small_run

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros


SUMMARY: dict[str, Any] = {
    "schema": 1,
    "task": "peg_insertion",
    "version": "0.1.0",
    "settings": {"policy": "learned", "strategy": "q"},
    "error": "",
    "successes": 1,
    "success_rate_wilson95": [0.2, 1.0],
    "timing": {"real_time_factor_median": 0.98, "longest_wall_gap_s": None},
    "episodes": [
        {"episode": 0, "seed": 3, "success": True, "reason": "done", "actions": 2, "sim_time_s": 1.85,
         "wall_time_s": None, "final_error_m": 0.0005}
    ],
}  # fmt: skip


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made")
    small_run(folder)
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    return shutil.copytree(made, tmp_path / "run")


def summarised(folder: Path, **changes: Any) -> str:
    (folder / "summary.json").write_text(json.dumps(SUMMARY | changes))
    return write_run_page(folder)[0].read_text()


def test_a_run_is_read_as_it_was(folder: Path) -> None:
    run = read_run(folder / "bag")
    assert [p.name for p in run.phases] == ["episode 0", "update", "view", "look", "act"]
    assert run.phases[2].end == pytest.approx(0.7)
    assert [(f.before, f.after) for f in run.fits] == [(0.5, 0.125)] * 2
    assert [a.residual for a in run.actions] == pytest.approx([0.001, 0.001])
    assert [v.moved for v in run.views] == [True, False]


def test_tracking_is_told_per_joint_whatever_the_order_of_names(folder: Path) -> None:
    tool, camera = read_run(folder / "bag").tracking
    assert np.abs(tool.error).max() == pytest.approx(ERROR_RAD)
    assert tool.joints[int(np.abs(tool.error).max(axis=0).argmax())] == "panda_joint2"
    assert np.abs(camera.error).max() < 1e-9


def test_safety_events_stay_apart_and_repeated_warnings_become_one(folder: Path) -> None:
    events = read_run(folder / "bag").events
    safety = [e for e in events if e.safety]
    assert [(e.level, e.source) for e in safety] == [
        ("error", "command guard"), ("warning", "motion of tool_arm"), ("ok", "command guard")
    ]  # fmt: skip
    (warning,) = [e for e in events if not e.safety]
    assert (warning.count, warning.text) == (3, "an image is 0.5 s old")
    assert warning.last > warning.time


def test_the_page_fetches_nothing_and_escapes_what_the_bag_says(folder: Path) -> None:
    page = summarised(folder)
    assert "1 of 1 episode succeeded" in page
    assert "estop &lt;by hand&gt;" in page and "<by hand>" not in page
    assert not re.search(r"""(?:src|href)=["'](?!data:)""", page)
    for anchor in ("timeline-figure", "loss-figure", "action-figure", "view-figure", "tracking-2"):
        (text,) = re.findall(rf'id="{anchor}">(.*?)</script>', page, re.DOTALL)
        assert json.loads(text)["data"]
    assert page.count("data:image/jpeg;base64,") == 6


@pytest.mark.parametrize(
    ("said", "says"),
    [([None], "1 episode, not judged"), ([True, None], "1 of 1 episode succeeded, 1 not judged")],
)
def test_an_episode_that_nobody_judged_did_not_fail(folder: Path, said: list[bool | None], says: str) -> None:
    episodes = [SUMMARY["episodes"][0] | {"episode": k, "success": one} for k, one in enumerate(said)]
    page = summarised(folder, episodes=episodes, successes=sum(map(bool, said)), judged_by="operator")
    assert says in page and "0 of" not in page.partition("</h1>")[0]
    assert ("success by the operator" in page) is any(said)


def test_the_video_plays_and_shows_camera_and_model(folder: Path) -> None:
    _, video = write_run_page(folder)
    assert video.stat().st_size < 1_000_000
    capture, frames = cv2.VideoCapture(str(video)), []
    while (read := capture.read())[0]:
        frames.append(read[1])
    assert len(frames) == 19  # camera images from the episode's begin on
    height, width = frames[-1].shape[:2]
    middle = [frames[-1][height // 2 + 16, width * k // 6].mean() for k in (1, 3, 5)]
    assert middle == pytest.approx([100, 60, 80], abs=12)  # camera, model, twice their difference
    for panel in (slice(width // 3, 2 * width // 3), slice(2 * width // 3, None)):
        assert frames[0][40:, panel].max() > 80, "nothing says that there is no model yet"


@pytest.mark.parametrize(
    ("error", "words"), [("interrupted", "Interrupted: "), ("sim_bridge ended with -9", "The cell stopped: ")]
)
def test_a_run_that_ended_early_says_why(tmp_path: Path, error: str, words: str) -> None:
    page = summarised(tmp_path, error=error)
    assert words in page and error in page


def test_a_run_that_only_records_has_no_episodes_and_was_not_cut_off() -> None:
    """It was "Interrupted: 0 of 0 episodes succeeded"; an interrupt is how it ends."""
    run = RunRecord(duration=12.34)
    summary = {"settings": {"observe": True, "hardware": ["a"]}, "episodes": [], "error": "interrupted"}
    assert choose_headline(run, summary)[1] == "Recorded what the drivers said, 12.3 s"
    assert tell_trouble(summary) == ""
    broken = summary | {"error": "recorder ended with -9"}
    assert choose_headline(run, broken)[1].startswith("The cell stopped") and tell_trouble(broken)
    acted = summary | {"settings": {}}
    assert choose_headline(run, acted)[1].startswith("Interrupted") and tell_trouble(acted)


@pytest.mark.parametrize(
    ("hardware", "by", "says"),
    [
        (None, "truth", "Success, seed and distance are ground truth;"),
        (["a"], "operator", "Success is the operator's word;"),
        (["a"], None, "nobody judged an episode"),
    ],
)
def test_the_page_says_whose_word_success_is(hardware: list[str] | None, by: str | None, says: str) -> None:
    """Of hardware nobody has ground truth."""
    assert says in tell_sources({"settings": {"hardware": hardware}, "judged_by": by})


def test_without_a_summary_the_bag_alone_makes_a_page(tmp_path: Path) -> None:
    small_run(tmp_path, outcome="")
    page = write_run_page(tmp_path)[0].read_text()
    assert "Unfinished run: 0 episodes ended" in page
    assert "no summary.json" in page and "not ended" in page and "tracking-1" in page


def test_a_run_interrupted_before_its_first_phase_has_a_page(tmp_path: Path) -> None:
    clock = "/clock"
    record(tmp_path / "bag", [(k * 10**9, clock, new(clock)) for k in (1, 2)])
    assert not read_run(tmp_path / "bag").phases
    assert "Interrupted: 0 of 0" in summarised(tmp_path, error="interrupted", episodes=[], successes=0)


def test_a_bag_cut_by_a_kill_is_shown_up_to_the_cut(folder: Path) -> None:
    file = next((folder / "bag").glob("*.mcap"))
    file.write_bytes(file.read_bytes()[: file.stat().st_size * 2 // 3])
    page = write_run_page(folder)[0].read_text()
    assert "What is missing" in page and "bag_0.mcap" in page


@pytest.mark.parametrize("content", [None, b"", b"no bag at all"])
def test_a_run_that_never_recorded_still_has_its_page(tmp_path: Path, content: bytes | None) -> None:
    if content is not None:
        (tmp_path / "bag").mkdir()
        (tmp_path / "bag" / "bag_0.mcap").write_bytes(content)
    page = summarised(tmp_path, error="no nodes", episodes=[], successes=0)
    assert "no nodes" in page and "What is missing" in page


@pytest.mark.parametrize("text", ["{", "[]", '{"episodes": 3}', "[" * 100_000])
def test_a_broken_summary_is_refused_and_nothing_is_written(folder: Path, text: str) -> None:
    (folder / "summary.json").write_text(text)
    with pytest.raises(InputError, match=r"summary\.json.*remove it"):
        write_run_page(folder)
    assert not (folder / "run.html").exists()


def test_a_folder_of_something_else_is_refused_by_the_command(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from samrl_ros.cli.main import run

    assert run(["run-report", str(tmp_path)]) == 3
    assert "give its --out folder" in capsys.readouterr().err
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    assert run(["run-report", str(tmp_path)]) == 0
    assert (tmp_path / "run.html").exists()


def test_long_curves_keep_their_extremes() -> None:
    signal = np.zeros(100_000)
    signal[77_777], signal[5] = 3.0, -2.0
    keep = extremes(signal, 500)
    assert len(keep) <= 502 and signal[keep].max() == 3.0 and signal[keep].min() == -2.0


def test_views_lie_on_the_sphere_as_the_camera_did(folder: Path) -> None:
    from samrl_core.cell.tasks import task_named

    region = task_named("peg_insertion").view_region()
    figure = view_figure(read_run(folder / "bag").views, region)
    traces: list[Any] = list(figure.data)
    marks = [trace for trace in traces if trace.mode == "markers+text"]
    assert {trace.name for trace in marks} == {"taken", "not worth its time"}
    assert all(np.hypot(trace.x, trace.y).max() < 1.3 for trace in marks)


def test_stops_and_restarts_of_the_summary_are_told(tmp_path: Path) -> None:
    stop = {"wall_s": 12.34, "episode": 0, "what": "estop", "text": "by <hand>"}
    away = {"wall_s": 1.0, "episode": -1, "what": "restart", "text": "policy was started again"}
    page = summarised(tmp_path, incidents=[away, stop])
    (section,) = re.findall(r'<section id="incidents">(.*?)</section>', page, re.DOTALL)
    cells = re.findall(r"<td[^>]*>(?:<span>)?(.*?)(?:</span>)?</td>", section)
    assert cells == [
        "1.0",
        "-",
        "restart",
        "policy was started again",
        "12.3",
        "0",
        "estop",
        "by &lt;hand&gt;",
    ]
    assert 'id="incidents"' not in summarised(tmp_path)


def test_views_in_one_place_share_a_label(folder: Path) -> None:
    from dataclasses import replace

    from samrl_ros.cell.report.view_sphere import labels_of

    one = read_run(folder / "bag").views[0]
    views = [replace(one, step=k) for k in (0, 3, 6, 9, 12)]
    places = np.array([[0.0, 0.0], [0.01, 0.0], [0.5, 0.0], [0.0, 0.02], [0.0, 0.0]])
    assert labels_of(views, places) == ["0 ... 12", "", "6", "", ""]
    assert labels_of(views[:2], places[:2]) == ["0, 3", ""]


def test_scored_views_are_dots_on_the_sphere(three_actions: Any, tmp_path: Path) -> None:
    from samrl_core.cell.tasks import task_named
    from tests.ros.bag_files import record

    run = read_run(record(tmp_path / "bag", three_actions.messages))
    (scored,) = run.scored
    assert len(scored) > 1
    region = task_named("peg_insertion").view_region()
    traces: Any = view_figure(run.views, region, run.scored).data
    (dots,) = [trace for trace in traces if trace.name == "scored"]
    assert len(dots.x) == len(scored)
    assert max(np.hypot(dots.x, dots.y)) < 1.3


@pytest.mark.parametrize(
    ("before", "after", "why", "words"),
    [
        (0.31, 0.125, "converged", "loss 0.31 \u2192 0.125"),
        (np.nan, np.nan, "no_target", "target not seen"),
        (np.nan, np.nan, "disabled", "nothing compared"),
    ],
)
def test_an_update_without_an_image_of_its_target_has_no_loss(
    before: float, after: float, why: str, words: str
) -> None:
    state = new("/cell/model_updater/state", loss_before=before, loss_after=after, why_stopped=why)
    assert losses_of(state) == words
