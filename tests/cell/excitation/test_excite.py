"""Playing trajectories on the cell: measured motion follows, bags are complete or absent."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.excitation import Run, TrajectoryFile, file_runs, set_run
from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.pose import Pose
from samrl_ros.cell.excite_cell import ARM_DISTANCE, CellPlayer
from samrl_ros.cli.main import run as samrl
from samrl_ros.contract.exit_codes import INPUT_REFUSED, INTERRUPTED, OK
from tests.waiting import PATIENCE_S, wait_for


def player(role: str, world: str = "pybullet") -> CellPlayer:
    return CellPlayer(role, task_named("peg_insertion"), cell_named(), world, 0)


def play(arm, run: Run, world: str = "pybullet"):
    return player(arm.role, world).record(run, lambda what, done, total: None)


def test_measured_motion_follows_the_command_and_effort_the_law(tool_arm):
    run = set_run("C", tool_arm.spec, tool_arm.payload, 0, 3.0)
    recording = play(tool_arm, run)
    assert len(recording.states) == len(recording.command) == len(recording.commanded_effort) == 3001
    assert np.array_equal(recording.command.position, run.command.position)
    assert np.ptp(run.command.position, axis=0).max() > 0.1
    assert np.abs(recording.states.position - recording.command.position).max() < 0.08
    law = recording.arm.controller
    assert np.allclose(law.stiffness, 0.6 * tool_arm.spec.controller.stiffness)
    model = ArmModel(tool_arm.spec, Pose.identity(), tool_arm.payload)
    for k in range(0, 3001, 250):
        q, dq = recording.states.position[k], recording.states.velocity[k]
        effort = law.stiffness * (recording.command.position[k] - q)
        effort += law.damping * (recording.command.velocity[k] - dq) + model.gravity(q)
        assert np.allclose(recording.commanded_effort.effort[k], effort, atol=1e-9)
    # No drive between: the sensor shows what was sent in that period, but for its noise.
    assert np.abs(recording.states.effort - recording.commanded_effort.effort).std() < 0.06


def test_camera_arm_is_recorded_with_its_own_load(camera_arm):
    run = set_run("A", camera_arm.spec, camera_arm.payload, 0, 2.0)
    recording = play(camera_arm, run, world="mock")
    assert recording.arm.role == "camera_arm" and recording.arm.tool.mass == camera_arm.payload.mass
    assert np.allclose(recording.states.position[1:], recording.command.position[:-1])  # the mock's delay


@pytest.mark.slow
def test_a_known_load_is_mounted_and_described(tool_arm):
    file = TrajectoryFile(
        "tool_arm", "two_loads", parameters={"duration_s": 2.0, "poses": 2, "speeds": (0.05,)}
    )
    bare, loaded = (play(tool_arm, run) for run in file_runs("n", file, tool_arm.spec, tool_arm.payload))
    assert loaded.arm.tool.mass == pytest.approx(bare.arm.tool.mass + 0.5)
    more = (loaded.states.effort - bare.states.effort)[:200].mean(axis=0)
    heavy, light = (
        ArmModel(tool_arm.spec, Pose.identity(), r.arm.tool).gravity(bare.command.position[0])
        for r in (loaded, bare)
    )
    assert np.allclose(more, heavy - light, atol=0.05) and np.abs(more).max() > 0.5


@pytest.mark.parametrize("letter", "AC")
def test_the_other_arm_waits_out_of_the_way(arm, letter):
    """Distances of the arms' middle lines over the whole recording, from readings."""
    seen = []

    class Watching(CellPlayer):
        def _approach(self, stage, run):
            super()._approach(stage, run)
            waiting = self._lines[self._other].points(stage.position(self._other))[0]
            for q in run.command.position[::40]:
                mine = self._lines[self._role].points(q)[0]
                seen.append(np.linalg.norm(mine[:, None] - waiting[None], axis=2).min())

    watching = Watching(arm.role, task_named("peg_insertion"), cell_named(), "mock", 0)
    watching.record(set_run(letter, arm.spec, arm.payload, 1, 1.5), lambda *_: None)
    assert min(seen) > ARM_DISTANCE - 0.03


def test_command_line_writes_bags_and_refuses_to_replace_them(tmp_path, capsys):
    command = ["excite", "--duration", "1", "--world", "mock", "--out", str(tmp_path)]
    assert samrl([*command, "--set", "B"]) == OK
    assert [p.name for p in tmp_path.iterdir()] == ["B.mcap"]
    assert samrl([*command, "--set", "all"]) == INPUT_REFUSED  # before anything is recorded
    assert [p.name for p in tmp_path.iterdir()] == ["B.mcap"]
    assert "B.mcap exists" in capsys.readouterr().err


@pytest.mark.thorough
def test_trajectory_file_on_the_command_line(tmp_path, capsys):
    file = tmp_path / "next.yaml"
    TrajectoryFile("tool_arm", "two_gains", parameters={"duration_s": 1.0}).write(file)
    out = tmp_path / "out"
    assert samrl(["excite", str(file), "--world", "mock", "--out", str(out)]) == OK
    assert sorted(p.name for p in out.iterdir()) == ["next_gains1.mcap", "next_gains2.mcap"]
    assert samrl(["excite", str(file), "--arm", "camera_arm", "--out", str(tmp_path / "x")]) == INPUT_REFUSED
    assert "is for tool_arm" in capsys.readouterr().err
    file.write_text("schema: 1\narm: tool_arm\nkind: slow\nparameters: {amplitude: 7}\n")
    assert samrl(["excite", str(file), "--out", str(tmp_path / "x")]) == INPUT_REFUSED
    assert "parameters.amplitude is 7" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_wrong_choices(tmp_path, capsys):
    assert samrl(["excite", "--set", "D", "--out", str(tmp_path)]) == INPUT_REFUSED
    assert samrl(["excite", "--arm", "left", "--out", str(tmp_path)]) == INPUT_REFUSED
    camera = ["excite", "--set", "camera", "--out", str(tmp_path)]
    assert samrl([*camera, "--duration", "2"]) == INPUT_REFUSED
    assert samrl([*camera, "--arm", "tool_arm"]) == INPUT_REFUSED
    assert samrl([*camera, "--scene", "needle_threading"]) == INPUT_REFUSED
    capsys.readouterr()
    assert samrl(["excite", "--list"]) == OK
    assert "micro_reversals" in capsys.readouterr().out


@pytest.mark.slow
def test_views_are_chosen_and_recorded(tmp_path, capsys):
    from samrl_ros.recordings.image_bag import read_image_bag

    camera = ["excite", "--set", "camera", "--duration", "6", "--out", str(tmp_path)]
    assert samrl(camera) == OK
    assert "nat" in capsys.readouterr().out
    recordings = [read_image_bag(tmp_path / f"{letter}.mcap", "peg_insertion") for letter in "ABC"]
    assert all(len(r.time) > 50 for r in recordings)
    # Views differ from bag to bag, the object does not.
    ends = [r.camera_joints[-1] for r in recordings]
    assert min(abs(ends[0] - ends[1]).max(), abs(ends[0] - ends[2]).max()) > 0.1
    assert samrl(camera) == INPUT_REFUSED


@pytest.mark.slow
def test_interrupted_run_leaves_only_complete_bags(tmp_path):
    root = Path(__file__).parents[3]
    out = tmp_path / "out"
    process = subprocess.Popen(
        [sys.executable, "-m", "samrl_ros.cli.main", "excite", "--duration", "1", "--out", str(out)],
        cwd=root,
        env={**os.environ, "PYTHONPATH": str(root), "OMP_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    wait_for((out / "A.mcap").exists, "the first bag", 0.05)
    process.send_signal(signal.SIGINT)
    text, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == INTERRUPTED, text
    assert [p.name for p in out.iterdir()] == ["A.mcap"], text
    assert "A.mcap" in text
