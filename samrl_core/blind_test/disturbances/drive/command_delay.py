"""18. Delay of the command or of the effort.

T0: constant. T1: a queue whose delay wanders and jumps about its mean.
"""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.disturbances.drive.command_path import Queue, delayed, map_command
from samrl_core.blind_test.engines.hooks import Hooks


def _jittered(mean: float, count: int, period: float, rng: np.random.Generator) -> np.ndarray:
    """Delays (count,): a slow wander of 15 % and a new extra each 10 ms; data never overtake data."""
    slow = np.interp(
        np.arange(count), np.arange(0, count + 500, 500), rng.normal(size=len(range(0, count + 500, 500)))
    )
    extra = np.repeat(rng.exponential(0.25, size=count // 10 + 1), 10)[:count]
    delay = mean * np.clip(0.75 + 0.15 * slow + extra, 0.2, 2.0)
    sent = np.maximum.accumulate(np.arange(count) * period - delay)
    return np.arange(count) * period - sent


def _make(site: Site, form: str, severity: float) -> Injection:
    on_command = bool(site.rng.random() < 0.5)
    # Up to 25 ms of command (PACE's bound), up to 10 ms within the loop, where more would be unstable.
    mean = quantile(severity, 0.001, 0.025 if on_command else 0.008)
    joints = list(range(site.joints)) if site.joint < 0 else [site.joint]
    period = site.spec.controller.period_s

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        count = 40_000
        table = np.full(count, mean) if form == "T0" else _jittered(mean, count, period, rng)
        if on_command:
            hooks.command.append(
                lambda command: map_command(
                    command, joints, lambda v: delayed(v, command.time, table[: len(command.time)])
                )
            )
        else:
            hooks.drive.append(Queue(lambda t: float(table[round(t / period) % count]), joints, period))

    where = Quantity("command" if on_command else "effort", "channel")
    return Injection({"T": Quantity(mean, "s"), "acts_on": where}, attach)


DISTURBANCE = Disturbance("command_delay", "joint", _make, shows_in="either", also_arm=True)
