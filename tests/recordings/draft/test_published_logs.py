"""Drafts of logs as popular packages publish them: what is taken, what is asked, what is left."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError
from samrl_ros.cli.diagnosis.load import load
from samrl_ros.cli.diagnosis.options import DiagnoseOptions
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.column_names import meaning
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.importer import import_recording
from samrl_ros.log_import.mapping import parse_mapping
from tests.recordings.logs.made_logs import JOINTS, MOTION, urdf_of
from tests.recordings.logs.published_logs import (
    PANDA,
    UR,
    droid,
    franka_ros2,
    isaac_lab,
    libfranka_log,
    libfranka_new_log,
    matlab_rows,
    mj_data,
    pandas_feather,
    pandas_parquet,
    plotjuggler,
    plotjuggler_of_two_topics,
    robomimic,
    rtde_csv,
    simulink,
    ur_robot_driver,
)


def taken(draft: Draft, channel: str, quantity: str) -> str:
    """The first column of a quantity."""
    entry = draft.channels[channel][quantity]
    formula = entry["formula"][0].split("[")[0]
    return draft.sources[entry.get("source", draft.channels[channel]["source"])]["columns"][formula]


def imported(draft: Draft, folder: Path) -> ArmRecording:
    """The first recording, with every question answered as drafted."""
    content = yaml.safe_load(as_yaml(draft))
    content.pop("questions", None)
    mapping = parse_mapping(yaml.safe_dump(content), folder / "mapping.yaml")
    return import_recording(mapping.recordings[0], mapping, folder).recording


def test_droid_takes_the_robots_clock_and_what_was_measured(tmp_path: Path) -> None:
    draft = draft_any([droid(tmp_path)], None, None)
    assert draft.sources["states"]["time"] == {
        "column": "observation.timestamp.robot_state.read_start",
        "unit": "ms",
    }
    state = "observation.robot_state"
    assert taken(draft, "states", "position") == f"{state}.joint_positions"
    assert taken(draft, "states", "velocity") == f"{state}.joint_velocities"
    assert taken(draft, "command", "position") == "action.joint_position"
    assert taken(draft, "commanded_effort", "effort") == f"{state}.motor_torques_measured"
    assert any("motor_torques_measured?" in question for question in draft.questions)


def test_the_last_part_of_a_path_says_whose_a_number_is() -> None:
    assert meaning("action.robot_state.joint_positions").measured
    assert not meaning("action.robot_state.joint_positions").commanded
    assert meaning("/controller_state/reference/positions").commanded
    assert meaning("action.joint_position").commanded


def test_robomimics_rate_is_told_by_its_velocities(tmp_path: Path) -> None:
    draft = draft_any([robomimic(tmp_path)], urdf_of(JOINTS), "arm.urdf", Effort.none)
    assert draft.sources["states"]["time"] == {"rate_hz": 20.0}
    assert [q for q in draft.questions if "rate" in q] == ["sources.states.time: is the rate 20 Hz?"]
    assert taken(draft, "states", "position") == "obs.robot0_joint_pos"
    assert taken(draft, "states", "velocity") == "obs.robot0_joint_vel"
    assert not any(question.startswith("channels.states.position: is data") for question in draft.questions)
    assert any("hardly follows" in question for question in draft.questions)
    roles = [(each["name"], each["role"], each["parts"]) for each in draft.recordings]
    assert roles == [
        ("demo_0", "fit", {"states": "data/demo_0"}),
        ("demo_1", "fit", {"states": "data/demo_1"}),
        ("demo_2", "held_out", {"states": "data/demo_2"}),
    ]


def test_isaac_labs_states_are_taken_for_what_is_relative(tmp_path: Path) -> None:
    draft = draft_any([isaac_lab(tmp_path)], None, None, Effort.none)
    assert taken(draft, "states", "position") == "states.articulation.robot.joint_position"
    assert any("relative to the default pose" in line for line in draft.unused)
    assert draft.sources["states"]["time"] == {"rate_hz": 50.0}


def test_libfrankas_old_log_has_its_time_in_ms(tmp_path: Path) -> None:
    draft = draft_any([libfranka_log(tmp_path)], urdf_of(PANDA), "panda.urdf")
    assert draft.sources["states"]["time"] == {"column": "duration", "unit": "ms"}
    assert taken(draft, "states", "velocity") == "dq[0]"
    assert taken(draft, "states", "effort") == "tau_J[0]"
    assert taken(draft, "command", "position") == "q_d[0]"
    assert any(
        line.startswith("log.csv: tau_J_d[{}]: commanded without the gravity") for line in draft.unused
    )


def test_libfrankas_new_log_is_read_as_the_old_one(tmp_path: Path) -> None:
    draft = draft_any([libfranka_new_log(tmp_path)], urdf_of(PANDA), "panda.urdf")
    assert draft.sources["states"]["time"] == {"column": "time", "unit": "ms"}
    assert taken(draft, "states", "position") == "state.q[0]"
    assert taken(draft, "states", "effort") == "state.tau_J[0]"
    assert taken(draft, "command", "position") == "state.q_d[0]"


def test_the_broadcaster_of_franka_is_faster_than_joint_states(tmp_path: Path) -> None:
    names = tuple(f"fr3_joint{k}" for k in (1, 2, 3))
    draft = draft_any([franka_ros2(tmp_path)], urdf_of(names), "fr3.urdf")
    place = "/franka_robot_state_broadcaster"
    assert draft.sources["states"]["part"] == f"{place}/measured_joint_states"
    assert draft.sources["command"]["part"] == f"{place}/desired_joint_states"
    assert "effort" in draft.channels["states"] and "commanded_effort" not in draft.channels
    assert not draft.questions


@pytest.mark.parametrize(
    ("make", "position", "effort"),
    [
        (plotjuggler, "/joint_states/position[0]", "/joint_states/effort[0]"),
        (mj_data, "qpos", "actuator_force"),
    ],
)
def test_what_the_log_does_not_say_is_asked(
    make: Callable[[Path], Path], position: str, effort: str, tmp_path: Path
) -> None:
    draft = draft_any([make(tmp_path)], urdf_of(JOINTS), "arm.urdf")
    assert taken(draft, "states", "position") == position
    assert draft.channels["states"]["velocity"]["unit"] == "rad/s"
    assert taken(draft, "commanded_effort", "effort") == effort
    assert any(
        question.startswith("channels.commanded_effort.effort: what is") for question in draft.questions
    )
    assert any(question.startswith("joints: ") for question in draft.questions)


@pytest.mark.parametrize("make", [pandas_parquet, pandas_feather])
def test_dates_of_pandas_are_time(make: Callable[[Path], Path], tmp_path: Path) -> None:
    path = make(tmp_path)
    draft = draft_any([path], urdf_of(JOINTS), str(tmp_path / "arm.urdf"), Effort.drive)
    assert draft.sources["states"]["time"] == {"column": "timestamp", "unit": "s"}
    (tmp_path / "arm.urdf").write_text(urdf_of(JOINTS))
    made = imported(draft, tmp_path)
    np.testing.assert_allclose(np.diff(made.states.time), 0.01, atol=1e-6)
    np.testing.assert_allclose(made.states.velocity, MOTION.velocity, atol=1e-12)


def test_simulinks_arrays_have_samples_along_the_last_axis(tmp_path: Path) -> None:
    draft = draft_any([simulink(tmp_path)], None, None, Effort.drive)
    assert draft.sources["states"]["time"] == {"column": "tout", "unit": "s"}
    assert len(draft.joints) == 3
    assert taken(draft, "commanded_effort", "effort") == "trq"


def test_topics_in_rows_of_their_own_are_two_sources(tmp_path: Path) -> None:
    """Their rows were dropped together, so that the import of a sure draft was refused."""
    draft = draft_any([plotjuggler_of_two_topics(tmp_path)], urdf_of(JOINTS), None, Effort.none)
    assert set(draft.sources) == {"states", "command"}
    draft.urdf = urdf_of(JOINTS)
    made = imported(draft, tmp_path)
    assert made.command is not None
    np.testing.assert_allclose(made.states.position, MOTION.position, atol=1e-12)
    np.testing.assert_allclose(made.command.position, MOTION.target, atol=1e-12)


def test_a_row_per_joint_is_turned_over(tmp_path: Path) -> None:
    draft = draft_any([matlab_rows(tmp_path)], None, None, Effort.drive)
    made = imported(draft, tmp_path)
    assert made.commanded_effort is not None
    np.testing.assert_allclose(made.states.position, MOTION.position, atol=1e-12)
    np.testing.assert_allclose(made.commanded_effort.effort, MOTION.effort, atol=1e-12)


def test_arrays_of_another_length_are_left_out(tmp_path: Path) -> None:
    """They ended the draft with NumPy's own words on shapes."""
    cut = {"qvel": MOTION.velocity[:-1], "target_q": MOTION.target[:-1], "tau": MOTION.effort[:-1]}
    np.savez(tmp_path / "a.npz", time=MOTION.time, qpos=MOTION.position, **cut)
    draft = draft_any([tmp_path / "a.npz"], urdf_of(JOINTS), "arm.urdf", Effort.drive)
    assert "command" not in draft.channels and "commanded_effort" not in draft.channels
    assert {"a.npz: qvel", "a.npz: target_q", "a.npz: tau"} <= set(draft.unused)


def test_rtde_counts_the_joints_of_universal_robots(tmp_path: Path) -> None:
    path = rtde_csv(tmp_path)
    draft = draft_any([path], urdf_of(UR), "ur5e.urdf")
    assert draft.joints == list(UR) and not draft.questions
    assert taken(draft, "states", "position") == "actual_q_0"
    other = draft_any([path], urdf_of(tuple(f"a{k}" for k in range(6))), "other.urdf")
    assert any(question.startswith("joints: ") for question in other.questions)


@pytest.mark.parametrize("effort", [Effort.ask, Effort.drive])
def test_currents_of_ur_robot_driver_are_no_torques_unasked(effort: Effort, tmp_path: Path) -> None:
    (question,) = draft_any([ur_robot_driver(tmp_path)], urdf_of(UR), "ur5e.urdf", effort).questions
    assert question.startswith("channels.commanded_effort.effort: ") and "currents [A]" in question


def test_every_episode_of_a_dataset_is_diagnosed(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "set.hdf5", "w") as file:
        for k in range(3):
            group = file.create_group(f"data/demo_{k}")
            group["time_s"], group["q_rad"] = MOTION.time, np.roll(MOTION.position, 90 * k, axis=0)
            group["q_target_rad"] = np.roll(MOTION.target, 90 * k, axis=0)
    fit, held_out, _ = load(DiagnoseOptions((tmp_path / "set.hdf5",), effort=Effort.none))
    assert [each.name for each in (*fit, *held_out)] == ["set_demo_0", "set_demo_1", "set_demo_2"]
    assert len(held_out) == 1


@pytest.mark.parametrize(
    ("name", "remedy"),
    [("log.pkl", "read_pickle"), ("log.xlsx", "save the sheet as CSV"), ("log.csv.gz", "gunzip")],
)
def test_what_is_no_log_names_the_remedy(name: str, remedy: str, tmp_path: Path) -> None:
    (tmp_path / "day").mkdir()
    (tmp_path / "day" / name).write_bytes(b"\x1f\x8b\0\0")
    for given in (tmp_path / "day", tmp_path / "day" / name):
        with pytest.raises(InputError, match=remedy):
            draft_any([given], None, None)
