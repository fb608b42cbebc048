"""Machines with sliding joints, joints without a motor and motors that count turns: units and inputs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.column_names import meaning
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.importer import import_recording
from samrl_ros.log_import.mapping import parse_mapping
from tests.recordings.logs.made_logs import MOTION, urdf_of, write_csv

TIME = MOTION.time
ANGLE = 2.5 * np.sin(2.1 * TIME)  # [rad]
LIFT = -0.08 + 0.06 * np.sin(3.3 * TIME)  # [m]


def described(joints: tuple[str, ...], sliding: tuple[str, ...]) -> str:
    """A URDF whose sliding joints reach from -0.2 to 0.2 m."""
    text = urdf_of(joints)
    for joint in sliding:
        text = text.replace(f'"{joint}" type="revolute"', f'"{joint}" type="prismatic"')
        head, tail = text.split(f'<joint name="{joint}"')
        text = f'{head}<joint name="{joint}"' + tail.replace(
            'lower="-3" upper="3"', 'lower="-0.2" upper="0.2"', 1
        )
    return text


def made(draft: Draft, folder: Path) -> np.ndarray:
    content = yaml.safe_load(as_yaml(draft))
    content.pop("questions", None)
    mapping = parse_mapping(yaml.safe_dump(content), folder / "mapping.yaml")
    states = import_recording(mapping.recordings[0], mapping, folder).recording.states
    return np.hstack([states.position, states.velocity])


@pytest.mark.parametrize("micro", ["\N{MICRO SIGN}", "\N{GREEK SMALL LETTER MU}"])
def test_microseconds_with_their_sign_are_no_seconds(micro: str, tmp_path: Path) -> None:
    """`Zeit [us]` was in seconds for sure: 'its name says so'."""
    columns = {f"Zeit [{micro}s]": np.round(TIME * 1e6), "q_rad": ANGLE}
    draft = draft_any([write_csv(tmp_path / "a.csv", columns)], None, None)
    assert draft.sources["states"]["time"]["unit"] == "us"


def test_a_sliding_axis_in_mm_beside_turning_ones_in_degrees(tmp_path: Path) -> None:
    columns = {"t": TIME, "A1.pos": np.degrees(ANGLE), "Z.pos": 1e3 * LIFT}
    columns |= {"A1.vel": np.degrees(np.gradient(ANGLE, TIME)), "Z.vel": 1e3 * np.gradient(LIFT, TIME)}
    path = write_csv(tmp_path / "a.csv", columns)
    draft = draft_any([path], described(("A1", "Z"), ("Z",)), None, Effort.none)
    assert not draft.questions
    there = made(draft, tmp_path)
    expected = np.column_stack([ANGLE, LIFT, np.gradient(ANGLE, TIME), np.gradient(LIFT, TIME)])
    np.testing.assert_allclose(there, expected, atol=1e-6)


def test_a_sliding_axis_that_no_unit_keeps_in_its_limits_is_asked_for(tmp_path: Path) -> None:
    columns = {"t": TIME, "A1.pos": np.degrees(ANGLE), "Z.pos": 40.0 * LIFT}
    path = write_csv(tmp_path / "a.csv", columns)
    draft = draft_any([path], described(("A1", "Z"), ("Z",)), None, Effort.none)
    assert any("is Z in m? It slides" in question for question in draft.questions)


def test_metres_beside_radians_stay_as_they_are(tmp_path: Path) -> None:
    """A gripper's finger that rests says nothing of its unit, and needs no question of its own."""
    columns = {"t": TIME, "A1.pos_rad": ANGLE, "Z.pos_rad": np.full(len(TIME), 0.02)}
    path = write_csv(tmp_path / "a.csv", columns)
    draft = draft_any([path], described(("A1", "Z"), ("Z",)), None, Effort.none)
    assert not draft.questions
    np.testing.assert_allclose(made(draft, tmp_path)[:, :2], np.column_stack([ANGLE, 0.0 * TIME + 0.02]))


def test_odrives_turns_are_asked_for_the_travel_of_what_slides(tmp_path: Path) -> None:
    turns = np.column_stack([LIFT, 0.5 * LIFT]) / 0.08 + 0.1 * ANGLE[:, None]
    arrays = {"timestamp": TIME, "pos_estimate": turns, "input_pos": turns + 0.01}
    arrays["vel_estimate"] = np.gradient(turns, TIME, axis=0)
    np.savez(tmp_path / "a.npz", **arrays)
    draft = draft_any([tmp_path / "a.npz"], described(("x", "y"), ("x", "y")), None, Effort.none)
    assert draft.channels["states"]["position"]["unit"] == "rev"
    assert draft.channels["states"]["velocity"]["unit"] == "rev/s"
    assert draft.channels["command"]["position"]["formula"] == ["input_pos[0]", "input_pos[1]"]
    asked = "\n".join(draft.questions)
    assert "ODrive's firmware" in asked and "travel for each turn" in asked
    assert not meaning("input_torque").commanded  # a feed-forward beside the loop


def test_one_motors_volts_beside_a_joint_without_a_motor(tmp_path: Path) -> None:
    """A pendulum or a spring behind a servo: the volts were left out, and nothing drove the joints."""
    columns = {
        "time (s)": TIME,
        "theta (rad)": ANGLE,
        "alpha (rad)": 0.1 * ANGLE,
        "v_m (V)": 4.0 * np.cos(TIME),
    }
    path = write_csv(tmp_path / "a.csv", columns)
    draft = draft_any([path], urdf_of(("theta", "alpha")), None)
    assert draft.channels["commanded_effort"]["effort"]["formula"][1] == 0
    assert draft.channels["commanded_effort"]["effort"]["unit"] == "V"
    assert draft.controller["torque_constant"] == [1.0, 0.0]
    asked = "\n".join(draft.questions)
    assert "drive theta, and nothing alpha?" in asked and "resistance [ohm]" in asked


def test_a_supplys_volts_are_no_motors_input(tmp_path: Path) -> None:
    columns = {"t": TIME, "theta_rad": ANGLE, "alpha_rad": 0.1 * ANGLE, "battery_V": 12.0 - 0.1 * TIME}
    path = write_csv(tmp_path / "a.csv", columns)
    draft = draft_any([path], urdf_of(("theta", "alpha")), None)
    assert "commanded_effort" not in draft.channels


CART_AND_POLE = [
    ("x", "theta", "x_dot", "theta_dot", 1.0, 1.0),
    ("x_meas [m]", "theta [rad]", "v_filt [m/s]", "omega_filt [rad/s]", 1.0, 1.0),
    ("x_mm", "alpha_deg", "speed_mm_s", "alpha_rate_deg_s", 1e3, 180.0 / np.pi),
    ("cart_position", "pole_angle", "cart_velocity", "pole_velocity", 1.0, 1.0),
]


@pytest.mark.parametrize(("x", "angle", "x_rate", "angle_rate", "length", "turn"), CART_AND_POLE)
@pytest.mark.parametrize("joints", [("cart", "pole"), ("slider_to_cart", "cart_to_pole")])
def test_a_cart_and_its_pole_are_drafted_together(
    x: str, angle: str, x_rate: str, angle_rate: str, length: float, turn: float,
    joints: tuple[str, str], tmp_path: Path,
) -> None:  # fmt: skip
    """The pole alone was drafted, and the cart's command as the pole's, in rad."""
    truth = np.column_stack([LIFT, ANGLE, np.gradient(LIFT, TIME), np.gradient(ANGLE, TIME)])
    columns = {"t": TIME, angle: turn * ANGLE, x: length * LIFT, "x_ref": length * LIFT * 1.1}
    columns |= {angle_rate: turn * truth[:, 3], x_rate: length * truth[:, 2], "force_N": 3.0 * ANGLE}
    path = write_csv(tmp_path / "a.csv", columns)
    draft = draft_any([path], described(joints, joints[:1]), None, Effort.none)
    assert draft.joints == list(joints) and "command" not in draft.channels
    assert not any("which is which" in question for question in draft.questions)
    np.testing.assert_allclose(made(draft, tmp_path), truth, atol=1e-6)


def test_two_poles_on_a_cart_are_asked_for(tmp_path: Path) -> None:
    joints = ("cart", "lower", "upper")
    columns = {"t": TIME, "x": LIFT, "theta1": ANGLE, "theta2": 0.5 * np.cos(TIME)}
    path = write_csv(tmp_path / "a.csv", columns)
    draft = draft_any([path], described(joints, joints[:1]), None, Effort.none)
    assert draft.joints == list(joints)
    assert any("x is cart, theta1 is lower, theta2 is upper?" in question for question in draft.questions)
    np.testing.assert_allclose(made(draft, tmp_path)[:, 2], 0.5 * np.cos(TIME), atol=1e-6)
