"""Bags of an arm's and a detector's frames as ROS records them, by the writers of `rosbags`."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

from tests.diagnosis.poses.pose_worlds import CAMERA, TARGET, matrix

RATE_HZ, DETECTIONS_HZ, SECONDS = 125.0, 15.0, 16.0
BEGIN_S = 1_700_000_000.0
FLANGE_IN_WRIST = matrix((0.0, 0.0, 0.09), (0.0, 0.0, 0.5))  # a fixed joint of the description
ELBOW = matrix((0.0, 0.1, 0.35), (0.3, 0.0, 0.0))
OPTICAL = matrix((0.0, 0.02, 0.0), (0.1, -1.2, 1.2))  # in camera_link
_TAG = "int32[] id\nfloat64[] size\ngeometry_msgs/PoseWithCovarianceStamped pose\n"
_TAGS = "std_msgs/Header header\napriltag_ros/AprilTagDetection[] detections\n"
NAMES = {"base": "base_link", "elbow": "forearm_link", "wrist": "wrist_3_link", "flange": "tool0",
         "mount": "camera_link", "camera": "camera_color_optical_frame", "target": "tag36h11:7"}  # fmt: skip


@dataclass(frozen=True, eq=False)
class FrameLog:
    """What stands in a bag: transforms by stamp, and how it differs from a plain one."""

    kind: str = "mcap"  # mcap, sqlite3 or ros1
    moving: list[tuple[float, list[tuple[str, str, np.ndarray]]]] = field(default_factory=list)
    static: list[tuple[str, str, np.ndarray]] = field(default_factory=list)


def flange_at(time: np.ndarray) -> np.ndarray:
    """(N, 4, 4) of a flange that turns about all axes."""
    t = time - BEGIN_S
    turn = np.stack([0.4 * np.sin(0.9 * t), 0.35 * np.sin(0.7 * t + 1.0), 0.6 * np.sin(0.5 * t)], axis=1)
    out = np.tile(np.eye(4), (len(t), 1, 1))
    out[:, :3, :3] = (Rotation.from_euler("x", np.pi) * Rotation.from_rotvec(turn)).as_matrix()
    away = np.stack([0.12 * np.sin(0.6 * t), 0.15 * np.cos(0.8 * t), 0.08 * np.sin(1.1 * t)], axis=1)
    out[:, :3, 3] = [0.4, 0.0, 0.5] + away
    return out


def arm_frames(
    in_hand: bool = True,
    late: float = 0.0,
    error: np.ndarray | None = None,
    connected: bool = True,
    noise: float = 3e-4,
    names: dict[str, str] | None = None,
    static: bool = True,
) -> FrameLog:
    """An arm of two joints with a camera on its flange or beside its base, and a detected target.

    Args:
        in_hand: the camera rides on the flange and the target stands still; else the other way round.
        late: by how much detections are stamped later than the arm was there [s].
        error: of the camera against what the frames state.
        connected: whether the frames state where the camera is.
        noise: of a detection [m], and 4 times that in rad.
        names: frames that are called otherwise.
        static: whether fixed transforms were recorded.
    """
    n = NAMES | (names or {})
    rng = np.random.default_rng(4)
    arm_time = BEGIN_S + np.arange(0.0, SECONDS, 1 / RATE_HZ)
    seen_time = BEGIN_S + 0.5 + np.arange(0.0, SECONDS - 1.0, 1 / DETECTIONS_HZ)
    wrist = flange_at(arm_time) @ np.linalg.inv(FLANGE_IN_WRIST)
    swing = np.tile(np.eye(4), (len(arm_time), 1, 1))
    swing[:, :3, :3] = Rotation.from_rotvec(np.outer(np.sin(arm_time - BEGIN_S), [0, 0, 0.4])).as_matrix()
    elbow = swing @ ELBOW
    log: list[tuple[float, list[tuple[str, str, np.ndarray]]]] = []
    for t, a, b in zip(arm_time, elbow, np.linalg.inv(elbow) @ wrist, strict=True):
        log.append((t, [(n["elbow"], n["base"], a), (n["wrist"], n["elbow"], b)]))
    hand = flange_at(seen_time - late)
    stated = CAMERA if in_hand else matrix((0.9, 0.3, 0.6), (0.2, 2.4, 0.1))
    camera = stated @ (np.eye(4) if error is None else error)
    target = TARGET if in_hand else matrix((0.02, 0.0, 0.05), (0.1, 0.0, 0.4))
    seen = np.linalg.inv(hand @ camera) @ target if in_hand else np.linalg.inv(camera) @ hand @ target
    seen[:, :3, 3] += noise * rng.standard_normal((len(seen), 3))
    seen[:, :3, :3] = (
        Rotation.from_rotvec(4 * noise * rng.standard_normal((len(seen), 3))).as_matrix() @ (seen[:, :3, :3])
    )
    log += [(t, [(n["target"], n["camera"], pose)]) for t, pose in zip(seen_time, seen, strict=True)]
    fixed = [(n["flange"], n["wrist"], FLANGE_IN_WRIST), (n["camera"], n["mount"], OPTICAL)]
    if connected:
        mount = stated @ np.linalg.inv(OPTICAL)
        fixed.append((n["mount"], n["flange"] if in_hand else n["base"], mount))
    return FrameLog(moving=sorted(log, key=lambda row: row[0]), static=fixed if static else [])


def write_frames(
    path: Path, log: FrameLog, kind: str = "mcap", joints: bool = False, poses: str = "", tags: int = 0
) -> Path:
    """A bag of one kind.

    `joints` adds joint states, `poses` is a topic in place of the target; with `tags` a detector's list of
    so many, the target the last of them, in any order and now and then none.
    """
    ros1 = kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_JAZZY)
    if ros1:
        text = "geometry_msgs/TransformStamped[] transforms\n"
        store.register(get_types_from_msg(text, "tf/msg/tfMessage"))
    store.register(get_types_from_msg(_TAG, "apriltag_ros/msg/AprilTagDetection"))
    store.register(get_types_from_msg(_TAGS, "apriltag_ros/msg/AprilTagDetectionArray"))
    types = store.types
    tf = "tf/msg/tfMessage" if ros1 else "tf2_msgs/msg/TFMessage"

    def header(stamp: float, frame: str) -> Any:
        ns = round(1e9 * stamp)
        time = types["builtin_interfaces/msg/Time"](ns // 10**9, ns % 10**9)
        args = (0, time, frame) if ros1 else (time, frame)
        return types["std_msgs/msg/Header"](*args)

    def transform(stamp: float, child: str, parent: str, pose: np.ndarray) -> Any:
        slash = "/" if ros1 else ""
        q = turns[id(pose)]
        return types["geometry_msgs/msg/TransformStamped"](
            header(stamp, slash + parent), slash + child,
            types["geometry_msgs/msg/Transform"](
                types["geometry_msgs/msg/Vector3"](*pose[:3, 3]), types["geometry_msgs/msg/Quaternion"](*q)
            ),
        )  # fmt: skip

    def detected(head: Any, pose: Any) -> Any:
        found = []
        for tag in rng.permutation(tags) if rng.random() > 0.1 else ():
            if tag < tags - 1 and rng.random() < 0.3:
                continue  # another tag, which is lost more often
            at = types["geometry_msgs/msg/Point"](
                pose.position.x + 0.1 * (tags - 1 - tag), pose.position.y, 1.0
            )
            own = pose if tag == tags - 1 else types["geometry_msgs/msg/Pose"](at, pose.orientation)
            covered = types["geometry_msgs/msg/PoseWithCovariance"](own, np.zeros(36))
            stamped = types["geometry_msgs/msg/PoseWithCovarianceStamped"](head, covered)
            numbers = np.array([tag], dtype=np.int32), np.array([0.08])
            found.append(types["apriltag_ros/msg/AprilTagDetection"](*numbers, stamped))
        return types["apriltag_ros/msg/AprilTagDetectionArray"](head, found)

    rng = np.random.default_rng(0)
    rows = [log.static, *(transforms for _, transforms in log.moving)]
    written = [pose for row in rows for _, _, pose in row]
    rotations = np.array([pose[:3, :3] for pose in written]).reshape(-1, 3, 3)
    quaternions = Rotation.from_matrix(rotations).as_quat()  # of all at once: one by one takes 0.3 ms each
    turns = {id(pose): q for pose, q in zip(written, quaternions, strict=True)}
    encode = store.serialize_ros1 if ros1 else store.serialize_cdr
    plugin = {"mcap": StoragePlugin.MCAP, "sqlite3": StoragePlugin.SQLITE3}.get(kind)
    path = path.with_suffix(".bag") if ros1 else path
    with Writer1(path) if ros1 else Writer(path, version=9, storage_plugin=plugin) as bag:
        topics: dict[str, Any] = {}
        logged = [0]

        def write(topic: str, kind: str, stamp: float, message: Any) -> None:
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=store)
            logged.append(max(round(1e9 * (stamp + 0.002)), logged[-1] + 1))  # it goes on, whatever stamps do
            bag.write(topics[topic], logged[-1], encode(message, kind))

        first = log.moving[0][0] if log.moving else BEGIN_S
        if log.static:
            made = [transform(first, *each) for each in log.static]
            write("/tf_static", tf, first, types[tf](made))
        for stamp, transforms in log.moving:
            if poses and transforms[0][0] == NAMES["target"]:
                seen = transform(stamp, *transforms[0])
                at, turn = seen.transform.translation, seen.transform.rotation
                pose = types["geometry_msgs/msg/Pose"](
                    types["geometry_msgs/msg/Point"](at.x, at.y, at.z), turn
                )
                if tags:
                    write(
                        poses, "apriltag_ros/msg/AprilTagDetectionArray", stamp, detected(seen.header, pose)
                    )
                    continue
                message = types["geometry_msgs/msg/PoseStamped"](seen.header, pose)
                write(poses, "geometry_msgs/msg/PoseStamped", stamp, message)
                continue
            write("/tf", tf, stamp, types[tf]([transform(stamp, *each) for each in transforms]))
            if joints:
                state = types["sensor_msgs/msg/JointState"](
                    header(stamp, ""), ["a"], np.array([np.sin(stamp)]), np.zeros(0), np.zeros(0)
                )
                write("/joint_states", "sensor_msgs/msg/JointState", stamp, state)
    return path


def write_all(out: Path) -> None:
    """A bag for each walk of the page of foreign logs."""
    error = matrix((0.006, -0.004, 0.005), (0.01, -0.008, 0.006))
    out.mkdir(parents=True, exist_ok=True)
    for kind in ("mcap", "sqlite3", "ros1"):
        write_frames(out / f"off_{kind}", arm_frames(error=error), kind, joints=True)
    write_frames(out / "right", arm_frames(), joints=True)
    write_frames(out / "late", arm_frames(late=0.06), "sqlite3", joints=True)
    write_frames(out / "still_camera", arm_frames(in_hand=False, error=error), joints=True)
    write_frames(out / "unconnected", arm_frames(connected=False), "ros1", joints=True)
    write_frames(out / "without_static", arm_frames(static=False), joints=True)


if __name__ == "__main__":
    write_all(Path(sys.argv[1]))
