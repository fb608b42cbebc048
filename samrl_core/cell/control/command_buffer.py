"""The curve through accepted commands."""

from __future__ import annotations

from collections import deque

import numpy as np

from samrl_core.cell.types.observation import ArmCommand


class CommandCurve:
    """Cubic Hermite curve through positions and velocities of commands, in order of their validity.

    Acceleration and feed-forward torque change linearly in between. Before the first command the curve
    runs into it at its velocity; after the last there is none.
    """

    def __init__(self) -> None:
        self._knots: deque[ArmCommand] = deque()
        self._segment = np.zeros((8, 0))  # fields of the two knots around the present time
        self._stale = True

    def __len__(self) -> int:
        return len(self._knots)

    @property
    def last(self) -> ArmCommand:
        """The newest command."""
        return self._knots[-1]

    def clear(self) -> None:
        """Forget all commands."""
        self._knots.clear()
        self._stale = True

    def append(self, command: ArmCommand) -> None:
        """Add a command, later than all others."""
        self._knots.append(command)
        self._stale = self._stale or len(self._knots) <= 2

    def at(self, now_ns: int) -> ArmCommand:
        """The curve at a time not after the last command; commands no longer needed are dropped."""
        knots = self._knots
        while len(knots) > 1 and knots[1].stamp_ns <= now_ns:
            knots.popleft()
            self._stale = True
        a = knots[0]
        if now_ns == a.stamp_ns:
            return a
        if now_ns < a.stamp_ns:
            early = (now_ns - a.stamp_ns) * 1e-9
            zeros = np.zeros_like(a.position)
            return ArmCommand(now_ns, a.position + early * a.velocity, a.velocity, zeros, zeros)
        b = knots[1]
        if self._stale:
            self._segment = np.stack(
                [a.position, a.velocity, b.position, b.velocity]
                + [a.acceleration, b.acceleration, a.effort, b.effort]
            )
            self._stale = False
        h = (b.stamp_ns - a.stamp_ns) * 1e-9
        s = (now_ns - a.stamp_ns) / (b.stamp_ns - a.stamp_ns)
        r = 1.0 - s
        weights = np.array(
            [
                [r * r * (1 + 2 * s), s * r * r * h, s * s * (3 - 2 * s), -s * s * r * h, 0, 0, 0, 0],
                [-6 * s * r / h, r * (1 - 3 * s), 6 * s * r / h, s * (3 * s - 2), 0, 0, 0, 0],
                [0, 0, 0, 0, r, s, 0, 0],
                [0, 0, 0, 0, 0, 0, r, s],
            ]
        )
        position, velocity, acceleration, effort = weights @ self._segment
        return ArmCommand(now_ns, position, velocity, acceleration, effort)
