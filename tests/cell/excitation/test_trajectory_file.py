"""Trajectory files: round trip, every kind by its defaults, and clear refusals."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.excitation import KINDS, TrajectoryFile, file_runs
from samrl_core.common.errors import InputError, LimitError


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_plays_by_its_defaults(tool_arm, kind):
    runs = file_runs("next", TrajectoryFile("tool_arm", kind), tool_arm.spec, tool_arm.payload)
    assert len(runs) == (2 if kind.startswith("two_") else 1)
    for run in runs:
        assert not run.command.velocity[[0, -1]].any()
        assert (np.ptp(run.command.position, axis=0) > 0.005).all()
    assert len({run.name for run in runs}) == len(runs)


def test_round_trip(tmp_path):
    file = TrajectoryFile(
        "tool_arm",
        "slow",
        ("panda_joint4", "panda_joint2"),
        {"speeds": (0.02, 0.1), "duration_s": 12.0, "seed": 3, "stiffness_scale": 0.7},
        why="Stribeck against Coulomb: crawl",
    )
    file.write(tmp_path / "next.yaml")
    assert TrajectoryFile.read(tmp_path / "next.yaml") == file
    with pytest.raises(InputError, match="exists"):
        file.write(tmp_path / "next.yaml")


def test_only_named_joints_move_and_gains_are_scaled(tool_arm):
    file = TrajectoryFile("tool_arm", "slow", ("panda_joint4",), {"damping_scale": 0.5, "duration_s": 10.0})
    (run,) = file_runs("n", file, tool_arm.spec, tool_arm.payload)
    travel = np.ptp(run.command.position, axis=0)
    assert travel[3] > 0.05 and not np.delete(travel, 3).any()
    assert np.allclose(run.controller.damping, 0.5 * tool_arm.spec.controller.damping)


def test_two_gains_repeat_the_motion_and_two_loads_add_a_mass(tool_arm):
    soft, hard = file_runs("n", TrajectoryFile("tool_arm", "two_gains"), tool_arm.spec, tool_arm.payload)
    assert np.array_equal(soft.command.position, hard.command.position)
    assert not np.allclose(soft.controller.stiffness, hard.controller.stiffness)
    file = TrajectoryFile("tool_arm", "two_loads", parameters={"extra_mass": 0.3})
    bare, loaded = file_runs("n", file, tool_arm.spec, tool_arm.payload)
    assert (bare.extra_mass, loaded.extra_mass) == (0.0, 0.3)


GOOD = "schema: 1\narm: tool_arm\nkind: slow\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[1, 2]", "holds a list"),
        ("schema: 1\nkind: slow\n", "key arm is missing"),
        (GOOD.replace("1", "2"), "schema is 2, this version reads 1"),
        (GOOD.replace("tool_arm", "left"), "arm is 'left'; write one of tool_arm"),
        (GOOD.replace("slow", "wild"), "kind is 'wild'; write one of slow"),
        (GOOD + "extra: 1\n", "unknown key extra"),
        (GOOD + "kind: task\n", "key given twice: kind"),
        (GOOD + "joints: panda_joint1\n", "joints is 'panda_joint1', must be a list"),
        (GOOD + "joints: [panda_joint1, panda_joint1]\n", "names one twice"),
        (GOOD + "parameters: {speed: 1}\n", "parameters.speed is unknown to 'slow', which has duration_s"),
        (
            GOOD + "parameters: {duration_s: long}\n",
            r"parameters.duration_s is 'long', must be a number from 1",
        ),
        (GOOD + "parameters: {duration_s: .nan}\n", "parameters.duration_s is nan"),
        (
            GOOD + "parameters: {duration_s: 9000}\n",
            r"duration_s is 9000, must be a number from 1 to 600 \[s\]",
        ),
        (GOOD + "parameters: {speeds: 0.1}\n", "parameters.speeds is 0.1, must be a list"),
        (GOOD + "parameters: {speeds: [0.1, 9]}\n", r"parameters.speeds\[1\] is 9, .* to 1 \[rad/s\]"),
        (GOOD + "parameters: {poses: 2.5}\n", "poses is 2.5, must be an integer from 2"),
        (GOOD + "parameters: {seed: true}\n", "seed is True"),
        ("schema: 1\narm: tool_arm\nkind: chirp\nparameters: {band: [9, 2]}\n", "must be two rising"),
        ("schema: [1\n", "is no YAML"),
    ],
)
def test_bad_files_are_refused_by_key_value_and_limit(tmp_path, text, message):
    path = tmp_path / "next.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as refusal:
        TrajectoryFile.read(path)
    assert str(refusal.value).count(str(path)) == 1


def test_missing_file(tmp_path):
    path = tmp_path / "none.yaml"
    with pytest.raises(InputError) as refusal:
        TrajectoryFile.read(path)  # it said twice that it cannot be read, once as if it were no YAML
    assert (
        str(refusal.value) == f"the trajectory: cannot read {path}: No such file or directory; check the path"
    )


@pytest.mark.parametrize(
    ("kind", "joints", "parameters", "error", "message"),
    [
        (
            "slow",
            ("rizon_joint1",),
            {},
            InputError,
            r"joints\[0\] is 'rizon_joint1'; tool_arm has panda_joint1",
        ),
        ("slow", (), {"speeds": (0.9,)}, LimitError, r"speeds\[0\] is 0.9 rad/s: panda_joint2"),
        ("slow", (), {"poses": 40}, InputError, "40 holds"),
        ("static", (), {"poses": 40}, InputError, "lengthen|set parameters.duration_s"),
        ("sweep", (), {"amplitude": 0.9}, InputError, "set parameters.duration_s to at least"),
        (
            "sweep",
            ("panda_joint2",),
            {"speeds": (0.9,)},
            LimitError,
            r"panda_joint2: acceleration .* rad/s2, allowed",
        ),
        (
            "sweep",
            ("panda_joint6",),
            {"amplitude": 1.0, "speeds": (0.3,)},
            LimitError,
            r"panda_joint6: position .* rad, allowed",
        ),
    ],
)
def test_what_breaks_a_limit_is_refused(tool_arm, kind, joints, parameters, error, message):
    file = TrajectoryFile("tool_arm", kind, joints, parameters)
    with pytest.raises(error, match=message):
        file_runs("n", file, tool_arm.spec, tool_arm.payload)
