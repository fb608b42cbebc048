"""The contract between processes: every topic with its type, QoS, rate, frame, unit and publisher.

Plain data, no imports of ROS: tools that only read bags use it as well. `msgs_docs/reference/topics.md` is
generated from this table.
"""

from __future__ import annotations

from dataclasses import dataclass

from samrl_core.cell.robots.robot import ROLES

NAMESPACE = "/cell"

# QoS profiles by name; samrl_ros/contract/qos.py turns them into rclpy profiles.
STATE = "state"  # reliable, volatile, keep last 10: joint states, requests and answers
COMMAND = "command"  # reliable, volatile, keep last 10: a lost command would be a lost set point
SENSOR = "sensor"  # best effort, volatile, keep last 5: images
LATCHED = "latched"  # reliable, transient local, keep last 1: descriptions and states for late joiners
CLOCK = "clock"  # best effort, volatile, keep last 1
STATIC_TF = "static_tf"  # reliable, transient local, keep last 1, in the global namespace
DIAGNOSTICS = "diagnostics"  # reliable, volatile, keep last 10


@dataclass(frozen=True)
class Topic:
    """One topic. `rate` is at real-time factor 1 in simulated time."""

    name: str
    type: str  # as in ROS 2: package/msg/Type
    qos: str
    publisher: str
    rate: str
    frame: str
    content: str
    recorded: bool = True


@dataclass(frozen=True)
class Service:
    """One service."""

    name: str
    type: str
    server: str
    content: str


def _arm_topics(role: str) -> list[Topic]:
    base = f"{NAMESPACE}/{role}"
    arm = "Panda" if role == "tool_arm" else "Rizon 4"
    return [
        Topic(
            f"{base}/joint_states",
            "sensor_msgs/msg/JointState",
            STATE,
            "sim_bridge",
            "250 Hz",
            "-",
            f"{arm}: measured position [rad], velocity [rad/s], link-side effort with gravity [N m]",
        ),
        Topic(
            f"{base}/command",
            "trajectory_msgs/msg/JointTrajectory",
            COMMAND,
            "manipulator",
            "250 Hz",
            "-",
            f"{arm}: one point that the controller tracks, valid at its stamp; effort is feed-forward"
            " without gravity [N m]",
        ),
        Topic(
            f"{base}/commanded_effort",
            "sensor_msgs/msg/JointState",
            STATE,
            "sim_bridge",
            "250 Hz",
            "-",
            f"{arm}: torque sent to the drives, gravity included [N m] (effort only)",
        ),
        Topic(
            f"{base}/joint_trajectory",
            "trajectory_msgs/msg/JointTrajectory",
            STATE,
            "any user",
            "on demand",
            "-",
            f"{arm}: a trajectory to execute; rejected by JointTrajectoryController's rules",
        ),
        Topic(
            f"{base}/robot_description",
            "std_msgs/msg/String",
            LATCHED,
            "sim_bridge",
            "once",
            "-",
            f"{arm}: nominal URDF",
        ),
        Topic(
            f"{base}/controller",
            "std_msgs/msg/String",
            LATCHED,
            "sim_bridge",
            "once",
            "-",
            f"{arm}: nominal controller, JSON ([kinds](controllers.md))",
        ),
        Topic(
            f"{base}/tool",
            "std_msgs/msg/String",
            LATCHED,
            "sim_bridge",
            "once",
            "flange",
            f"{arm}: nominal payload at the flange, JSON: mass [kg], centre_of_mass [m], inertia [kg m2]",
        ),
        Topic(
            f"{base}/motion_status",
            "samrl_msgs/msg/MotionStatus",
            STATE,
            "manipulator",
            "per motion",
            "-",
            f"{arm}: how a motion ended",
        ),
    ]


def _camera(name: str, type_: str, rate: str, content: str, qos: str = SENSOR) -> Topic:
    frame = "camera_color_optical_frame" if qos == SENSOR else "-"
    return Topic(f"{NAMESPACE}/camera/{name}", type_, qos, "sim_bridge", rate, frame, content)


def _own(
    name: str, type_: str, publisher: str, content: str, qos: str = STATE, rate: str = "per step"
) -> Topic:
    return Topic(f"{NAMESPACE}/{name}", type_, qos, publisher, rate, "-", content)


_ALL: list[Topic] = [
    *(topic for role in ROLES for topic in _arm_topics(role)),
    _camera("color/image_raw", "sensor_msgs/msg/Image", "10 Hz", "rgb8"),
    _camera(
        "depth/image_rect_raw",
        "sensor_msgs/msg/Image",
        "10 Hz",
        "32FC1 [m], NaN invalid, aligned to colour, same stamp",
    ),
    _camera("color/camera_info", "sensor_msgs/msg/CameraInfo", "10 Hz", "intrinsics, same stamp"),
    _camera(
        "mask/image_raw",
        "sensor_msgs/msg/Image",
        "10 Hz",
        "mono8 segmentation as a sensor gives it: 0 background, 1.. labels; with border errors and dropouts",
    ),
    _camera(
        "calibration",
        "std_msgs/msg/String",
        "once",
        "nominal hand-eye and arm bases, JSON",
        LATCHED,
    ),
    _own("phase", "std_msgs/msg/String", "supervisor", "phase marks of the controller itself"),
    _own("sim_bridge/ready", "samrl_msgs/msg/EpisodeReady", "sim_bridge", "laid out for an episode", LATCHED),
    _own(
        "safety_state",
        "diagnostic_msgs/msg/DiagnosticStatus",
        "sim_bridge",
        "state of the command guard of each arm",
        LATCHED,
        "on change",
    ),
    _own(
        "node_watch",
        "diagnostic_msgs/msg/DiagnosticStatus",
        "cell",
        "a node is away, with the reason (level 2), or back (level 0); name: the node",
        STATE,
        "on change",
    ),
    _own(
        "operator/request",
        "std_msgs/msg/String",
        "hardware_bridge",
        "what a real cell asks its operator, JSON: asks (scene, judgement or nothing), episode, text; for a"
        " scene start, the joints [rad] by arm",
        LATCHED,
        "on change",
    ),
    _own(
        "operator/judgement",
        "std_msgs/msg/String",
        "hardware_bridge",
        "the operator's word on an ended episode, JSON: episode, success",
        STATE,
        "per episode",
    ),
    _own("supervisor/request", "samrl_msgs/msg/StepRequest", "supervisor", "asks a stage of the loop"),
    _own(
        "supervisor/outcome",
        "samrl_msgs/msg/Outcome",
        "supervisor",
        "how an episode ended",
        STATE,
        "per episode",
    ),
    _own("model_updater/state", "samrl_msgs/msg/ModelState", "model_updater", "the updated model"),
    _own(
        "model_updater/image",
        "sensor_msgs/msg/Image",
        "model_updater",
        "rgb8: the model rendered at the update, for people to compare",
    ),
    _own("view_planner/target", "samrl_msgs/msg/ViewTarget", "view_planner", "chosen view"),
    Topic(
        f"{NAMESPACE}/view_planner/candidates",
        "sensor_msgs/msg/PointCloud2",
        STATE,
        "view_planner",
        "per step",
        "world",
        "views that were scored: x, y, z of the camera [m] and score, as that of the chosen view",
    ),
    _own("policy/nominal_action", "samrl_msgs/msg/ToolAction", "policy", "nominal action and residual"),
    _own("manipulator/executed_action", "samrl_msgs/msg/ToolAction", "manipulator", "what was executed"),
    _own(
        "residual_trainer/weights",
        "std_msgs/msg/String",
        "residual_trainer",
        "residual policy in force, JSON: task, version, file (absolute), sha256, steps (collected so far);"
        " version 0 is the zero residual. policy loads it after checking the hash",
        LATCHED,
        "on update",
    ),
    Topic("/clock", "rosgraph_msgs/msg/Clock", CLOCK, "sim_bridge", "250 Hz", "-", "simulated time"),
    Topic(
        "/tf",
        "tf2_msgs/msg/TFMessage",
        STATE,
        "sim_bridge",
        "20 Hz",
        "world",
        "links from measured joints",
    ),
    Topic(
        "/tf_static",
        "tf2_msgs/msg/TFMessage",
        STATIC_TF,
        "sim_bridge",
        "once",
        "world",
        "arm bases, camera and tool mounts",
    ),
    Topic(
        "/diagnostics",
        "diagnostic_msgs/msg/DiagnosticArray",
        DIAGNOSTICS,
        "every node",
        "1 Hz",
        "-",
        "rates, drops, ages, states",
    ),
    Topic("/rosout", "rcl_interfaces/msg/Log", DIAGNOSTICS, "every node", "-", "-", "log"),
]

TOPICS: dict[str, Topic] = {topic.name: topic for topic in _ALL}

# Names in bags from before `policy` acted, and what they are called since. A replay understands both.
FORMER_NAMES = {f"{NAMESPACE}/view_planner/nominal_action": f"{NAMESPACE}/policy/nominal_action"}

# Topics that bags from before have not. What a replay says there does not change such a bag's digest.
LATER_TOPICS = frozenset({f"{NAMESPACE}/view_planner/candidates"})

SERVICES: tuple[Service, ...] = (
    Service(
        f"{NAMESPACE}/sim_bridge/start_episode",
        "samrl_msgs/srv/StartEpisode",
        "sim_bridge",
        "lay the scene anew; answers when the arms are at rest",
    ),
    Service(
        f"{NAMESPACE}/operator/scene_ready",
        "std_srvs/srv/Trigger",
        "hardware_bridge",
        "the operator's word that the scene is laid and the arms may move; refused while an arm moves or is"
        " not at the start",
    ),
    Service(
        f"{NAMESPACE}/operator/judge",
        "std_srvs/srv/SetBool",
        "hardware_bridge",
        "the operator's word whether the ended episode succeeded",
    ),
    Service(
        f"{NAMESPACE}/estop",
        "std_srvs/srv/Trigger",
        "sim_bridge",
        "emergency stop of both arms, latched",
    ),
    Service(
        f"{NAMESPACE}/estop_reset",
        "std_srvs/srv/Trigger",
        "sim_bridge",
        "explicit reset after estop or fault; refused while an arm moves",
    ),
    Service(f"{NAMESPACE}/recorder/start", "std_srvs/srv/Trigger", "recorder", "start a bag"),
    Service(f"{NAMESPACE}/recorder/stop", "std_srvs/srv/Trigger", "recorder", "close the bag"),
    Service(f"{NAMESPACE}/recorder/split", "std_srvs/srv/Trigger", "recorder", "continue in a new file"),
)


def arm_topic(role: str, name: str) -> str:
    """Full name of an arm's topic, for example `arm_topic("tool_arm", "joint_states")`."""
    return f"{NAMESPACE}/{role}/{name}"


def camera_topic(name: str) -> str:
    """Full name of a camera topic, for example `camera_topic("color/image_raw")`."""
    return f"{NAMESPACE}/camera/{name}"


def cell_topic(name: str) -> str:
    """Full name of any other topic of the cell, for example `cell_topic("phase")`."""
    return f"{NAMESPACE}/{name}"
