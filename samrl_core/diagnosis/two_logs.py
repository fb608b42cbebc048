"""A log of the machine beside a log of the user's simulator: where and when they part, without any model.

Both are brought to one clock: the shift at which their commands (or, without commands, their positions)
agree best. A channel of a joint has parted where the difference, averaged over a short window, stays beyond
what noise of both logs and a share of the channel's own range explain. Of what parts first, the largest is
nearest to the cause; the rest follows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.phases import phases_of_motion
from samrl_core.diagnosis.residuals.signals.signal_noise import white_noise
from samrl_core.diagnosis.result import PHASES

RATE_HZ = 200.0  # of the comparison, at most
WINDOW_S = 0.1  # over which a difference is averaged
NOISE = 4.0  # standard deviations of both logs' noise
SHARE = 0.02  # of the channel's range
TOGETHER_S = 0.25  # channels that part within as much part together
MOST_SHIFT_S = 2.0  # between the clocks, searched
SAME_COMMAND = 0.05  # of the command's range: beyond, the two were not asked for the same
FEW = 5  # samples of a phase, which hardly tell its mean
UNITS = {"position": "rad", "velocity": "rad/s", "effort": "N m", "commanded_effort": "N m"}


@dataclass(frozen=True, eq=False)
class PartedChannel:
    """One quantity of one joint in both logs."""

    joint: str
    quantity: str
    time: np.ndarray  # (N,) [s] since the machine's log began
    real: np.ndarray  # (N,)
    simulated: np.ndarray  # (N,)
    limit: float  # of the averaged difference
    rms: float  # of the difference
    relative: float  # rms over the range of the machine's channel
    parts_at: float | None  # first time beyond the limit [s]; None: never
    share: float  # of the time beyond it
    phase: str  # in which most of the excess lies: rest, slow, fast, reversal; empty if never

    @property
    def unit(self) -> str:
        """Of the quantity."""
        return UNITS[self.quantity]


@dataclass(frozen=True, eq=False)
class Parting:
    """All channels, those that part first and most in front, those that never do at the end."""

    channels: tuple[PartedChannel, ...]
    shift_s: float  # that was added to the simulator's clock
    command_error: float | None  # rms of the commands' difference over their range; None without commands
    notes: tuple[str, ...]


def compare_logs(real: ArmRecording, simulated: ArmRecording) -> Parting:
    """Where and when a simulator's log leaves the machine's.

    Raises:
        InputError: other joints, or less than a second in common.
    """
    names = real.arm.joints
    if missing := [j for j in names if j not in simulated.arm.joints]:
        raise InputError(
            f"{simulated.name} has joints {list(simulated.arm.joints)}, it lacks {missing} of {real.name};"
            " log the same joints"
        )
    order = [simulated.arm.joints.index(j) for j in names]
    step = max(1.0 / RATE_HZ, _period(real.states), _period(simulated.states))
    shift, most_shift = _shift(real, simulated, order, step)
    begin = max(real.states.time[0], simulated.states.time[0] + shift)
    end = min(real.states.time[-1], simulated.states.time[-1] + shift)
    if end - begin < 1.0:
        raise InputError(
            f"{real.name} and {simulated.name} have {max(end - begin, 0.0):.2f} s in common after"
            " their clocks are"
            " put together, 1 s is needed; log the same motion"
        )
    grid = np.arange(begin, end, step)
    phases = phases_of_motion(_velocity(real, grid), step)
    channels, notes = [], []
    for quantity in UNITS:
        a, b = _signal(real, quantity), _signal(simulated, quantity)
        if a is None or b is None:
            if (a is None) != (b is None):
                notes.append(f"{quantity} is in one log alone")
            continue
        for j, joint in enumerate(names):
            values = np.interp(grid, a[0], a[1][:, j]), np.interp(grid - shift, b[0], b[1][:, order[j]])
            channels.append(_channel(joint, quantity, grid, *values, phases[:, j]))
    if most_shift is not None:
        notes.append(
            f"the clocks agree nowhere within {most_shift:.2g} s: the logs show other motions, or start"
            " further apart; cut them to the same motion"
        )
    error = _command_error(real, simulated, order, grid, shift)
    if error is not None and error > SAME_COMMAND:
        notes.append(
            f"the two were commanded differently, by {error:.0%} of the command's range: what"
            " follows is no gap"
            " of the model alone"
        )
    first = min((c.parts_at for c in channels if c.parts_at is not None), default=0.0)
    # Coupling is as quick as the cause: of those that part together the largest stands first.
    channels.sort(
        key=lambda c: (c.parts_at is None, ((c.parts_at or 0.0) - first) // TOGETHER_S, -c.relative)
    )
    return Parting(tuple(channels), shift, error, tuple(notes))


def _period(signal: JointSignal) -> float:
    return float(np.median(np.diff(signal.time)))


def _signal(recording: ArmRecording, quantity: str) -> tuple[np.ndarray, np.ndarray] | None:
    source = recording.commanded_effort if quantity == "commanded_effort" else recording.states
    values = None if source is None else getattr(source, quantity.removeprefix("commanded_"))
    return None if source is None or values is None else (source.time, values)


def _velocity(recording: ArmRecording, grid: np.ndarray) -> np.ndarray:
    position = recording.states.position
    assert position is not None
    columns = [np.interp(grid, recording.states.time, column) for column in position.T]
    return np.gradient(np.stack(columns, axis=1), grid, axis=0)


def _shift(
    real: ArmRecording, simulated: ArmRecording, order: Sequence[int], step: float
) -> tuple[float, float | None]:
    """What is added to the simulator's clock so that commands, else positions, agree best.

    Then how far was searched, if the best lies at the end of that: they may agree beyond, or nowhere.
    """
    pairs = [(real.command, simulated.command), (real.states, simulated.states)]
    a, b = next((a, b) for a, b in pairs if a is not None and b is not None and a.position is not None)
    assert a.position is not None
    if b.position is None:
        raise InputError(f"{simulated.name} has no positions to compare; log them")
    start = a.time[0]
    grid = np.arange(start, a.time[-1], step)
    mine = np.stack([np.interp(grid, a.time, x) for x in a.position.T], axis=1)
    # Without its own first stamp: a simulator's clock may begin anywhere.
    offset = float(start - b.time[0])
    best = (np.inf, 0)
    reach = int(min(MOST_SHIFT_S, 0.25 * (grid[-1] - grid[0])) / step)
    for k in range(-reach, reach + 1):
        lag = k * step
        inside = (grid >= b.time[0] + offset + lag) & (grid <= b.time[-1] + offset + lag)
        if np.count_nonzero(inside) < 0.5 * len(grid):
            continue
        at = grid[inside] - offset - lag
        other = np.stack([np.interp(at, b.time, b.position[:, j]) for j in order], axis=1)
        error = float(np.mean((mine[inside] - other) ** 2)) * (1.0 + 1e-3 * abs(lag))
        if error < best[0]:
            best = (error, k)
    # The last lags may have been left out for the little that the logs then have in common.
    at_end = abs(best[1]) > 0.98 * reach
    return offset + best[1] * step, reach * step if at_end else None


def _command_error(
    real: ArmRecording, simulated: ArmRecording, order: Sequence[int], grid: np.ndarray, shift: float
) -> float | None:
    a, b = real.command, simulated.command
    if a is None or b is None or a.position is None or b.position is None:
        return None
    worst = 0.0
    for j, k in enumerate(order):
        mine = np.interp(grid, a.time, a.position[:, j])
        other = np.interp(grid - shift, b.time, b.position[:, k])
        worst = max(worst, float(np.sqrt(np.mean((mine - other) ** 2))) / max(float(np.ptp(mine)), 1e-3))
    return worst


def _channel(
    joint: str, quantity: str, grid: np.ndarray, real: np.ndarray, simulated: np.ndarray, phases: np.ndarray
) -> PartedChannel:
    """One quantity of one joint, both logs (N,) on the machine's regular clock (N,)."""
    step = float(grid[1] - grid[0])
    noise = float(
        np.hypot(white_noise(real[:, None], 1 / step)[0], white_noise(simulated[:, None], 1 / step)[0])
    )
    size = max(1, round(WINDOW_S / step))
    window = np.ones(size) / size
    difference = real - simulated
    averaged = np.sqrt(np.convolve(difference**2, window, mode="same"))
    span = float(np.ptp(real))
    limit = NOISE * float(noise) + SHARE * span
    beyond = averaged > limit
    phase, first = "", None
    if beyond.any():
        first = float(grid[int(np.argmax(beyond))])
        phase = _phase(phases, averaged**2 * beyond)
    rms = float(np.sqrt(np.mean(difference**2)))
    return PartedChannel(
        joint, quantity, grid, real, simulated, limit, rms, rms / max(span, 1e-12), first,
        float(np.mean(beyond)), phase,
    )  # fmt: skip


def _phase(phases: np.ndarray, excess: np.ndarray) -> str:
    """The phase of motion (N,) with the highest mean excess; few samples count where there are no others."""
    samples = {name: excess[phases == k] for k, name in enumerate(PHASES)}
    most = max(map(len, samples.values()))
    means = {name: np.mean(part) for name, part in samples.items() if len(part) > min(FEW, most - 1)}
    return max(means, key=lambda name: means[name])
