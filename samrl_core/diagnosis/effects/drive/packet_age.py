"""How old the packet is that a drive acts on, sample by sample: a hidden Markov chain over its age.

What is done follows what was sent some samples ago: y(t) = g x(t - age(t)) + slow + noise. Everything slow is
taken out, so the ages are learnt from detail above `DETAIL_HZ` only, while the evidence compares below it:
when something was late is then a prediction that the compared band confirms or not, and costs no freedom.
Ages, noise and the chain's own probabilities by expectation maximisation (Rabiner 1989, IEEE Proc. 77).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import signal

from samrl_core.diagnosis.effects.drive.age_chain import AgeChain, forward_backward
from samrl_core.diagnosis.effects.form import Place
from samrl_core.diagnosis.residuals.motion import BAND_HZ
from samrl_core.diagnosis.residuals.trial import Trial

DETAIL_HZ = 1.6 * BAND_HZ  # what is slower is taken out
OLDEST_S = 0.025  # the catalogue knows of holds up to 20 ms and of delays up to 25 ms
ROUNDS = 6  # of expectation maximisation
FUTILE = 3.0  # [nat] improvement below which further rounds are not worth their time
AGED = 10.0  # [nat] from which on a constant age is believed rather than none
OUTLIER = 12.0  # [nat] most that one joint's sample may speak against an age: friction turns, contacts click
SHARPEST = 0.02  # of the stream's rms step: logs without noise must not be decided by rounding

HELD, WANDERING = "held", "wandering"


@dataclass(frozen=True, eq=False)
class Age:
    """Age of the packets of one joint, or of an arm's joints together."""

    posterior: np.ndarray  # (F, ages) probability of each age in samples
    log_evidence: float  # [nat] above `DETAIL_HZ` against packets of the usual age
    rate: float  # [Hz]

    @property
    def late(self) -> float:
        """Share of samples in which an old packet is acted on."""
        return 1.0 - float(np.mean(self.posterior[:, 0]))

    @property
    def mean_s(self) -> float:
        """Mean age [s]."""
        return float(np.mean(self.posterior @ np.arange(self.posterior.shape[1]))) / self.rate

    def reaches(self) -> np.ndarray:
        """Probability (ages,) that an age occurs at all."""
        return 1.0 - np.exp(np.sum(np.log1p(-np.minimum(self.posterior, 0.9999)), axis=0))

    def longest(self, least: float) -> int:
        """Oldest age [samples] that occurs with more than a probability."""
        return int(np.max(np.flatnonzero(self.reaches() > least), initial=0))

    @property
    def bursts(self) -> float:
        """Expected number of times that fresh packets cease to arrive."""
        return float(np.sum(np.clip(np.diff(1.0 - self.posterior[:, 0]), 0.0, None)))

    def lost(self, trial: Trial, side: str, joint: int) -> np.ndarray:
        """Expected torque (F,) [N m] missing at a joint: what was sent less the packet acted on."""
        x = _sent(trial, side)[:, joint]
        return x - np.einsum("fa,fa->f", self.posterior, _by_age(x, self.posterior.shape[1]))


def ages(trial: Trial, side: str, clock: str) -> tuple[Age, ...]:
    """Of each joint alone, then of all joints together; found once per recording."""
    key = (clock, side)
    if key not in trial.cached:
        trial.cached[key] = _find(trial, side, clock)
    return trial.cached[key]


def usual_age(trial: Trial, place: Place, side: str) -> int:
    """The constant age [samples] that explains a place's detail best; 0 where none does clearly."""
    key = ("usual", side)
    if key not in trial.cached:
        sent, done = _sent(trial, side), _done(trial, side)
        trial.cached[key] = _usual_ages(
            [_by_age(x, _oldest(trial)) for x in sent.T], done, _slow_filter(trial.motion.rate)
        )
    return int(trial.cached[key][place.index])


def detail_support(trial: Trial, late: np.ndarray) -> np.ndarray:
    """[nat] by which an effort (F, J) as it arrives explains the detail of each joint's torque, (J,)."""
    done, fast = _details(trial, late)
    along = np.clip(np.sum(done * fast, axis=0), 0.0, None) ** 2 / np.maximum(np.sum(fast**2, axis=0), 1e-12)
    left = 1.0 - along / np.maximum(np.sum(done**2, axis=0), 1e-12)
    return -0.5 * len(fast) * np.log(np.maximum(left, 1e-6))


def detail_share(trial: Trial, late: np.ndarray) -> np.ndarray:
    """Share (J,) of an effort's (F, J) detail that is in each joint's torque, by regression."""
    done, fast = _details(trial, late)
    return np.sum(done * fast, axis=0) / np.maximum(np.sum(fast**2, axis=0), 1e-300)


def _details(trial: Trial, late: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Detail (F, J) of each joint's torque and of an effort as it arrives."""
    low = _slow_filter(trial.motion.rate)
    if ("detail", "effort") not in trial.cached:
        done = _done(trial, "effort")
        trial.cached["detail", "effort"] = done - signal.sosfiltfilt(low, done, axis=0)
    return trial.cached["detail", "effort"], late - signal.sosfiltfilt(low, late, axis=0)


def _sent(trial: Trial, side: str) -> np.ndarray:
    """Stream (F, J) [N m] as sent: effort to the drives, or what the controller makes of its command."""
    motion = trial.motion
    if side == "effort":
        assert motion.raw_commanded is not None
        return motion.raw_commanded
    command, controller = motion.command, trial.recording.arm.controller
    assert command is not None and controller is not None
    assert command.position is not None and command.velocity is not None and command.effort is not None
    return controller.stiffness * command.position + controller.damping * command.velocity + command.effort


def _done(trial: Trial, side: str) -> np.ndarray:
    """What was made of it (F, J) [N m]."""
    motion, law = trial.motion, trial.equations.law
    if side == "effort":
        # The rotor's share is left to the gain: measured accelerations are too noisy at these frequencies.
        assert motion.raw_effort is not None
        return motion.raw_effort
    assert law is not None and motion.asked is not None
    return _sent(trial, side) + motion.asked - law


def _oldest(trial: Trial) -> int:
    """Number of ages."""
    return max(3, int(np.ceil(OLDEST_S * trial.motion.rate))) + 1


def _slow_filter(rate: float) -> np.ndarray:
    return np.asarray(signal.butter(2, min(DETAIL_HZ, rate / 5.0), fs=rate, output="sos"))


def _by_age(x: np.ndarray, ages: int) -> np.ndarray:
    """(F, ages) x(t - age); the start is held."""
    padded = np.concatenate([np.full(ages - 1, x[0]), x])
    return np.lib.stride_tricks.sliding_window_view(padded, ages)[:, ::-1]


def _find(trial: Trial, side: str, clock: str) -> tuple[Age, ...]:
    sent, done = _sent(trial, side), _done(trial, side)
    rate, joints, oldest = trial.motion.rate, sent.shape[1], _oldest(trial)
    chain = AgeChain.held(joints + 1, oldest) if clock == HELD else AgeChain.wandering(joints + 1, oldest)
    low = _slow_filter(rate)
    sharpest = SHARPEST * np.sqrt(np.mean(np.diff(sent, axis=0) ** 2, axis=0)) + 1e-9
    old = [_by_age(sent[:, j], oldest) for j in range(joints)]
    # Each joint by its own posterior, then once more by the arm's.
    usual = np.zeros(joints + 1, dtype=int) if clock == HELD else _usual_ages(old, done, low)
    alone = [old[j][:, usual[j]] for j in range(joints)]
    acted = np.stack(alone + [old[j][:, usual[-1]] for j in range(joints)], axis=1)
    spread = np.zeros_like(acted)  # variance of the packet acted on
    done, sharpest = np.tile(done, 2), np.tile(sharpest, 2)
    gain = np.ones(2 * joints)
    posterior = np.zeros(0)
    better = np.zeros(joints + 1)
    for turn in range(ROUNDS):
        slow = signal.sosfiltfilt(low, done - gain * acted, axis=0)
        detail = done - slow
        noise = np.sqrt(np.mean((detail - gain * acted) ** 2 + gain**2 * spread, axis=0)) + sharpest
        logs = np.empty((joints + 1, len(sent), oldest))
        logs[-1] = 0.0
        for i in range(2 * joints):
            error = 0.5 * ((detail[:, [i]] - gain[i] * old[i % joints]) / noise[i]) ** 2
            np.minimum(error, np.min(error, axis=1, keepdims=True) + OUTLIER, out=error)
            if i < joints:
                logs[i] = -error
            else:
                logs[-1] -= error
        posterior, total, chain = forward_backward(logs, chain)
        better, before = total - [float(np.sum(x[:, a])) for x, a in zip(logs, usual, strict=True)], better
        if turn and (np.all(better < FUTILE) or np.all(better < before + np.maximum(1.0, 0.01 * before))):
            break
        for i in range(2 * joints):
            p, x = posterior[min(i, joints)], old[i % joints]
            acted[:, i] = np.einsum("fa,fa->f", p, x)
            spread[:, i] = np.einsum("fa,fa->f", p, x**2) - acted[:, i] ** 2
        fast = acted - signal.sosfiltfilt(low, acted, axis=0)
        power = np.sum(fast**2 + spread, axis=0)
        gain = np.clip(np.sum(fast * (done - slow), axis=0) / np.maximum(power, 1e-12), 0.0, 1.5)
    kept = np.asarray(posterior, dtype=np.float32)
    return tuple(Age(kept[i], float(better[i]), rate) for i in range(joints + 1))


def _usual_ages(old: Sequence[np.ndarray], done: np.ndarray, low: np.ndarray) -> np.ndarray:
    """The constant age (J + 1,) that explains the detail of each joint best, and of all together."""
    logs = []
    for j, x in enumerate(old):
        fast, aged = (y - signal.sosfiltfilt(low, y, axis=0) for y in (done[:, j], x))
        along = np.clip(fast @ aged, 0.0, None) ** 2 / np.maximum(np.sum(aged**2, axis=0), 1e-12)
        left = 1.0 - along / max(float(fast @ fast), 1e-12)
        logs.append(-0.5 * len(fast) * np.log(np.maximum(left, 1e-6)))
    logs.append(np.sum(logs, axis=0))
    return np.array([int(np.argmax(x)) if np.max(x) > x[0] + AGED else 0 for x in logs])
