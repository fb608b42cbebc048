"""Effects by which what is commanded acts later, and their forms by what passes through them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.diagnosis.effects.drive.packet_age import detail_share, detail_support
from samrl_core.diagnosis.effects.effect import Effect, lacks_law
from samrl_core.diagnosis.effects.form import PresentForm, Shape
from samrl_core.diagnosis.residuals.basis_functions import low_passed, resonant
from samrl_core.diagnosis.residuals.equations import LATEST_IN_LAW_S, Columns
from samrl_core.diagnosis.residuals.trial import Trial, add

CUTOFFS = (8.0, 16.0, 24.0, 32.0, 48.0, 64.0, 96.0)  # [Hz] of filters that detail is compared with
ACTS = 0.5  # of the detail of a torque that was sent, that must come out if it is more than the log's noise
DELAYS = np.arange(0.0, 25.1, 0.5)  # [samples] likewise of delays
LAW_DELAYS_S = np.arange(0.0, LATEST_IN_LAW_S, 0.001)  # of a command: a valley is as wide as a tick or two


class LateResponse(Effect):
    """What is commanded acts later: the command before the controller, or the torque before the drive."""

    acts_on = "command"

    def acts_on_arm(self, trial: Trial) -> bool:
        """Each joint, or all of them alike."""
        return trial.joints > 1

    def why_unobservable(self, trial: Trial) -> str | None:
        """Needs what was asked for and what came of it, fast enough."""
        if trial.motion.command is None and trial.motion.u is None:
            return "needs the command or the commanded effort"
        if not trial.motion.dynamic and trial.motion.rate < 20.0:
            return f"sampled at {trial.motion.rate:.0f} Hz, timing needs 20 Hz"
        if set(trial.channels) <= {"link", "dynamics"} and not trial.shows_controller:
            return lacks_law(trial, "needs the command, or both commanded and measured effort")
        return None


def late_sides(trial: Trial) -> tuple[str, ...]:
    """Streams that may be late, as far as the channels show it: command, effort."""
    shown = ((trial.shows_controller, "command"), ("drive" in trial.channels, "effort"))
    return tuple(side for seen, side in shown if seen)


@dataclass(frozen=True, eq=False, kw_only=True)
class LateForm(PresentForm):
    """A filter or delay that a stream passes through."""

    amplitudes: tuple[str, ...] = ("present",)
    side: str  # stream: command, effort, or tracking of servos that only log where they are

    @abstractmethod
    def late(self, trial: Trial, x: np.ndarray, shape: Shape) -> np.ndarray:
        """A full-rate signal (F, J) as it arrives."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        """What is missing while the signal is on its way."""
        motion, command = trial.motion, trial.motion.command
        joints = self.place.joints
        if self.side == "effort":
            sent = acting_torque(trial)
            lost = sent - self.late(trial, sent, shape)
            return add(*(trial.drive(j, lost[:, [j]].T) for j in joints))
        if command is None or command.position is None:
            return {}
        late = self.late_command(trial, command, shape)
        if self.side == "tracking":
            assert late.position is not None
            lost = command.position - late.position
            return add(*(trial.tracking(j, motion.reduce(lost[:, [j]]).T) for j in joints))
        lost = motion.law_change(late)
        return add(*(trial.controller(j, lost[:, [j]].T) for j in joints))

    def late_command(self, trial: Trial, command: JointSignal, shape: Shape) -> JointSignal:
        """A command on the full-rate grid (F, J) as it arrives."""
        parts = (command.position, command.velocity, command.effort)
        position, velocity, effort = (None if x is None else self.late(trial, x, shape) for x in parts)
        return JointSignal(command.time, position, velocity, None, effort)

    def cost(self, trials: Sequence[Trial], shape: Shape) -> float:
        """What the best response loses of the torque's detail above the compared band, where noise passes.

        There a delay leaves everything as it was and a filter takes it away: within the band both look alike.
        """
        if self.side != "effort":
            return 0.0
        lacks = 0.0
        for trial in trials:
            joints = list(self.place.joints)
            mine = np.sum(self._support(trial, shape)[joints])
            lacks += max(0.0, max(float(np.sum(x[joints])) for x in _supports(trial)) - float(mine))
        return lacks

    def _support(self, trial: Trial, shape: Shape) -> np.ndarray:
        key = (type(self).__name__, repr(sorted(shape.items())))
        if key not in trial.cached:
            assert trial.motion.raw_commanded is not None
            trial.cached[key] = detail_support(trial, self.late(trial, trial.motion.raw_commanded, shape))
        return trial.cached[key]


def clearest_delay(trial: Trial, joints: Sequence[int]) -> float:
    """The delay [s] that explains most of the torque's detail, to half a sample."""
    supports = [float(np.sum(x[list(joints)])) for x in _supports(trial)[: len(DELAYS)]]
    return float(DELAYS[int(np.argmax(supports))]) / trial.motion.rate


def clearest_delay_of_law(trial: Trial, joints: Sequence[int]) -> float:
    """The delay [s] of its command at which a law that is cut by its limit leaves least; zero of any other.

    A stiff loop that is told the right goal 20 ms early asks for four times what its drive gives. What is cut
    tells nothing, and half a delay twice as long is a valley of its own.
    """
    motion, key = trial.motion, ("left", "command")
    told = motion.recorded_command
    if told is None or motion.asked is None or motion.computed:
        return 0.0
    if key not in trial.cached:
        cut = bool(np.any(np.abs(motion.described_law.total) > motion.limit()))
        left = [motion.left_by_law(told, late) for late in LAW_DELAYS_S] if cut else []
        # Less its mean: nobody knows what an integral held when the recording began.
        power = [np.var(each, axis=0) for each in left if each is not None]
        trial.cached[key] = np.array(power).reshape(-1, trial.joints)
    scaled = trial.cached[key][:, list(joints)] / np.maximum(trial.scale[list(joints)], 1e-12) ** 2
    return float(LAW_DELAYS_S[int(np.argmin(np.sum(scaled, axis=1)))]) if len(scaled) else 0.0


def acting_torque(trial: Trial) -> np.ndarray:
    """Torque (F, J) sent to the drives, without its noise where none of that comes out of them.

    Such noise is the log's own. It is in the drive's residual too, so that whatever takes it off the torque
    that was sent, a filter or a delay, would explain it (errors in variables).
    """
    key = ("acting", "effort")
    if key not in trial.cached:
        motion = trial.motion
        assert motion.raw_commanded is not None
        best = np.argmax(_supports(trial)[: len(DELAYS)], axis=0)
        share = np.zeros(trial.joints)
        for k in np.unique(best):
            passed = detail_share(trial, motion.delayed(motion.raw_commanded, DELAYS[k] / motion.rate))
            share = np.where(best == k, passed, share)
        trial.cached[key] = np.where(share > ACTS, motion.raw_commanded, motion.sure_torque)
    return trial.cached[key]


def _supports(trial: Trial) -> list[np.ndarray]:
    """What pure delays and filters of a few sizes explain of the torque's detail, (J,) [nat] each."""
    key = ("supports", "effort")
    if key not in trial.cached:
        motion, u = trial.motion, trial.motion.raw_commanded
        assert u is not None
        late = [motion.delayed(u, d / motion.rate) for d in DELAYS]
        late += [low_passed(u, f, motion.rate) for f in CUTOFFS]
        late += [resonant(u, f, np.sqrt(0.5), 1.0 / motion.rate) for f in CUTOFFS]
        trial.cached[key] = [detail_support(trial, x) for x in late]
    return trial.cached[key]
