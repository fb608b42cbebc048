"""Images, camera info and joint readings of one stamp become an `Observation`."""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable
from typing import Any

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.types.camera import Camera, Intrinsics
from samrl_core.cell.types.observation import ArmReading, Frame, Observation
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_ros.contract.topics import arm_topic, camera_topic
from samrl_ros.conversions import from_message

COLOR, DEPTH = camera_topic("color/image_raw"), camera_topic("depth/image_rect_raw")
MASK, INFO = camera_topic("mask/image_raw"), camera_topic("color/camera_info")
CALIBRATION = camera_topic("calibration")
JOINTS = {arm_topic(role, "joint_states"): role for role in ROLES}
FRAME = (COLOR, DEPTH, MASK, INFO)
INPUTS = (*FRAME, CALIBRATION, *JOINTS)

MAX_BAD_FRAMES = 30  # default number of refused images in a row before a node gives up
_PENDING_FRAMES = 8  # stamps whose parts may be on their way at once; more than images wait in a queue
# Joint readings buffered per arm, and waiting in the queue while a node computes. The queue of images holds
# 5, half a second at 10 Hz: their joint states are still there, at 250 Hz and (15 images a second) at 1 kHz.
_READINGS = 500
QUEUES = dict.fromkeys(JOINTS, _READINGS)


class UnmatchedImageError(InputError):
    """An image without a joint state of its time: lost on the way, or of another clock."""


class Assembler:
    """Joins by exact image stamp, and takes the joint reading nearest to it.

    The camera pose is computed from measured joints and the calibration that was published; it is what
    the cell believes, on hardware and in simulation alike.
    """

    def __init__(self, cell: CellSpec, slop_ns: int = 20_000_000) -> None:
        self._cell = cell
        self._slop_ns = slop_ns
        self._camera_arm: ArmModel | None = None
        self._camera_in_flange: Pose | None = None
        self._parts: OrderedDict[int, dict[str, Any]] = OrderedDict()
        self._readings: dict[str, deque[ArmReading]] = {role: deque(maxlen=_READINGS) for role in ROLES}

    def newest(self, role: str) -> ArmReading | None:
        """The newest reading of an arm, or None before the first."""
        return self._readings[role][-1] if self._readings[role] else None

    def take(self, topic: str, message: Any) -> Observation | None:
        """Hand in one message; returns an observation when this one completes it.

        Raises:
            InputError: an image, joint state or calibration that cannot be used, or a camera with another
                image size or lens than the cell's; it is dropped.
        """
        if topic in JOINTS:
            role = JOINTS[topic]
            self._readings[role].append(from_message.arm_reading(message, self._cell.arm(role).joint_names))
            return self._complete()
        if topic == CALIBRATION:
            poses = from_message.calibration(message.data)
            self._camera_in_flange = poses["camera_in_flange"]
            self._camera_arm = ArmModel(self._cell.camera_arm, poses["camera_arm"], None)
            return self._complete()
        value = self._lens(message) if topic == INFO else from_message.image(message)
        parts = self._parts.setdefault(from_message.stamp_ns(message), {})
        parts[topic] = value
        while len(self._parts) > _PENDING_FRAMES:
            self._parts.popitem(last=False)
        return self._complete()

    def _lens(self, message: Any) -> Intrinsics:
        """Networks, replay and model are of one camera: what another one sees would be silently wrong."""
        found = from_message.intrinsics(message)
        if found != self._cell.intrinsics:
            raise InputError(
                f"the camera publishes {found}, the cell's is {self._cell.intrinsics}; set the camera to "
                f"that, or describe this one in the cell and train for it"
            )
        return found

    def _complete(self) -> Observation | None:
        for stamp in list(self._parts):
            parts = self._parts[stamp]
            if len(parts) < 4 or self._camera_arm is None or self._camera_in_flange is None:
                continue
            try:
                readings = {role: self._nearest(role, stamp) for role in ROLES}
            except InputError:
                del self._parts[stamp]  # refused once, not again on every later message
                raise
            tool, camera_arm = readings["tool_arm"], readings["camera_arm"]
            if tool is None or camera_arm is None:
                continue
            del self._parts[stamp]
            flange = self._camera_arm.flange_in_world(camera_arm.position)
            camera = Camera(parts[INFO], flange @ self._camera_in_flange)
            frame = Frame(stamp, parts[COLOR], parts[DEPTH], parts[MASK])
            return Observation(frame, camera, tool, camera_arm)
        return None

    def _nearest(self, role: str, stamp: int) -> ArmReading | None:
        readings = self._readings[role]
        if not readings or readings[-1].stamp_ns < stamp:
            return None  # its own reading may still be on the way
        best = min(readings, key=lambda r: abs(r.stamp_ns - stamp))
        if abs(best.stamp_ns - stamp) > self._slop_ns:
            raise UnmatchedImageError(
                f"no joint state of {role} within {self._slop_ns / 1e6:.0f} ms of the image "
                f"at {stamp / 1e9:.3f} s, the nearest is of {best.stamp_ns / 1e9:.3f} s; check that camera "
                f"and arm share a clock"
            )
        return best


class PatientAssembler:
    """An `Assembler` of wanted images alone, which gives up only after many bad messages in a row.

    Most images are nobody's business: only those that somebody asked for are put together. On a busy computer
    joint states get lost on the way, and the image of their time with them: it is left out and counted.
    """

    def __init__(self, cell: CellSpec, max_bad_frames: int, log: Callable[[str, str], None]) -> None:
        """`log` takes level and text of what is refused."""
        self._assembler = Assembler(cell)
        self._most, self._log = max_bad_frames, log
        self.bad_frames = 0  # in a row
        self.left_out = 0  # images without joint states, since the start

    def take(self, topic: str, message: Any, wanted: Callable[[int], bool]) -> Observation | None:
        """As `Assembler.take`, of images whose stamp [ns] is wanted.

        Raises:
            InputError: too many messages in a row could not be used.
        """
        if topic in FRAME and not wanted(from_message.stamp_ns(message)):
            return None
        try:
            observation = self._assembler.take(topic, message)
        except InputError as error:
            self.bad_frames += 1
            if self.bad_frames >= self._most:
                raise
            if isinstance(error, UnmatchedImageError):
                self._leave_out(error)
            else:
                self._log("error", f"refused a message on {topic}: {error}")
            return None
        if observation is None:
            return None
        self.bad_frames = 0
        return observation if wanted(observation.stamp_ns) else None

    def _leave_out(self, error: UnmatchedImageError) -> None:
        """Log the first such image, and every tenfold."""
        self.left_out += 1
        if str(self.left_out).rstrip("0") == "1":
            self._log("warn", f"{self.left_out} images left out so far: {error}")
