"""States spread widely about the optimiser's trajectories, each with its label.

States of undisturbed trajectories alone teach an actor nothing of where its own errors lead it (Ross et al.
2011). So several copies of the model run side by side; each one follows the optimiser with noise of some
size, wanders for a while, or drives to a point near a sub-goal, and every state on the way is labelled. All
of it goes through the model's motion, so nothing stands where it could not have come to. An episode begins
as the task begins, in a state that was handed in, or at the stage that has been visited the least so far.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from samrl_core.cell.tasks.task import Task
from samrl_core.common.errors import InputError
from samrl_core.learning.states.state_batch import joined, moved, rows
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics, TaskState
from samrl_core.policy.planning.expert import Label, label_of


@dataclass(frozen=True)
class ExploreSettings:
    """How widely states are spread. Ranges are sampled uniformly, those of lengths in their logarithm."""

    slots: int = 4  # copies of the model side by side
    longest: int = 40  # actions of an episode
    follow: tuple[int, int] = (2, 12)  # actions that follow the optimiser before something else is sampled
    wander: tuple[int, int] = (1, 5)  # actions of a random walk
    visit: int = 10  # actions at most on the way to a point near a sub-goal
    wander_share: float = 0.15  # of what is sampled
    visit_share: float = 0.40  # of what is sampled
    exact_share: float = 0.30  # of what follows the optimiser, without noise
    noise: tuple[float, float] = (0.02, 1.0)  # per axis of an action, standard deviation [action limits]
    longest_action: float = 2.0  # with its noise [action limits]
    offset: tuple[float, float] = (0.0005, 0.02)  # of visited positions from a sub-goal [m]
    sub_goals: int = 3  # of those ahead that are visited
    exact_values: float = 0.5  # share of states that are labelled without an error of the estimate
    place_error: float = 0.0005  # of an estimate's lengths, standard deviation [m]
    angle_error: float = 0.01  # of its angles [rad]
    stage_share: float = 0.6  # of episodes that begin at the stage visited the least
    given_share: float = 0.25  # of episodes that begin in a state that was handed in, if any was
    kept: int = 24  # states per stage to begin in
    margin: float = 0.05  # the tip stays this near to the box about start and sub-goals [m]
    below: float = 0.0005  # and goes no deeper than this under the lowest of them [m]

    def __post_init__(self) -> None:
        shares = ("wander_share", "visit_share", "exact_share", "exact_values", "stage_share", "given_share")
        for name in shares:
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InputError(f"{name} is {getattr(self, name)}, must lie within 0..1")
        if self.wander_share + self.visit_share > 1.0:
            raise InputError(
                f"wander_share {self.wander_share} and visit_share {self.visit_share} exceed 1 together"
            )
        for name in ("follow", "wander", "noise", "offset"):
            low, high = getattr(self, name)
            if not 0 < low <= high:
                raise InputError(f"{name} is {(low, high)}, must be two positive numbers, the smaller first")
        if min(self.slots, self.longest, self.visit, self.sub_goals, self.kept) < 1:
            raise InputError("slots, longest, visit, sub_goals and kept must each be at least 1")


@dataclass(frozen=True, eq=False)
class Starts:
    """States at rest to begin in, such as estimates of Real2Sim (Algorithm 1, lines 16 and 17)."""

    values: np.ndarray  # (M, P)
    tip_in_base: np.ndarray  # (M, 3) [m]

    def __post_init__(self) -> None:
        if len(self.values) != len(self.tip_in_base):
            raise InputError(f"{len(self.values)} values and {len(self.tip_in_base)} tips; give one tip each")


@dataclass(frozen=True, eq=False)
class Visited:
    """One labelled state."""

    values: np.ndarray  # (P,)
    tip: np.ndarray  # (3,) in the tool arm's base frame [m]
    label: Label


@dataclass(eq=False)
class _Slot:
    """One copy of the model on its way."""

    lower: np.ndarray  # (3,) of the tip [m]
    upper: np.ndarray  # (3,) [m]
    age: int = 0  # actions since the episode began
    left: int = 0  # actions until something else is sampled
    sigma: float = 0.0  # of the noise [m]
    destination: np.ndarray | None = None  # (3,) to drive to [m]
    drift: np.ndarray | None = None  # (3,) last step of a random walk [m]


@dataclass(eq=False)
class _Stage:
    """A sub-goal: how often it was met, and states in which it is the next one."""

    met: int = 0
    states: list[TaskState] = field(default_factory=list)


class Explorer:
    """Labelled states of one task, as many as are asked for.

    Args:
        dynamics: of the task.
        task: names sub-goals and starts.
        start_tip: (3,) where an episode begins, in the tool arm's base frame [m].
        rng: source of everything random.
        settings: how widely.
        given: other states to begin in.
        starts: samples values (P,) to begin with, instead of the task's own.
    """

    def __init__(
        self,
        dynamics: TaskDynamics,
        task: Task,
        start_tip: np.ndarray,
        rng: np.random.Generator,
        settings: ExploreSettings | None = None,
        given: Starts | None = None,
        starts: Callable[[np.random.Generator], np.ndarray] | None = None,
    ) -> None:
        self._dynamics, self._task, self._start_tip, self._rng = dynamics, task, start_tip, rng
        self._settings = settings or ExploreSettings()
        self._given = given
        self._start_values = starts or task.start_values
        specs = task.parameters()
        self._lower, self._upper = (np.array([getattr(p, n) for p in specs]) for n in ("lower", "upper"))
        s = self._settings
        self._error = np.array([s.angle_error if p.unit == "rad" else s.place_error for p in specs])
        self._stages: dict[str, _Stage] = {}

    def visit(self) -> Iterator[Visited]:
        """Labelled states without end; none is done."""
        begun = [self._begin() for _ in range(self._settings.slots)]
        states, slots = [state for state, _ in begun], [slot for _, slot in begun]
        while True:
            actions = []
            for i in range(len(slots)):
                while not self._usable(states[i], slots[i]):
                    states[i], slots[i] = self._begin()
                values, tip = self._dynamics.read(states[i].q[0].numpy())
                estimated = self._estimated(values, tip)
                label = label_of(self._dynamics, self._task, estimated, tip)
                if label.sub_goal != "none":
                    self._remember(label, states[i])
                    yield Visited(estimated, tip, label)
                actions.append(self._action(slots[i], label, values, tip))
                slots[i].age += 1
            after, solved = moved(self._dynamics, joined(states), np.array(actions))
            states = [rows(after, [i]) for i in range(len(slots))]
            for i in np.flatnonzero(~solved):
                slots[i].age = self._settings.longest  # the episode ends

    def _begin(self) -> tuple[TaskState, _Slot]:
        """An episode's first state, which is usable."""
        s, rng = self._settings, self._rng
        for _ in range(100):
            kind = rng.random()
            if self._given is not None and len(self._given.values) and kind < s.given_share:
                which = int(rng.integers(len(self._given.values)))
                state = self._dynamics.start(self._given.values[which], self._given.tip_in_base[which])
            elif kind > 1.0 - s.stage_share and self._stages:
                stage = min(self._stages.values(), key=lambda one: one.met)
                state = stage.states[int(rng.integers(len(stage.states)))]
            else:
                state = self._dynamics.start(self._start_values(rng), self._start_tip)
            slot = self._box(state)
            if self._usable(state, slot):
                return state, slot
        raise InputError(
            f"none of 100 starts of task {self._task.name} can be used; check the states that are handed in"
        )

    def _box(self, state: TaskState) -> _Slot:
        s = self._settings
        values, tip = self._dynamics.read(state.q[0].numpy())
        goals = self._task.sub_goals(values, tip)
        corners = np.array([self._start_tip, tip, *(goal.tip_position for goal in goals)])
        lower, upper = corners.min(axis=0) - s.margin, corners.max(axis=0) + s.margin
        lower[2] = corners[:, 2].min() - s.below
        return _Slot(lower, upper)

    def _usable(self, state: TaskState, slot: _Slot) -> bool:
        """Something is left to do, and the task's parameters can describe the state."""
        values, tip = self._dynamics.read(state.q[0].numpy())
        inside = bool((values >= self._lower).all() and (values <= self._upper).all())
        return inside and slot.age < self._settings.longest and not self._task.is_done(values, tip)

    def _estimated(self, values: np.ndarray, tip: np.ndarray) -> np.ndarray:
        """The values as an estimate may have them: half of them exact, else with errors of some size."""
        if self._rng.random() < self._settings.exact_values:
            return values
        size = self._rng.uniform(0.0, 2.0)
        estimated = values + size * self._error * self._rng.standard_normal(len(values))
        estimated = np.clip(estimated, self._lower, self._upper)
        return values if self._task.is_done(estimated, tip) else estimated

    def _remember(self, label: Label, state: TaskState) -> None:
        stage = self._stages.setdefault(label.sub_goal, _Stage())
        stage.met += 1
        if len(stage.states) < self._settings.kept:
            stage.states.append(state)
        elif self._rng.random() < self._settings.kept / stage.met:  # all that were met are as likely to stay
            stage.states[int(self._rng.integers(len(stage.states)))] = state

    def _action(self, slot: _Slot, label: Label, values: np.ndarray, tip: np.ndarray) -> np.ndarray:
        """What is done next; the label with noise, or something else."""
        s, limit = self._settings, self._task.action_limit
        if slot.left <= 0:
            self._choose(slot, values, tip)
        slot.left -= 1
        if slot.destination is not None:
            action = slot.destination - tip
            distance = float(np.linalg.norm(action))
            if distance <= limit:
                slot.left = 0
            action *= min(1.0, limit / max(distance, 1e-12))
        elif slot.drift is not None:
            slot.drift = 0.7 * slot.drift + slot.sigma * self._rng.standard_normal(3)
            action = slot.drift
        else:
            action = label.action + slot.sigma * self._rng.standard_normal(3)
        action = action * min(1.0, s.longest_action * limit / max(float(np.linalg.norm(action)), 1e-12))
        return np.clip(tip + action, slot.lower, slot.upper) - tip

    def _choose(self, slot: _Slot, values: np.ndarray, tip: np.ndarray) -> None:
        """What the next actions are."""
        s, rng, limit = self._settings, self._rng, self._task.action_limit
        slot.destination = slot.drift = None
        slot.sigma = limit * self._length(s.noise)
        kind = rng.random()
        goals = self._task.sub_goals(values, tip)[: s.sub_goals]
        if kind < s.wander_share:
            slot.left, slot.drift = int(rng.integers(s.wander[0], s.wander[1] + 1)), np.zeros(3)
        elif kind < s.wander_share + s.visit_share and goals:
            way = rng.standard_normal(3)
            offset = self._length(s.offset) * way / np.linalg.norm(way)
            slot.destination, slot.left = goals[int(rng.integers(len(goals)))].tip_position + offset, s.visit
        else:
            slot.left = int(rng.integers(s.follow[0], s.follow[1] + 1))
            if rng.random() < s.exact_share:
                slot.sigma = 0.0

    def _length(self, between: tuple[float, float]) -> float:
        return float(np.exp(self._rng.uniform(*np.log(between))))
