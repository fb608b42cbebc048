"""An agent's sense of touch: joins what images, encoders, torques and earlier episodes say of the hole."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from samrl_core.cell.calibration.seen_error import SeenError
from samrl_core.cell.control.tip_sense import TipSense
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.peg_insertion.task import BODY, PegInsertion
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.observation import Observation
from samrl_core.cell.types.pose import Pose, rotation_vector
from samrl_core.common.errors import InputError
from samrl_core.model.real2sim.real2sim import Estimate
from samrl_core.model.real2sim.tip_offset import TipOffset
from samrl_core.policy.contact.cell_memory import (
    MemorySettings,
    after_insertion,
    after_touch,
    at_view,
    no_memory,
)
from samrl_core.policy.contact.hole_grid import REACH
from samrl_core.policy.contact.insertion import (
    BOTTOM,
    FORCED,
    Insertion,
    InsertionSettings,
    Mouth,
    Move,
    begin,
    looked_again,
    next_move,
)
from samrl_core.policy.contact.seen_hole import SeenHole

_KNOWN = 0.004  # so deep in the hole the peg says where it is [m]
_IMAGES = 9  # at most of which the middle counts
_SAME_VIEW = 0.01  # the camera stands so near to where it stood [m]
_MOST_LEAN = 2.0  # an image's lean of the block counts up to so many times the task's own [-]
_SPARE = 0.0003  # a felt face may be so much higher than the mouth [m]
_AS_GOOD = 4.0  # an image with so many times the variance of the best one is left out


@dataclass(frozen=True)
class TouchSettings:
    """What is done, and what is believed of errors."""

    insertion: InsertionSettings = field(default_factory=InsertionSettings)
    memory: MemorySettings = field(default_factory=MemorySettings)
    uncertain: float = 0.0015  # standard deviation of the hole's place at which it does not go down [m]
    most_waits: int = 4  # actions in which it stays above for more images
    reach: float = REACH  # from where the hole is expected, within which it is searched [m]
    pixels: float = 0.5  # of hole and peg's end by their colours in an image, standard deviation [px]
    sights: bool = True  # whether hole and peg's end are looked for by their colours
    felt_at: float = 0.012  # from the hole, where its face is felt: most of the peg lies on it [m]

    def doubting(self, times: float) -> TouchSettings:
        """The same for cells whose images are wrong by so many times as much."""
        memory = replace(self.memory, unknown=times * self.memory.unknown)
        return replace(self, memory=memory, reach=times * self.reach)

    def beside(self, seen: SeenError) -> TouchSettings:
        """The same where a correction of the cell is not known exactly and shows hole and tip apart."""
        apart = float(np.sqrt(np.linalg.norm(seen.apart, 2)))
        memory = replace(self.memory, unknown=float(np.hypot(self.memory.unknown, apart)))
        return replace(self, memory=memory, reach=self.reach * memory.unknown / self.memory.unknown)


def require_peg(task: Task) -> PegInsertion:
    """The task, if it is one that touch can lead.

    Raises:
        InputError: the task is not a peg's.
    """
    if not isinstance(task, PegInsertion):
        raise InputError(f"task {task.name} has no peg and hole to insert by touch; leave touch off")
    return task


@dataclass(frozen=True, eq=False)
class _Seen:
    """The hole by one image and those before it, from one view."""

    stamp_ns: int
    place: np.ndarray  # (2,) in world as the camera has it [m]
    lean: np.ndarray  # (2,) see `Mouth`
    covariance: np.ndarray  # (2, 2) of the hole alone [m2]


class TouchInsertion:
    """Its state: the insertion of this episode, and the memory of the cell.

    Args:
        task: whose peg and hole.
        cell: as calibrated.
        settings: of search and memory.

    Raises:
        InputError: the task is not a peg's.
    """

    def __init__(self, task: Task, cell: CellSpec, settings: TouchSettings | None = None) -> None:
        self._task, self._settings = require_peg(task), settings or TouchSettings()
        self._sense = TipSense(cell, task.scene(cell).tool)
        self.memory = no_memory(self._settings.memory)
        self._forget()

    def begin_episode(self) -> None:
        """Keep what the last insertion told of the cell, forget the rest."""
        self._forget()

    @property
    def in_contact(self) -> bool:
        """Whether the tip is on the block or in it, where images add nothing."""
        return self._state is not None and self._state.phase not in ("feel", "above", "lowering")

    @property
    def sees_hole(self) -> bool:
        """Whether images from where the camera stands show peg and hole by their colours."""
        return self._by_colour.clear

    def see(self, estimate: Estimate, observation: Observation, offset: TipOffset) -> None:
        """Take in the hole of an estimate; an image counts once, and none once the tip is on the block.

        Of the last images the middle value counts: now and then a mask or a fit is off by a centimetre.
        """
        camera = observation.camera.camera_in_world
        if self._seen and (self.in_contact or self._seen[-1].stamp_ns == observation.stamp_ns):
            return
        if self._camera is None or np.linalg.norm(camera.position - self._camera.position) > _SAME_VIEW:
            self._seen, self._by_colour = [], SeenHole()
        self._camera = camera
        lean = np.zeros(2)
        if len(estimate.values) > 2:
            axis = rotation_vector(np.array([*estimate.values[2:4], 0.0])).rotation[:, 2]
            lean = axis[:2] / axis[2]
        place, covariance = estimate.values[:2], estimate.covariance[:2, :2]
        self._seen = [*self._seen, _Seen(observation.stamp_ns, place, lean, covariance)][-_IMAGES:]
        if self._settings.sights:
            tip = self._sense.read(observation.tool_arm).tip
            mouth, end = np.array([*place, self._task.height]), tip + offset.offset
            self._by_colour = self._by_colour.with_image(self._task, observation, mouth, end, tip)

    def mouth(self, offset: TipOffset) -> Mouth:
        """The hole from the tip that the camera sees, less the error that images have from there."""
        camera = self._camera
        assert camera is not None  # `see` comes first
        error, variance = at_view(self.memory, camera, self._settings.memory)
        shown, covariance = self._shown(offset)
        place = shown - error
        away = place - camera.position[:2]
        away /= max(float(np.linalg.norm(away)), 1e-9)
        return Mouth(
            place,
            covariance + variance * np.eye(2),
            self._task.height + self.memory.height,
            self._lean(),
            self._settings.reach,
            float(np.sqrt(self.memory.height_variance)),
            place + self._settings.felt_at * away,  # behind the hole: the peg hides it from nobody
        )

    def _shown(self, offset: TipOffset) -> tuple[np.ndarray, np.ndarray]:
        """The mouth's place (2,) by the encoders as images show it [m], and its covariance (2, 2) [m2]."""
        if self._by_colour.clear:
            height, pixels = self._task.height, self._settings.pixels
            deviation = float(np.sqrt(self.memory.height_variance))
            place = self._by_colour.place(height, height + self.memory.height)
            return place, self._by_colour.covariance(height, pixels, deviation)
        best = min((one.covariance for one in self._seen), key=np.trace)
        return self._middle()[0] - offset.offset[:2], best + offset.covariance[:2, :2]

    def _lean(self) -> np.ndarray:
        """Lean (2,) of the images, within the task's: wrong depth makes a block lean by 15 degrees."""
        lean, most = self._middle()[1], _MOST_LEAN * self._task.tilt
        return lean * min(1.0, most / max(float(np.linalg.norm(lean)), 1e-12))

    def _middle(self) -> tuple[np.ndarray, np.ndarray]:
        """Middle place (2,) [m] and lean (2,) of the images that know them nearly as well as the best one."""
        least = min(np.trace(one.covariance) for one in self._seen)
        known = [one for one in self._seen if np.trace(one.covariance) <= _AS_GOOD * least]
        return np.median([one.place for one in known], axis=0), np.median([one.lean for one in known], axis=0)

    def tip(self, encoders: np.ndarray, estimate: Estimate, offset: TipOffset) -> np.ndarray:
        """The tip (3,) as the estimate's hole is seen from it; `encoders` (3,) [m].

        What is deep below a felt face is in the hole, wherever images have that.
        """
        mouth, state = self.mouth(offset), self._state
        if state is not None and state.felt_face and state.phase in ("inside", "inserted"):
            deep = state.touched - float(encoders[2])
            if deep > _KNOWN:
                block = self._task.body_poses(estimate.values)[BODY]
                return block.apply(np.array([0.0, 0.0, self._task.height - deep + _SPARE]))
        height = mouth.height
        if self._state is not None and self._state.phase in ("inside", "inserted"):
            height = self._state.touched
        return encoders + np.array([*(estimate.values[:2] - mouth.place), self._task.height - height])

    def pressed_too_hard(self, observation: Observation) -> bool:
        """Whether joints have felt more in this episode, this reading included, than the task allows."""
        if self._state is None:
            return False
        felt = next_move(self._state, self._sense.read(observation.tool_arm), self._settings.insertion)
        return felt.state.hardest > self._task.force_limit

    def move(self, estimate: Estimate, offset: TipOffset, observation: Observation) -> Move:
        """The next action from the estimate, the tip's offset, and the reading that came with the image."""
        s = self._settings
        self.see(estimate, observation, offset)
        reading, mouth = self._sense.read(observation.tool_arm), self.mouth(offset)
        if self._state is None:
            self._state = begin(mouth, reading)
        else:
            self._state = looked_again(self._state, mouth, reading)
        before = self._state.phase
        move = next_move(self._state, reading, s.insertion)
        spread = float(np.sqrt(np.linalg.eigvalsh(mouth.covariance).max()))
        if before == "above" and move.state.phase == "lowering":
            if spread > s.uncertain and self._waits < s.most_waits and not self._by_colour.enough:
                self._waits += 1
                return Move("look", np.zeros(3), self._state)
        self._learn(move.state, offset, reading.tip)
        if move.name in ("feel", "above"):
            move = self._stepped(move)
        elif move.name == BOTTOM and move.state.hardest > self._task.force_limit:
            move = replace(move, name=FORCED)
        self._state = move.state
        return move

    def _stepped(self, move: Move) -> Move:
        """Steps through free space as long as the task allows."""
        far = float(np.linalg.norm(move.displacement))
        longest = self._task.fine_step if far < 2 * self._task.free_step else self._task.free_step
        step = move.displacement * min(1.0, longest / max(far, 1e-12))
        return Move(move.name, step, replace(move.state, down=-float(step[2])))

    def _learn(self, state: Insertion, offset: TipOffset, tip: np.ndarray) -> None:
        """Once in each episode, from the first touch and from the peg in the hole."""
        memory = self._settings.memory
        if not self._touch_known and state.felt_face:
            self._touch_known = True
            self.memory = after_touch(self.memory, state.touched - self._task.height, memory)
        deep = state.touched - float(tip[2])
        if not self._hole_known and self._camera and state.phase in ("inside", "inserted") and deep > _KNOWN:
            self._hole_known = True
            place = tip[:2] + deep * state.mouth.lean
            error = self._shown(offset)[0] - place
            self.memory = after_insertion(self.memory, self._camera, error, memory)

    def _forget(self) -> None:
        self._state: Insertion | None = None
        self._seen: list[_Seen] = []
        self._by_colour = SeenHole()
        self._camera: Pose | None = None  # of what was seen
        self._touch_known = self._hole_known = False
        self._waits = 0
