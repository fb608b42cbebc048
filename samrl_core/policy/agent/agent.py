"""The agent: updates its model, plans views and acts, on one model of the task."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np
import torch

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, CellCorrection
from samrl_core.cell.calibration.seen_error import SeenError, seen_error
from samrl_core.cell.types.observation import Observation
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError, SolveError
from samrl_core.common.streams import stream
from samrl_core.model.model import Model
from samrl_core.model.real2sim.held import held_inside
from samrl_core.model.real2sim.prediction import (
    CameraErrors,
    camera_kept,
    likeliest,
    loosened_by,
    moved_by_contact,
    predictions,
    seen_from_elsewhere,
)
from samrl_core.model.real2sim.real2sim import Estimate, Real2Sim, initial_estimate
from samrl_core.model.real2sim.tip_offset import TipOffset, TipOffsetFit, TipOffsetSettings
from samrl_core.policy.agent.exploration import Exploration, clip_norm, within_reach
from samrl_core.policy.agent.settings import AgentSettings, Log, no_log, required
from samrl_core.policy.contact.insertion import FREE_MOVES
from samrl_core.policy.contact.surface_touch import SurfaceTouch, felt_surface
from samrl_core.policy.contact.touch_insertion import TouchInsertion, TouchSettings
from samrl_core.policy.networks.network_image import observed_image
from samrl_core.policy.networks.networks import ResidualActor
from samrl_core.policy.planning.expert import label_of
from samrl_core.policy.view.sensing_value import Networks, SensingValue
from samrl_core.policy.view.view_ascent import ViewAscent
from samrl_core.policy.view.view_planning import ViewChoice, ViewPlanner

Verb = Literal["update_model", "plan_view", "act"]
VERBS: tuple[Verb, ...] = get_args(Verb)


@dataclass(frozen=True, eq=False)
class ActionChoice:
    """What the tool shall do next."""

    sub_goal: str  # of eq. 22 that is next in the estimate; "none" when none is left
    nominal: np.ndarray  # (3,) eq. 12 [m]
    residual: np.ndarray  # (3,) eq. 13 [m]

    @property
    def displacement(self) -> np.ndarray:
        """Eq. 14, (3,) [m]."""
        return self.nominal + self.residual


class Agent:
    """Algorithm 1 in three verbs. A node of the cell uses one of them, `run_episode` all.

    Its state: `estimate`, the tip and its offset at the last image, the residual policy, the exploration
    noise, and the random generator of strategy "random".
    """

    def __init__(
        self,
        model: Model,
        settings: AgentSettings | None = None,
        networks: Networks | None = None,
        log: Log = no_log,
        verbs: tuple[Verb, ...] = VERBS,
        correction: CellCorrection = NO_CORRECTION,
    ) -> None:
        """An agent for the given verbs; what the others need is neither asked for nor built.

        Args:
            model: of the task and the cell.
            settings: what to do in each verb.
            networks: where the settings need them, as from `trained_networks`.
            log: receives messages about what went wrong.
            verbs: that will be used.
            correction: that the images come with; where it is not known exactly, they are believed less.

        Raises:
            InputError: networks are needed and not there, or the task's actions are too long for the tool.
        """
        self.model, self.settings = model, settings or AgentSettings()
        self._networks, self._log, self._verbs = networks, log, verbs
        if "plan_view" in verbs and self.settings.strategy == "q":
            required(networks, "strategy 'q'")
        if "act" in verbs:
            if self.settings.policy == "learned":
                required(networks, "policy 'learned'")
            if model.task.action_limit > self.settings.longest:
                raise InputError(
                    f"{model.task.name} has actions of up to {model.task.action_limit} m, the tool moves at "
                    f"most {self.settings.longest} m; shorten the task's steps or allow longer ones"
                )
        self.residual: ResidualActor | None = None  # None is the zero residual of eq. 15
        self._camera_errors = CameraErrors()
        self.restart(self.settings, correction=correction)

    def prepare(self) -> None:
        """Compile and solve now what the first use of each verb would wait for (seconds)."""
        plans = self.settings.policy == "optimised"
        if "update_model" in self._verbs or ("act" in self._verbs and plans):
            self.model.dynamics.prepare()
        if "plan_view" in self._verbs:
            (self._view_ascent if self.settings.strategy == "q" else self._view_planner).prepare()

    def restart(
        self,
        settings: AgentSettings,
        residual: ResidualActor | None = None,
        correction: CellCorrection = NO_CORRECTION,
    ) -> None:
        """Become a new agent of the same policy, strategy and image; what was compiled is kept.

        Raises:
            InputError: settings that another agent has to be built for.
        """
        for name in ("policy", "strategy", "actor_image", "doubt", "plan", "information", "ascent"):
            if getattr(settings, name) != getattr(self.settings, name):
                raise InputError(f"{name} of an agent stays what it is; build another agent for another one")
        self.settings, self.residual = settings, residual
        self._view_rng = np.random.default_rng(settings.seed)
        self.explore_from(0)
        self._believe(self._seen_error(correction))
        searched = TouchSettings(sights=settings.sees_colours).doubting(settings.doubt).beside(self._seen)
        task, cell = self.model.task, self.model.cell
        lain_on = felt_surface(task)
        self._surface = None if lain_on is None else SurfaceTouch(lain_on, cell)
        self._touch = TouchInsertion(task, cell, searched) if settings.touch and not self._surface else None
        self._kept_offset: TipOffset | None = None
        self._forget()

    def begin_episode(self) -> None:
        """Forget the last episode: its estimate and its exploration noise.

        With touch, what it told of the cell stays: the tip's offset, and how far images are wrong.
        """
        if self._surface is not None:
            self._surface.begin_episode()
        if self._touch is not None:
            self._touch.begin_episode()
            self._kept_offset = self._tip_offset
        self._forget()
        self._exploration.begin()

    def explore_from(self, steps: int) -> None:
        """Seed exploration for a run that begins with so many steps collected: no two are the same."""
        s = self.settings
        rng = stream(s.seed, "exploration", steps)  # its own: views of strategy "random" follow from the seed
        self._exploration = Exploration(s.exploration, s.exploration_memory, rng)

    def note_action(self, sub_goal: str) -> None:
        """Hear of an action that another agent of the cell has chosen: on the block the camera rests."""
        self._noted_contact = self._touch is not None and sub_goal not in FREE_MOVES

    def update_model(self, observation: Observation) -> Estimate:
        """Lines 3 and 8: the estimate after an image.

        Eq. 8 predicts each way that the last action may have gone, eq. 7 corrects each of them.
        """
        self._see_tip(observation)
        self._feel(observation, self.estimate.values)
        if self.settings.allows_update(self._updates):
            self._updates += 1
            found = self._predictions(observation)
            several = len(found) > 1
            updates = [self._real2sim.update(one, observation, compared=several) for one in found]
            before, self.estimate = self.estimate, likeliest(updates)
            if self._tip is not None:
                self.estimate = held_inside(self.model.task, found[0], self.estimate, self._tip)
            specs = self.model.task.parameters()
            if any(moved_by_contact(before, one, specs) for one in found):
                self.estimate = camera_kept(before, self.estimate, specs)
        else:
            self.estimate = replace(self.estimate, stamp_ns=observation.stamp_ns, why_stopped="disabled")
        return self.estimate

    def tip(self, observation: Observation) -> np.ndarray:
        """The tool's tip (3,) in the tool arm's base frame [m]: by encoders, corrected by what was seen."""
        if self._touch is not None and self._tip_offset is not None:
            tip = self.model.tip_in_base(observation.tool_arm.position).position
            self._touch.see(self.estimate, observation, self._tip_offset)
            return self._touch.tip(tip, self.estimate, self._tip_offset)
        self._feel(observation, self.estimate.values)
        return self._over_surface(self._tip_by_image(observation))

    def pressed_too_hard(self, observation: Observation) -> bool:
        """Whether joints have felt a larger force in this episode than the task allows: no success then."""
        return self._touch is not None and self._touch.pressed_too_hard(observation)

    def plan_view(self, estimate: Estimate, observation: Observation) -> ViewChoice:
        """Lines 5 to 15: the next view, or to stay; where the arms are is taken from the observation.

        An image in which the fit did not settle, as where a mask missed, is no reason to move: the next one
        from here is likelier to tell. The second one in a row that views are planned by is.
        """
        self._see_tip(observation)
        unsettled = estimate.why_stopped == "iteration_limit"
        by_chance, self._was_unsettled = unsettled and not self._was_unsettled, unsettled
        tool, camera = observation.tool_arm.position, observation.camera_arm.position
        if self.settings.strategy == "q":
            return self._view_ascent.plan(estimate, tool, camera)
        if self._touch is not None and (by_chance or not self._view_would_help(estimate)):
            return self._view_planner.plan(estimate, tool, camera, "fixed")
        return self._view_planner.plan(estimate, tool, camera, self.settings.strategy, self._view_rng)

    def act(self, estimate: Estimate, observation: Observation) -> ActionChoice:
        """Lines 4, 9 and 18: the next action, in the state of the estimate and the observation's joints.

        Raises:
            InputError: networks whose answer is not finite.
        """
        self._see_tip(observation)
        if self._touch is not None:
            assert self._tip_offset is not None  # `AgentSettings` sees to it
            move = self._touch.move(estimate, self._tip_offset, observation)
            return ActionChoice(move.name, clip_norm(move.displacement, self.settings.longest), np.zeros(3))
        self._feel(observation, estimate.values)
        tip = self.tip(observation)
        if self._surface is not None and self.settings.touch:
            to_touch = self._surface.move(estimate.values, tip)
            if to_touch is not None:
                way = clip_norm(to_touch.displacement, self.settings.longest)
                return ActionChoice(to_touch.name, way, np.zeros(3))
        if self.settings.policy == "learned":
            name, nominal = self._learned_action(estimate, tip, observation)
        else:
            name, nominal = self._planned_action(estimate.values, tip)
        return ActionChoice(name, nominal, self._residual_action(observation, tip, nominal))

    @cached_property
    def _real2sim(self) -> Real2Sim:
        return Real2Sim(self.model)

    @cached_property
    def _tip_offset_fit(self) -> TipOffsetFit:
        cell = self.model.cell
        believed = TipOffsetSettings().doubting(self.settings.doubt).beside(self._seen)
        return TipOffsetFit(self.model.task.scene(cell).tool, cell, believed)

    @cached_property
    def _view_ascent(self) -> ViewAscent:
        networks = required(self._networks, "strategy 'q'")
        return ViewAscent(self.model, self.model.cell, self.model.task, networks, self.settings.ascent)

    @cached_property
    def _view_planner(self) -> ViewPlanner:
        known = replace(self.settings.information, camera=self._camera_errors)
        return ViewPlanner(self.model, self.model.cell, self.model.task, known)

    def _seen_error(self, correction: CellCorrection) -> SeenError:
        """What the correction leaves at the first view, of what is aimed at and of the tip above it."""
        task, cell = self.model.task, self.model.cell
        tip = self.model.tip_in_base(task.start_joints(cell)["tool_arm"]).position
        above = cell.tool_base_in_world.apply(tip)
        return seen_error(correction, cell, task.start_camera(), task.view_region().target, above)

    def _believe(self, seen: SeenError) -> None:
        """Take over how well images are known; parts that are built already are told."""
        before, self._camera_errors = self._camera_errors, CameraErrors().beside(seen)
        self._seen = seen
        vars(self).pop("_tip_offset_fit", None)
        if "_view_planner" in vars(self) and self._camera_errors != before:
            self._view_planner = self._view_planner.believing(self._camera_errors)

    def _forget(self) -> None:
        before = initial_estimate(self.model)
        self.estimate: Estimate = loosened_by(before, self.model.task.parameters(), self._seen)
        self._tip_offset: TipOffset | None = None
        if self.settings.tip_offset and self._surface is None:  # a spatula's edge is felt, not seen
            self._tip_offset = self._tip_offset_fit.begin(self._kept_offset)
        self._tip_seen_ns = -1  # stamp of the image that the tip's offset was corrected by last [ns]
        self._tip: np.ndarray | None = None  # when the last image was taken, None before the first [m]
        self._camera: Pose | None = None  # the same of the camera
        self._noted_contact = False
        self._updates = 0  # of the model in this episode
        self._was_unsettled = False  # the estimate that the last view was planned by

    @property
    def _in_contact(self) -> bool:
        return self._noted_contact or (self._touch is not None and self._touch.in_contact)

    def _see_tip(self, observation: Observation) -> None:
        """Correct the tip's offset by an image, once."""
        if self._tip_offset is None or observation.stamp_ns == self._tip_seen_ns:
            return
        self._tip_seen_ns = observation.stamp_ns
        if self._in_contact or not self.settings.sees_tip:
            return  # the block hides the peg's end, which the fit would take for a shorter peg
        encoders = self.model.tip_in_base(observation.tool_arm.position).position
        self._tip_offset = self._tip_offset_fit.update(self._tip_offset, observation, encoders)

    def _view_would_help(self, estimate: Estimate) -> bool:
        """Whether the hole, not the held tip, limits how well the one is known from the other.

        A camera that moves must see the tip anew, which takes several images.
        """
        assert self._touch is not None and self._tip_offset is not None
        if self._touch.sees_hole:
            return False
        hole = np.sqrt(np.linalg.eigvalsh(estimate.covariance[:2, :2]).max())
        tip = np.sqrt(np.linalg.eigvalsh(self._tip_offset.covariance[:2, :2]).max())
        return not self._in_contact and (hole > tip or not self._tip_offset.images)

    def _feel(self, observation: Observation, values: np.ndarray) -> None:
        """Take in what the joints say of the surface, once, beside the work at `values` (P,)."""
        if self._surface is not None:
            self._surface.see(observation, values)

    def _over_surface(self, tip: np.ndarray) -> np.ndarray:
        """A tip (3,) by the encoders, as high over the drawn surface as over the one that was touched."""
        return tip if self._surface is None else tip - [0.0, 0.0, self._surface.height]

    def _tip_by_image(self, observation: Observation) -> np.ndarray:
        tip = self.model.tip_in_base(observation.tool_arm.position).position
        return tip if self._tip_offset is None else tip + self._tip_offset.offset

    def _predictions(self, observation: Observation) -> tuple[Estimate, ...]:
        tip, camera = self._tip_by_image(observation), observation.camera.camera_in_world
        before, self._tip = self._tip, tip
        specs = self.model.task.parameters()
        if self._camera is not None:
            way = float(np.linalg.norm(camera.position - self._camera.position))
            turn = camera.angle_to(self._camera)
            self.estimate = seen_from_elsewhere(self.estimate, specs, way, turn, self._camera_errors)
        self._camera = camera
        if before is None:
            return (self.estimate,)
        try:
            dynamics = self.model.dynamics_at(self.estimate.values)
            ways = self._over_surface(before), self._over_surface(tip)  # the same before and after a touch
            return predictions(dynamics, specs, self.estimate, *ways)
        except SolveError as error:
            self._log(f"the last estimate stands in for a prediction: {error}")
            return (self.estimate,)

    def _planned_action(self, values: np.ndarray, tip: np.ndarray) -> tuple[str, np.ndarray]:
        """Name of the next sub-goal, and the first action (3,) [m] of a plan; "none" and 0 when done."""
        dynamics = self.model.dynamics_at(values)
        label = label_of(dynamics, self.model.task, values, tip, self.settings.plan)
        if label.why_straight:
            self._log(f"no plan, straight to the next sub-goal instead: {label.why_straight}")
        return label.sub_goal, label.action

    def _learned_action(
        self, estimate: Estimate, tip: np.ndarray, observation: Observation
    ) -> tuple[str, np.ndarray]:
        networks = required(self._networks, "policy 'learned'")
        if self.settings.actor_image == "real":
            image = observed_image(observation, tip, self.model.cell)[None]
        else:
            value = SensingValue(self.model, networks, estimate, observation.tool_arm.position)
            image = value.view(observation.camera.camera_in_world)
        with torch.no_grad():
            action = networks.actor(image)[0].numpy()
        goals = self.model.task.sub_goals(estimate.values, tip)
        return goals[0].name if goals else "none", _finite(action, "actor")

    def _residual_action(self, observation: Observation, tip: np.ndarray, nominal: np.ndarray) -> np.ndarray:
        residual = np.zeros(3)
        if self.residual is not None:
            image = observed_image(observation, tip, self.model.cell)[None]
            with torch.no_grad():
                found = self.residual(image, torch.from_numpy(nominal).to(torch.float32)[None])[0]
            residual = _finite(found.numpy(), "residual policy")
        s = self.settings
        if s.exploration > 0.0:
            limit = s.exploration_limit if self.residual is None else self.residual.limit
            residual = clip_norm(residual + self._exploration.next(), limit)
        return within_reach(nominal, residual, s.longest)


def _finite(action: np.ndarray, who: str) -> np.ndarray:
    if not np.isfinite(action).all():
        raise InputError(f"the {who} gave {action}, which is not finite; train it anew")
    return action.astype(np.float64)
