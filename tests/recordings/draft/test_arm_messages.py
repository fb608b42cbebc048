"""States as arms' makers publish and log them: what their documentation says is no question."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from samrl_core.cell.robots.panda.spec import PANDA
from samrl_ros.log_import.draft.column_names import meaning
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.joints.arm_messages import labels_of_array
from samrl_ros.log_import.draft.joints.joint_draft import draft_mapping
from tests.recordings.draft.test_told_by_model import COUNT, POSITION, TIME, TORQUE
from tests.recordings.logs.made_logs import urdf_of

URDF = PANDA.urdf.read_text()
BEGIN_S = 1_700_000_000.0
FRANKA, FLEXIV, OWN = "franka_msgs/msg/FrankaState", "flexiv_msgs/msg/RobotStates", "lab_msgs/msg/Telemetry"
# Definition, and which signal each array holds.
FIELDS = {
    FRANKA: {"q": "q", "q_d": "q", "dq": "dq", "theta": "shifted", "tau_J": "tau", "tau_J_d": "drive",
             "tau_ext_hat_filtered": "tau"},
    FLEXIV: {"q": "q", "theta": "shifted", "dq": "dq", "tau": "tau", "tau_dot": "drive", "tau_ext": "tau"},
    OWN: {"joint_angles": "q", "joint_velocities": "dq", "motor_torques": "tau"},
}  # fmt: skip


def signals() -> dict[str, np.ndarray]:
    """A Panda's motion, its torques, and the drives' without gravity: with friction of 1 N m."""
    model = pinocchio.buildModelFromXML(URDF)
    data = model.createData()
    weight = np.array([pinocchio.computeGeneralizedGravity(model, data, q) for q in POSITION])
    rate = np.gradient(POSITION, TIME, axis=0)
    drive = TORQUE - weight + np.tanh(rate / 0.01)
    return {"q": POSITION, "shifted": POSITION + 0.001, "dq": rate, "tau": TORQUE, "drive": drive}


SIGNALS = signals()


def bag_of(kind: str, path: Path) -> Path:
    """A bag with one topic, ROS 1 for Franka's message and MCAP else."""
    ros1 = kind == FRANKA
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_JAZZY)
    arrays = "".join(f"float64[{COUNT if ros1 else ''}] {name}\n" for name in FIELDS[kind])
    store.register(get_types_from_msg(f"std_msgs/Header header\n{arrays}", kind))
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    writer = Writer1(path) if ros1 else Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
    with writer as bag:
        connection = bag.add_connection("/states", kind, typestore=store)
        for k, at in enumerate(BEGIN_S + TIME[:600]):
            time = stamp(int(at), int((at % 1) * 1e9))
            head = header(seq=k, stamp=time, frame_id="") if ros1 else header(stamp=time, frame_id="")
            message = store.types[kind](head, *(np.array(SIGNALS[name][k]) for name in FIELDS[kind].values()))
            raw = (store.serialize_ros1 if ros1 else store.serialize_cdr)(message, kind)
            bag.write(connection, round(at * 1e9), raw)
    return path


def columns_of(draft: Draft, channel: str, quantity: str) -> set[str]:
    formulas = draft.channels[channel][quantity]["formula"]
    names = {formula.partition("[")[0] for formula in formulas}
    return {draft.sources[draft.channels[channel]["source"]]["columns"][name] for name in names}


@pytest.mark.parametrize(("kind", "torque"), [(FRANKA, "tau_J"), (FLEXIV, "tau")])
def test_a_makers_message_leaves_nothing_to_ask(kind: str, torque: str, tmp_path: Path) -> None:
    path = bag_of(kind, tmp_path / ("a.bag" if kind == FRANKA else "a"))
    draft = draft_mapping([path], URDF, str(PANDA.urdf))
    assert not draft.questions
    assert draft.joints == [f"panda_joint{k}" for k in range(1, COUNT + 1)]
    assert [columns_of(draft, "states", q) for q in ("position", "velocity", "effort")] == [
        {"q"}, {"dq"}, {torque},
    ]  # fmt: skip
    assert "commanded_effort" not in draft.channels  # tau_J_d leaves gravity out
    assert ("command" in draft.channels) == (kind == FRANKA)


def test_a_message_of_a_laboratorys_own_is_asked_for_and_not_refused(tmp_path: Path) -> None:
    draft = draft_mapping([bag_of(OWN, tmp_path / "a")], URDF, str(PANDA.urdf))
    assert columns_of(draft, "states", "position") == {"joint_angles"}
    assert "effort" not in draft.channels["states"]  # a motor's torque is no reading behind the gears
    assert any("what is /states: motor_torques" in question for question in draft.questions)


def csv_of(path: Path, names: dict[str, str]) -> Path:
    columns = [f"{name}_{j}" for name in names for j in range(1, COUNT + 1)]
    rows = np.column_stack([TIME, *(SIGNALS[signal] for signal in names.values())])
    np.savetxt(path, rows, delimiter=",", header=",".join(["time", *columns]), comments="", fmt="%.6f")
    return path


@pytest.mark.parametrize(
    ("torque", "drive", "asked"), [("tau_J", "tau_J_d", []), ("tau", "tau_cmd", ["effort"])]
)
def test_a_commanded_torque_without_gravity_is_not_taken(
    torque: str, drive: str, asked: list[str], tmp_path: Path
) -> None:
    """Told by libfranka's name, and by the model under another one."""
    names = {"q": "q", "dq": "dq", torque: "tau", "q_d": "q", drive: "drive"}
    draft = draft_mapping([csv_of(tmp_path / "a.csv", names)], URDF, str(PANDA.urdf))
    assert "commanded_effort" not in draft.channels
    (told,) = (line for line in draft.unused if drive in line)
    assert "gravity" in told
    assert draft.channels["states"]["effort"]["unit"] == "N m"
    assert not [q for q in draft.questions if not any(f".{name}:" in q for name in asked)]


def test_a_commanded_torque_with_gravity_is_taken(tmp_path: Path) -> None:
    names = {"q": "q", "dq": "dq", "tau_cmd": "tau"}
    draft = draft_mapping([csv_of(tmp_path / "a.csv", names)], URDF, str(PANDA.urdf))
    assert "effort" in draft.channels["commanded_effort"]


def test_arrays_go_from_the_base_to_the_flange_and_leave_fingers_out() -> None:
    arm = [f"fr3_joint{k}" for k in (1, 2, 3)]
    assert labels_of_array(3, ["fr3_finger_joint1", "fr3_finger_joint2", *arm[::-1]]) == tuple(arm)
    assert labels_of_array(3, ["a", "b", "c"]) == ("a", "b", "c")
    assert labels_of_array(3, ["left_1", "left_2", "left_3", "right_1", "right_2", "right_3"]) == (
        "1",
        "2",
        "3",
    )


@pytest.mark.parametrize(
    ("name", "quantity", "computed"),
    [
        ("q_dot{}", "velocity", False),
        ("theta_ddot{}", "acceleration", False),
        ("tau_dot{}", "effort", True),
        ("tau_ext_hat_filtered{}", "effort", True),
        ("external_torque", "effort", True),
        ("tau{}", "effort", False),
        ("{}_eff", "effort", False),
        ("end_eff_pos_x", "position", False),
    ],
)
def test_what_names_say_of_rates_and_shares(name: str, quantity: str, computed: bool) -> None:
    found = meaning(name)
    assert (found.quantity, found.computed) == (quantity, computed)


KORTEX = "kortex_driver/msg/BaseCyclic_Feedback"


def test_kinovas_feedback_is_in_degrees_and_gives_the_reaction(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    fields = "uint32 command_id\nfloat32 position\nfloat32 velocity\nfloat32 torque\nfloat32 current_motor"
    store.register(get_types_from_msg(fields, "kortex_driver/msg/ActuatorFeedback"))
    store.register(get_types_from_msg("uint32 frame_id\nActuatorFeedback[] actuators", KORTEX))
    actuator, feedback = store.types["kortex_driver/msg/ActuatorFeedback"], store.types[KORTEX]
    q = np.degrees(SIGNALS["q"]) % 360.0  # as Kinova counts
    with Writer1(tmp_path / "a.bag") as bag:
        connection = bag.add_connection("/base_feedback", KORTEX, typestore=store)
        for k, at in enumerate(BEGIN_S + TIME[:600]):
            columns = q[k], np.degrees(SIGNALS["dq"][k]), -SIGNALS["tau"][k]
            actuators = [actuator(0, *map(float, row), 0.5) for row in zip(*columns, strict=True)]
            raw = store.serialize_ros1(feedback(k, actuators), KORTEX)
            bag.write(connection, round(at * 1e9), raw)
    draft = draft_mapping([tmp_path / "a.bag"], URDF, str(PANDA.urdf))
    assert not draft.questions
    assert "command" not in draft.channels  # command_id is none
    states = draft.channels["states"]
    assert (states["position"]["unit"], states["velocity"]["unit"]) == ("deg", "deg/s")
    assert all(formula.startswith("-") for formula in states["effort"]["formula"])
    assert draft.joints == [f"panda_joint{k}" for k in range(1, COUNT + 1)]


def test_unitrees_motors_are_those_of_its_legs(tmp_path: Path) -> None:
    """Twenty motors beside a URDF of one leg: which is which was asked, and whether they are in degrees."""
    store = get_typestore(Stores.ROS1_NOETIC)
    fields = "float32 q\nfloat32 dq\nfloat32 tau_est\nfloat32 q_raw"
    store.register(get_types_from_msg(fields, "unitree_go/msg/MotorState"))
    store.register(get_types_from_msg("MotorState[12] motor_state", "unitree_go/msg/LowState"))
    motor, state = store.types["unitree_go/msg/MotorState"], store.types["unitree_go/msg/LowState"]
    with Writer1(tmp_path / "a.bag") as bag:
        connection = bag.add_connection("/lowstate", "unitree_go/msg/LowState", typestore=store)
        for k, at in enumerate(BEGIN_S + TIME[:80]):
            row = [motor(0.3 * float(SIGNALS["q"][k, n % 3]), 0.0, 0.5, 0.0) for n in range(12)]
            bag.write(
                connection, round(at * 1e9), store.serialize_ros1(state(row), "unitree_go/msg/LowState")
            )
    legs = ("FL_hip_joint", "FL_thigh_joint", "FL_calf_joint")
    draft = draft_mapping([tmp_path / "a.bag"], urdf_of(legs), "leg.urdf", Effort.drive)
    assert tuple(draft.joints) == legs
    columns = draft.sources["states"]["columns"]
    taken = [columns[name] for name in draft.channels["states"]["position"]["formula"]]
    assert taken == ["motor_state.3.q", "motor_state.4.q", "motor_state.5.q"]
    assert draft.channels["commanded_effort"]["effort"]["unit"] == "N m"
    assert not [question for question in draft.questions if "q_raw" not in question]
