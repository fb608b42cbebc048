"""Request, model state and image of one step, matched: they come on different topics, in any order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.observation import Observation
from samrl_core.model.real2sim.real2sim import Estimate
from samrl_ros.contract.settings import IMAGES_KEPT
from samrl_ros.contract.topics import cell_topic
from samrl_ros.conversions import from_message
from samrl_ros.conversions.model_state import from_state
from samrl_ros.nodes import assembly

READY, REQUEST = cell_topic("sim_bridge/ready"), cell_topic("supervisor/request")
STATE = cell_topic("model_updater/state")
INPUTS = (READY, REQUEST, STATE, *assembly.INPUTS)
QUEUES = assembly.QUEUES

_STATES = 4  # of one step: an update that is asked for again may be answered twice


@dataclass(frozen=True, eq=False)
class StepInput:
    """What a request is answered from."""

    request: Any  # samrl_msgs/StepRequest
    state: Any  # samrl_msgs/ModelState
    estimate: Estimate  # the same as data
    observation: Observation


class StepInputs:
    """Waits for a request of one stage, the model state of its step, and the image of that state."""

    def __init__(
        self,
        stage: str,
        parameters: tuple[str, ...],
        cell: CellSpec,
        max_bad_frames: int,
        log: Callable[[str, str], None],
        images_kept: int = IMAGES_KEPT,
    ) -> None:
        """Listen for requests of `stage`.

        Args:
            stage: "view" or "act"; a request of any other stage withdraws the one that waits.
            parameters: names in the model state, in order.
            cell: whose camera and joints the images are of.
            max_bad_frames: refused images in a row before `take` raises.
            log: takes level and text of what is refused.
            images_kept: images after a request among which the state's own is looked for.
        """
        self._images_kept = images_kept
        self._stage, self._parameters = stage, parameters
        self._frames = assembly.PatientAssembler(cell, max_bad_frames, log)
        self._observations: list[Observation] = []  # since the newest update was asked for
        self._wanted_since_ns = 0
        self._wanted_more = 0  # images
        self._update_asked_ns = 0  # stamp of the newest request for an update
        self._states: deque[Any] = deque(maxlen=_STATES)
        self._request: Any = None

    @property
    def bad_frames(self) -> int:
        """Messages in a row that could not be used."""
        return self._frames.bad_frames

    @property
    def left_out(self) -> int:
        """Images without joint states of their time, since the start."""
        return self._frames.left_out

    def take(self, topic: str, message: Any) -> StepInput | None:
        """Hand in one message of `INPUTS`; returns what a request is answered from, once all of it is there.

        Raises:
            InputError: a state of another task, or too many bad images in a row.
        """
        if topic == READY:
            self._request = None
            self._states.clear()
            self._observations, self._wanted_more = [], 0
        elif topic == STATE:
            from_message.model_values(message, self._parameters)  # refused on arrival, not when it is used
            self._states.append(message)
        elif topic == REQUEST:
            self._on_request(message)
        else:
            observation = self._frames.take(topic, message, self._wanted)
            if observation is not None:
                self._wanted_more -= 1
                self._observations.append(observation)
        return self._matched()

    def _on_request(self, message: Any) -> None:
        asked_ns = from_message.stamp_ns(message)
        self._request = message if message.stage == self._stage else None
        if message.stage == "update":
            self._update_asked_ns = asked_ns
            if asked_ns != self._wanted_since_ns:  # else asked again: the updater may have its image already
                self._observations = []
        self._wanted_since_ns, self._wanted_more = asked_ns, self._images_kept

    def _wanted(self, stamp_ns: int) -> bool:
        return self._wanted_more > 0 and stamp_ns >= self._wanted_since_ns

    def _matched(self) -> StepInput | None:
        request = self._request
        if request is None:
            return None
        state = self._state_before(request)
        if state is None:
            return None
        observation = self._observation(request, state)
        if observation is None:
            return None
        self._request, self._wanted_more = None, 0
        return StepInput(request, state, from_state(state), observation)

    def _state_before(self, request: Any) -> Any:
        """The newest state of the request's step that the supervisor can have seen when it asked.

        A step may have several updates: one from before the last was asked for is not it. Nor is one newer
        than the request: that answers an update which was asked for again when its answer was on the way.
        """
        asked_ns = from_message.stamp_ns(request)
        for state in reversed(self._states):
            same_step = (state.episode, state.step) == (request.episode, request.step)
            if same_step and self._update_asked_ns <= from_message.stamp_ns(state) <= asked_ns:
                return state
        return None

    def _observation(self, request: Any, state: Any) -> Observation | None:
        """The one that the state was updated with; or, where it was lost on the way here, a newer one."""
        updated_ns, asked_ns = from_message.stamp_ns(state), from_message.stamp_ns(request)
        for one in self._observations:
            if one.stamp_ns == updated_ns or one.stamp_ns >= asked_ns:
                return one
        return None
