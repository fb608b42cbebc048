"""A soak's turns, what is read of their bags and processes, and its report."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_ros.cell.soak import soak
from samrl_ros.cell.soak.bag_figures import LATENCIES, figures_of, percentiles
from samrl_ros.cell.soak.options import SAMPLES, TURN, SoakOptions, read_turn, whole_turns
from samrl_ros.cell.soak.process_watch import ProcessWatch, read_samples
from samrl_ros.cell.soak.report import report_soak
from samrl_ros.contract.topics import arm_topic, cell_topic
from tests.ros.bag_files import record
from tests.ros.run.small_run import new, stamped

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros
MS = 1_000_000

# Stands in for `samrl cell`: a summary, a bag, and some seconds, unless it is told to hang.
CELL = """
import json, pathlib, shutil, signal, sys, time
out, bag, hangs = pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3] == "hangs"
out.mkdir()
summary = {"episodes": [{}, {}], "successes": 1, "error": "", "timing": {"real_time_factor_median": 0.5}}
try:
    print("begun", flush=True)
    time.sleep(600 if hangs else 1)
except KeyboardInterrupt:
    summary = {**summary, "episodes": [{}], "error": "interrupted"}
shutil.copytree(bag, out / "bag")
(out / "summary.json").write_text(json.dumps(summary))
sys.exit(130 if summary["error"] else 0)
"""


def said(topic: str, ms: int, **values: Any) -> tuple[int, str, Any]:
    """A message with a stamp, recorded 1 ms after it."""
    return (ms + 1) * MS, topic, stamped(new(topic, **values), ms * MS)


def diagnostics(node: str, ms: int, **values: str) -> tuple[int, str, Any]:
    """A node's report."""
    from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

    given = {"state": "active", **{key.replace("__", " "): value for key, value in values.items()}}
    pairs = [KeyValue(key=key.replace("JOINTS", JOINTS), value=value) for key, value in given.items()]
    return said("/diagnostics", ms, status=[DiagnosticStatus(name=f"/cell/{node}", values=pairs)])


JOINTS = arm_topic("tool_arm", "joint_states")
STATE, ACTION = cell_topic("model_updater/state"), cell_topic("policy/nominal_action")
REQUEST, OUTCOME = cell_topic("supervisor/request"), cell_topic("supervisor/outcome")


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """4 s: a joint state every 4 ms but for a gap of 12 ms, a state 300 ms after its image, said twice."""
    messages = [said(JOINTS, ms) for ms in range(4, 4000, 4) if ms not in (2000, 2004)]
    messages += [
        diagnostics("policy", 500, JOINTS__received="100"),
        diagnostics("sim_bridge", 600, longest_gap_s="0.05"),
        (1300 * MS, STATE, stamped(new(STATE), 1000 * MS)),
        (1400 * MS, STATE, stamped(new(STATE), 1000 * MS)),
        said(REQUEST, 1500, stage="act"),
        (1521 * MS, ACTION, stamped(new(ACTION), 1000 * MS)),
        diagnostics("policy", 3500, JOINTS__received="660"),
        said(OUTCOME, 3900, reason="done"),
    ]
    messages.sort(key=lambda entry: entry[0])
    return record(tmp_path_factory.mktemp("soak") / "bag", messages)


def test_latencies_and_losses_of_a_bag(bag: Path) -> None:
    found = figures_of(bag)
    assert set(found.latencies) == set(LATENCIES)
    assert [v for _, v in found.latencies["image_to_state_s"]] == [pytest.approx(0.3)]
    assert [v for _, v in found.latencies["request_to_action_s"]] == [pytest.approx(0.02)]
    assert [v for _, v in found.latencies["wall_gap_s"]] == [0.05]
    gaps = percentiles([v for _, v in found.latencies["joint_state_gap_s"]])
    assert gaps["p50"] == pytest.approx(0.004) and gaps["max"] == pytest.approx(0.012) and gaps["n"] == 996
    # Between the reports of 0.501 and 3.501 s the recorder had 748 joint states, the policy 560.
    assert found.losses == {"policy": {JOINTS: pytest.approx(188 / 748)}}
    assert [reason for _, reason in found.outcomes] == ["done"]


def test_a_process_and_its_children_are_watched(tmp_path: Path) -> None:
    inner = "import sys; kept = bytearray(50_000_000); print(flush=True); sys.stdin.read()"
    code = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {inner!r}])"
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdin and process.stdout
    process.stdout.readline()
    watch = ProcessWatch(process.pid, tmp_path / SAMPLES)
    watch.sample()
    process.stdin.close()
    process.wait()
    process.stdout.close()
    watch.sample()
    rows = {row["process"]: row for row in read_samples(tmp_path / SAMPLES)}
    assert list(rows) == ["cell", "other", ""]
    assert rows["other"]["anonymous_MB"] > 45.0 > rows["cell"]["anonymous_MB"] > 1.0
    assert rows["cell"]["threads"] >= 1 and rows["cell"]["handles"] >= 3 and rows[""]["shared_MB"] == 0.0
    assert watch.left_behind() == []


@pytest.fixture
def cells(bag: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Every turn runs the stand-in; the list says of what tasks, and "hangs" at its end makes one hang."""
    run: list[str] = []

    def command(options: SoakOptions, task: str, seed: int, out: Path) -> list[str]:
        hangs = "hangs" if run[-1:] == ["hangs"] else ""
        run.append(f"{task} {seed}")
        return [sys.executable, "-c", CELL, str(out), str(bag), hangs]

    monkeypatch.setattr(soak, "cell_command", command)
    return run


def test_tasks_take_turns_until_the_time_is_over(tmp_path: Path, cells: list[str]) -> None:
    told: list[str] = []
    options = SoakOptions(out=tmp_path, hours=0.0001, tasks=("peg_insertion", "needle_threading"), episodes=2)
    turns = soak.run_soak(options, threading.Event(), told.append)
    assert cells == ["peg_insertion 0"] and len(turns) == 1
    longer = SoakOptions(**{**options.__dict__, "hours": (read_turn(turns[0])["wall_s"] + 0.1) / 3600})
    turns = soak.run_soak(longer, threading.Event(), told.append)
    assert cells == ["peg_insertion 0", "needle_threading 2"] and turns == whole_turns(tmp_path)
    turn = read_turn(turns[0])
    assert (turn["episodes"], turn["successes"], turn["exit_code"]) == (2, 1, 0)
    assert turn["latencies"]["image_to_state_s"] == {"start": [[0.3, 1]], "end": []}
    assert turn["outcomes"] == ["done"] and not turn["error"]
    assert not (turns[0] / "run" / "bag").exists()
    assert soak.run_soak(longer, threading.Event(), told.append) == turns and len(cells) == 2
    with pytest.raises(InputError, match="holds another soak: episodes"):
        soak.run_soak(SoakOptions(**{**longer.__dict__, "episodes": 5}), threading.Event(), told.append)


def test_an_interrupted_turn_counts_as_far_as_it_came(tmp_path: Path, cells: list[str]) -> None:
    stop = threading.Event()

    def say(text: str) -> None:
        if text.startswith("turn 0"):
            threading.Thread(target=interrupt, daemon=True).start()

    def interrupt() -> None:
        log = tmp_path / "turn-000-peg_insertion" / "console.log"
        while not (log.exists() and b"begun" in log.read_bytes()):
            threading.Event().wait(0.01)
        stop.set()

    cells.append("hangs")
    turns = soak.run_soak(SoakOptions(out=tmp_path, tasks=("peg_insertion",)), stop, say)
    turn = read_turn(turns[0])
    assert turn["exit_code"] == 130 and turn["episodes"] == 1 and not turn["error"]


def test_a_turn_that_was_interrupted_at_once_is_run_again(tmp_path: Path, cells: list[str]) -> None:
    stop = threading.Event()
    stop.set()
    options = SoakOptions(out=tmp_path, tasks=("peg_insertion",))
    assert soak.run_soak(options, stop, lambda text: None) == [] and not cells
    stop.clear()
    cells.append("hangs")
    assert soak.run_soak(options, stop, lambda text: stop.set()) == []
    assert len(cells) == 2 and not list(tmp_path.glob("turn-*"))


def test_a_turn_whose_cell_fails_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(soak, "cell_command", lambda *_: [sys.executable, "-c", "raise SystemExit(3)"])
    told: list[str] = []
    options = SoakOptions(out=tmp_path, hours=1e-6, tasks=("peg_insertion",))
    [turn] = soak.run_soak(options, threading.Event(), told.append)
    assert read_turn(turn)["error"].startswith("no figures: ") and any("no figures" in text for text in told)


def test_the_report_tells_growth_from_noise(tmp_path: Path) -> None:
    """Two turns of 30 minutes: the cell grows by 60 MB an hour, a node does not."""
    rng = np.random.default_rng(0)
    for number, task in enumerate(("peg_insertion", "needle_threading")):
        folder = tmp_path / f"turn-{number:03d}-{task}"
        folder.mkdir()
        rows: list[dict[str, Any]] = []
        for wall_s in range(0, 1800, 20):
            common = {"wall_s": wall_s, "resident_MB": 500.0, "threads": 9, "handles": 30 + wall_s // 900}
            grown = 300.0 + 40.0 * number + wall_s / 60.0
            summing_up = 400.0 if wall_s > 1700 else 0.0
            rows += [
                {**common, "process": "cell", "anonymous_MB": grown + summing_up + rng.normal()},
                {"wall_s": wall_s, "process": "", "shared_MB": 70.0},
            ]
            if not summing_up:
                rows.append({**common, "process": "policy", "anonymous_MB": 200.0 + rng.normal()})
        (folder / SAMPLES).write_text("".join(json.dumps(row) + "\n" for row in rows) + '{"cut')
        latencies = {"request_to_action_s": {"start": [[0.01, 3]], "end": [[0.02, 1], [0.04, 1]]}}
        turn = {"task": task, "wall_s": 1800.0, "episodes": 20, "successes": 19, "error": "", "losses": {}}
        turn |= {"latencies": latencies, "left_in_shared_memory": ["fastrtps_1"], "exit_code": 0}
        (folder / TURN).write_text(json.dumps(turn))
    found = report_soak(whole_turns(tmp_path), tmp_path)
    cell, policy = (found["growth_per_hour"][name]["anonymous_MB"] for name in ("cell", "policy"))
    assert not cell["includes_zero"] and cell["per_hour"] == pytest.approx(60.0, abs=5.0)
    assert cell["interval95"][0] < 60.0 < cell["interval95"][1]
    assert cell["per_episode"] == pytest.approx(1.5, abs=0.2)
    assert policy["includes_zero"] and policy["median"] == pytest.approx(200.0, abs=1.0)
    assert found["shared_memory_MB"]["files_left_behind"] == 2 and found["hours"] == 1.0
    action = found["latencies"]["request_to_action_s"]
    assert action["start"] == {"n": 6, "p50": 0.01, "p95": 0.01, "p99": 0.01, "max": 0.01}
    assert action["end"]["n"] == 4 and action["end"]["max"] == 0.04
    assert found == {**json.loads((tmp_path / "soak.json").read_text()), "turns": found["turns"]}
    assert (tmp_path / "soak.png").stat().st_size > 10_000
