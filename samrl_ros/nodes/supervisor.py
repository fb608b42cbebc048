"""Runs episodes: requests each stage of Algorithm 1 in turn, and ends when the model reports success."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from samrl_msgs.msg import MotionStatus, Outcome, StepRequest
from samrl_msgs.srv import StartEpisode
from std_msgs.msg import String

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.tasks import DEFAULT_TASK, task_named
from samrl_core.common.errors import InputError
from samrl_core.policy.agent.loop import LoopSettings, LoopState, stage_after_update
from samrl_core.policy.contact.insertion import BOTTOM, FORCED, INSIDE
from samrl_ros.contract.behaviour import Behaviour, Outbox
from samrl_ros.contract.outcomes import TARGET_LOST
from samrl_ros.contract.settings import OUTLASTS_STOPS, setting
from samrl_ros.contract.topics import arm_topic, cell_topic
from samrl_ros.conversions import from_message, to_message
from samrl_ros.nodes.standstill import HOLDS_BACK, MOST_AGAIN, MOVED_M, SETTLE_NS, Doubt, Standstill

READY, PHASE = cell_topic("sim_bridge/ready"), cell_topic("phase")
REQUEST, OUTCOME = cell_topic("supervisor/request"), cell_topic("supervisor/outcome")
STATE, TARGET = cell_topic("model_updater/state"), cell_topic("view_planner/target")
EXECUTED, SAFETY = cell_topic("manipulator/executed_action"), cell_topic("safety_state")
WATCH = cell_topic("node_watch")
TOOL_JOINTS = arm_topic("tool_arm", "joint_states")
STATUS = {arm_topic(role, "motion_status"): role for role in ROLES}
START_EPISODE = cell_topic("sim_bridge/start_episode")
PRESSED = "pressed too hard"  # reason of an outcome: the joints felt more force than the task allows
UNDER_WAY = ("update", "view", "camera", "act")  # what an episode waits for
ANSWERS = {"update": "model_updater", "view": "view_planner", "act": "policy"}  # who, by stage
REMEMBERS = "model_updater"  # its belief dies with it: an episode cannot go on with another one


@dataclass(frozen=True)
class SupervisorSettings:
    """Settings of `supervisor`."""

    task: str = setting(DEFAULT_TASK, "task to run")
    cell: str = setting(DEFAULT_CELL, "cell whose arms and camera these are")
    episodes: int = setting(1, "episodes to run", range=(1, 1_000_000))
    seed: int = setting(0, "seed of the first episode; each next one adds 1", range=(0, 2**31 - 1))
    max_actions: int = setting(0, "actions per episode, 0 for the task's own limit", range=(0, 100_000))
    view_period: int = setting(
        LoopSettings.view_period, "actions from one search for a better view to the next", range=(1, 1000)
    )
    views_per_search: int = setting(
        LoopSettings.views_per_search,
        "camera moves in one search; after each the model is updated",
        range=(1, 20),
        former="looks",
    )
    max_lost_updates: int = setting(
        LoopSettings.max_lost_updates, "updates in a row that may miss the target", range=(1, 1000)
    )
    stop_on_model_success: bool = setting(
        LoopSettings.stop_on_model_success,
        "end when the model reports success; set false where model_updater is not enabled",
        former="believe",
    )
    heed_touch: bool = setting(
        False, "end when policy feels that the peg is in; set with policy's `touch`, whose tip is the better"
    )
    done_confirmations: int = setting(
        LoopSettings.done_confirmations,
        "consecutive model updates that must report success",
        range=(1, 20),
        former="agreeing",
    )
    retry_period: float = setting(
        3.0, "an update or view not answered is asked for again", "s of robot time", (0.5, 60.0)
    )
    stage_timeout: float = setting(30.0, "longest wait for one answer", "s of robot time", (1.0, 3600.0))
    wait_for_reset: bool = setting(
        OUTLASTS_STOPS,
        "an emergency stop holds the episode until its reset; false ends the run, as it once did",
    )


class Supervisor(Behaviour):
    """A chain of stages: update, view (update again if the camera moved), act, and from the start. What says
    "done" is asked for once more.

    `waiting_for` names the stage whose answer is due. Answers of another episode or step are ignored. After
    the reset of an emergency stop ("reset") the model is updated anew and the episode goes on; the next
    episode is held back ("hold") while nodes are away, a stop is in force, or an arm has two commanders.
    """

    name = "supervisor"
    inputs = (READY, STATE, TARGET, EXECUTED, SAFETY, WATCH, TOOL_JOINTS, *STATUS)
    outputs = (REQUEST, PHASE, OUTCOME)

    def __init__(self, settings: SupervisorSettings, outbox: Outbox) -> None:
        self._settings = settings
        self._outbox = outbox
        self._task = task_named(settings.task)
        cell = cell_named(settings.cell)
        tool = self._task.scene(cell).tool
        self._names = cell.tool_arm.joint_names
        self._parameters = tuple(spec.name for spec in self._task.parameters())
        self._arm = ArmModel(cell.tool_arm, cell.tool_base_in_world, None)
        self._tip_in_flange = tool.tip_in_flange
        self._loop = LoopSettings(
            settings.max_actions or self._task.max_actions,
            settings.view_period,
            settings.views_per_search,
            settings.max_lost_updates,
            done_confirmations=settings.done_confirmations,
            stop_on_model_success=settings.stop_on_model_success,
        )
        self._episode = -1
        self._state = LoopState()
        self._waiting_for = "start"
        self._asked_ns = self._published_ns = self._patient_since_ns = 0
        self._now_ns = self._state_ns = 0  # of the joint states; of the newest model state
        self._tip = np.zeros(3)
        self._sigma = float("nan")
        self._successes = 0
        self._inside = False  # whether the last action followed a hole by touch
        self._insists = False  # on an action: its node came back and may not have heard
        self._again = 0  # motions of this episode that were given up and begun anew
        self._standstill = Standstill()
        self._doubt: Doubt | None = None
        self.finished = False

    def start(self) -> None:
        """See `Behaviour`."""
        self._next_episode()

    def handle(self, topic: str, message: Any) -> None:
        """See `Behaviour`."""
        if topic == TOOL_JOINTS:
            self._on_joints(message)
        elif topic == SAFETY:
            self._on_safety(message)
        elif topic == WATCH:
            self._on_node(message)
        elif topic == READY:
            self._on_ready(message)
        elif topic == STATE and self._due("update", message):
            if from_message.stamp_ns(message) >= self._asked_ns:  # not a late answer to the request before
                self._on_state(message)
        elif topic == TARGET and self._due("view", message):
            self._on_view(message)
        elif topic in STATUS:
            self._on_status(STATUS[topic], message)
        elif topic == EXECUTED and self._due("act", message):
            self._state = self._state.acted()
            self._inside = self._settings.heed_touch and message.sub_goal == INSIDE
            if self._settings.heed_touch and message.sub_goal in (BOTTOM, FORCED):
                done = message.sub_goal == BOTTOM
                self._end(done, "done" if done else PRESSED)
            else:
                self._ask("update")

    def status(self) -> dict[str, str]:
        """See `Behaviour`."""
        return {
            "episode": str(self._episode),
            "step": str(self._state.step),
            "waiting_for": self._waiting_for,
            "detected_successes": str(self._successes),
        }

    def _due(self, stage: str, message: Any) -> bool:
        return self._waiting_for == stage and (message.episode, message.step) == (
            self._episode,
            self._state.step,
        )

    def _on_joints(self, message: Any) -> None:
        reading = from_message.arm_reading(message, self._names)
        self._now_ns = reading.stamp_ns
        self._tip = (self._arm.flange_in_base(reading.position) @ self._tip_in_flange).position
        self._standstill.see(self._tip, reading.velocity)
        if self._waiting_for in ("reset", "hold"):
            self._go_on()
        elif self._doubt is not None:
            if self._now_ns - self._doubt.since_ns >= SETTLE_NS and not self._standstill.away:
                self._resolve(self._doubt)
        elif self._waiting_for in UNDER_WAY and not self._standstill.away:
            self._look_after_answer()

    def _look_after_answer(self) -> None:
        timeout_ns = int(self._settings.stage_timeout * 1e9)
        if self._now_ns - self._patient_since_ns > timeout_ns:
            waited = f"within {self._settings.stage_timeout:g} s"
            self._end(False, f"error: no answer to {self._waiting_for!r} {waited}")
        elif self._waiting_for in ("update", "view") or (self._waiting_for == "act" and self._insists):
            # A request can be lost while the middleware still connects; asking twice for these is harmless.
            if self._now_ns - self._published_ns > int(self._settings.retry_period * 1e9):
                self._publish_request(self._waiting_for)

    def _on_safety(self, message: Any) -> None:
        if self._settings.wait_for_reset:
            self._standstill.hear_safety(message, self._now_ns)
            if self._standstill.estop:
                if self._waiting_for in UNDER_WAY:
                    self._stop_here()
                return
        if message.level >= b"\x02" and self._waiting_for in UNDER_WAY:
            self._end(False, f"error: {message.message}")

    def _stop_here(self) -> None:
        self._outbox.log("warn", f"episode {self._episode}: {self._standstill.estop}; waiting for the reset")
        self._waiting_for, self._doubt = "reset", None
        self._mark("stopped")

    def _go_on(self) -> None:
        """After a standstill: with the next episode, or with this one from a new image."""
        if not self._standstill.is_over(self._now_ns):
            return
        if self._waiting_for == "hold":
            self._call_start()
        elif self._standstill.displacement > MOVED_M:
            moved = f"{1e3 * self._standstill.displacement:.0f} mm"
            self._end(False, f"error: the tool was moved by {moved} while it was stopped")
        else:
            self._outbox.log("info", f"episode {self._episode}: goes on after the reset")
            self._state = self._state.interrupted()
            self._ask("update")

    def _on_node(self, message: Any) -> None:
        self._standstill.hear_node(message, self._now_ns)
        stage = self._waiting_for
        if message.name in self._standstill.away:
            lost = message.level >= b"\x02" and message.name == REMEMBERS
            if lost and stage in (*UNDER_WAY, "reset"):
                self._end(False, f"error: {message.name} {message.message}; its belief is lost")
            return
        self._patient_since_ns = self._now_ns
        if ANSWERS.get(stage) == message.name:
            self._insists = True
            self._publish_request(stage)

    def _resolve(self, doubt: Doubt) -> None:
        """No emergency stop is behind it: begin the motion anew, from a new image, or give up."""
        self._doubt = None
        if self._waiting_for == "start":
            if not self._standstill.estop:
                self._fail(doubt.reason)
            self._waiting_for = "hold"
        elif doubt.void and self._again < MOST_AGAIN:
            self._again += 1
            self._outbox.log("warn", f"episode {self._episode}: {doubt.reason}; begun anew from a new image")
            self._state = self._state.interrupted()
            self._ask("update")
        else:
            self._end(False, doubt.reason)

    def _on_ready(self, message: Any) -> None:
        if message.episode != self._episode or self._waiting_for not in ("start", "ready"):
            return
        if message.task != self._task.name:
            self._fail(f"the cell is laid out for {message.task!r}, not for {self._task.name!r}")
            return
        self._now_ns = max(self._now_ns, from_message.stamp_ns(message))
        self._state, self._state_ns, self._again, self._inside = LoopState(), 0, 0, False
        self._mark(f"episode {self._episode}")
        if self._standstill.estop:
            self._stop_here()
        else:
            self._ask("update")

    def _on_state(self, message: Any) -> None:
        self._state_ns = from_message.stamp_ns(message)
        self._now_ns = max(self._now_ns, self._state_ns)
        values, covariance = from_message.model_values(message, self._parameters)
        self._sigma = float(np.sqrt(np.diag(covariance).max()))
        self._state = self._state.updated(message.why_stopped, message.loss_after)
        stage = stage_after_update(self._task, values, self._tip, self._state, self._loop)
        if stage == "done" and self._inside and self._state.step < self._loop.max_actions:
            stage = "act"  # who feels the peg knows its depth better, and how hard it was pressed
        if stage == "again":
            self._state = self._state.confirmed_once()
            self._ask("update")
        elif stage == "retake":
            self._state = self._state.retaken_once()
            self._ask("update")
        elif stage == "lost":
            self._end(False, f"{TARGET_LOST} in {self._state.lost_updates} updates in a row")
        elif stage in ("view", "act"):
            self._ask(stage)
        else:
            self._end(stage == "done", stage)

    def _on_view(self, message: Any) -> None:
        self._state = self._state.view_searched()
        if message.move:
            self._waiting_for = "camera"
            self._mark("look")
        else:
            self._ask("act")

    def _on_status(self, role: str, message: Any) -> None:
        if (message.episode, message.step) != (self._episode, self._state.step):
            return
        if self._waiting_for not in ("camera", "act"):
            return
        if message.status in (MotionStatus.REJECTED, MotionStatus.STOPPED):
            reason = f"error: {role} {message.message}"
            if self._settings.wait_for_reset:  # word of the emergency stop behind it may be under way
                void = message.status == MotionStatus.STOPPED
                self._doubt = self._doubt or Doubt(self._now_ns, reason, void)
            else:
                self._end(False, reason)
        elif self._waiting_for == "camera" and role == "camera_arm":
            if message.status == MotionStatus.TIMEOUT:
                self._outbox.log("warn", f"camera arm: {message.message}; looking from where it is")
            self._now_ns = max(self._now_ns, from_message.stamp_ns(message))
            self._ask("update")

    def _ask(self, stage: str) -> None:
        self._waiting_for, self._doubt, self._insists = stage, None, False
        # Joint states that waited in the queue are older than the state that is asked about.
        self._now_ns = max(self._now_ns, self._state_ns)
        self._asked_ns = self._patient_since_ns = self._now_ns
        self._mark(stage)
        self._publish_request(stage)

    def _publish_request(self, stage: str) -> None:
        self._published_ns = self._now_ns
        request = StepRequest(
            header=to_message.header(self._asked_ns),
            episode=self._episode,
            step=self._state.step,
            stage=stage,
        )
        self._outbox.publish(REQUEST, request)

    def _mark(self, phase: str) -> None:
        self._outbox.publish(PHASE, String(data=phase))

    def _end(self, detected: bool, reason: str) -> None:
        self._waiting_for, self._doubt = "end", None
        self._successes += int(detected)
        level = "error" if reason.startswith("error") else "info"
        self._outbox.log(level, f"episode {self._episode}: {reason}")
        outcome = Outcome(header=to_message.header(self._now_ns), episode=self._episode)
        outcome.detected_success, outcome.actions, outcome.reason = detected, self._state.step, reason
        outcome.estimate_error_bound = self._sigma
        self._outbox.publish(OUTCOME, outcome)
        self._mark("end")
        self._next_episode()

    def _next_episode(self) -> None:
        if self._episode + 1 >= self._settings.episodes:
            self.finished = True
            return
        self._episode += 1
        if self._standstill.estop or self._standstill.away:
            self._waiting_for = "hold"
        else:
            self._call_start()

    def _call_start(self) -> None:
        self._waiting_for, self._doubt = "start", None
        request = StartEpisode.Request(episode=self._episode, seed=self._settings.seed + self._episode)
        self._outbox.call(START_EPISODE, request, self._on_started)

    def _on_started(self, response: Any) -> None:
        if not response.success:
            reason = f"the cell cannot start an episode: {response.message}"
            if not self._settings.wait_for_reset:
                self._fail(reason)
            if any(text in response.message for text in HOLDS_BACK):
                if self._standstill.hear_answer(response.message, self._now_ns):
                    self._outbox.log("warn", f"episode {self._episode} waits: {response.message}")
                self._waiting_for = "hold"  # and ask again, until that is mended
            else:
                self._doubt = Doubt(self._now_ns, reason)
        elif self._waiting_for == "start":
            self._standstill.hear_answer("", self._now_ns)
            self._waiting_for = "ready"

    def _fail(self, text: str) -> None:
        """Give up: the host logs it, shows it on /diagnostics, and the cell ends with it."""
        self.finished = True
        raise InputError(text)
