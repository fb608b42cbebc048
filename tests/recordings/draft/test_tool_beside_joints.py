"""Everything that a robot gives in one table, tool and joints: a machine's log, and of its joints alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from samrl_ros.log_import.draft.any_draft import draft_any

AXES = range(6)


def _write(path: Path) -> None:
    time = np.arange(0.0, 6.0, 0.008)
    signals: dict[str, np.ndarray] = {"timestamp": 4156.212 + time}
    for lag, name in ((0.012, "actual"), (0.0, "target")):
        t = time - lag
        q = [0.4 * np.sin((0.9 + 0.1 * k) * t + k) for k in AXES]
        pose = [
            0.1 * q[0] - 0.3,
            0.1 * q[1],
            0.4 + 0.1 * q[2],
            0.7 + 0.2 * q[3],
            1.0 + 0.1 * q[4],
            0.1 * q[5],
        ]
        signals |= {f"{name}_q_{k}": q[k] for k in AXES}
        signals |= {f"{name}_qd_{k}": np.gradient(q[k], time) for k in AXES}
        signals |= {f"{name}_current_{k}": 1.4 * np.sin(t + k) for k in AXES}
        signals |= {f"{name}_TCP_pose_{k}": pose[k] for k in AXES}
        signals |= {f"{name}_TCP_speed_{k}": np.gradient(pose[k], time) for k in AXES}
    signals |= {f"target_moment_{k}": 10.0 * np.sin(time + k) for k in AXES}
    signals |= {f"actual_TCP_force_{k}": 5.0 * np.cos(time + k) for k in AXES}
    header = [*signals, "target_current_0"]  # asked for twice
    rows = zip(*signals.values(), signals["target_current_0"], strict=True)
    path.write_text("\n".join([",".join(header), *(",".join(f"{x:.6f}" for x in row) for row in rows)]))


def test_where_the_tool_was_sent_is_no_target_of_a_camera(tmp_path: Path) -> None:
    _write(tmp_path / "robot_data.csv")
    draft = draft_any([tmp_path / "robot_data.csv"], None, None)
    assert draft.kind == "joints"
    columns = draft.sources["states"]["columns"]
    read = {
        channel: [columns[key] for key in draft.channels[channel]["position"]["formula"]]
        for channel in ("states", "command")
    }
    assert read == {
        "states": [f"actual_q_{k}" for k in AXES],
        "command": [f"target_q_{k}" for k in AXES],
    }
    assert not draft.questions and "commanded_effort" not in draft.channels
    assert "effort" not in draft.channels["states"]


def test_turns_of_a_tool_are_no_joints(tmp_path: Path) -> None:
    """As a Niryo's state is kept: x_m, ..., yaw_rad of the tool beside j1_rad to j6_rad."""
    time = np.arange(0.0, 6.0, 0.02)
    tool = {name: 0.2 + 0.1 * np.sin(time + k) for k, name in enumerate(("x_m", "y_m", "z_m"))}
    tool |= {name: 0.3 * np.cos(time + k) for k, name in enumerate(("roll_rad", "pitch_rad", "yaw_rad"))}
    signals = {"t_s": time, **tool, **{f"j{k + 1}_rad": 0.5 * np.sin(time + k) for k in AXES}}
    rows = [",".join(f"{x:.6f}" for x in row) for row in zip(*signals.values(), strict=True)]
    (tmp_path / "robot.csv").write_text("\n".join([",".join(signals), *rows]))
    draft = draft_any([tmp_path / "robot.csv"], None, None)
    assert draft.kind == "joints" and draft.joints == [f"j{k + 1}" for k in AXES]


def test_dates_of_whole_seconds_are_no_time_of_rows(tmp_path: Path) -> None:
    rows = [f"2024-09-24 14:05:{k // 50:02d},{0.5 * np.sin(0.02 * k):.6f}" for k in range(500)]
    (tmp_path / "arm.csv").write_text("\n".join(["Timestamp,q1_rad", *rows]))
    draft = draft_any([tmp_path / "arm.csv"], None, None)
    assert draft.sources["states"]["time"] == {"rate_hz": 55.6}  # 500 rows from the first to the tenth second
    assert any("what is the rate" in question for question in draft.questions)
