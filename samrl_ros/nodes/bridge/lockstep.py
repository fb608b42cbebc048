"""Simulated time stands still while commands are late, as long as there is somebody to wait for."""

from __future__ import annotations

LOOK_S = 0.02  # of wall time between two looks that counts at most: more, and this process did not run


class Lockstep:
    """Patience with a late commander, in time that this process really had.

    A busy machine delays bridge and commander alike; a commander that is dead or hangs costs the patience
    once, until its next command.
    """

    def __init__(self, patience_s: float) -> None:
        self._patience_s = patience_s
        self._looked_s = -1.0
        self._waited_s = 0.0
        self._taken = -1

    def waits(self, short: bool, taken: int, now_s: float) -> bool:
        """Whether time should stand still now.

        Args:
            short: an arm's next commands are due and not there, and somebody is there to send them.
            taken: commands taken so far.
            now_s: steady clock [s].
        """
        if taken != self._taken:
            self._taken, self._waited_s = taken, 0.0
        if not short:
            self._looked_s = -1.0
            return False
        if self._looked_s >= 0.0:
            self._waited_s += min(now_s - self._looked_s, LOOK_S)
        self._looked_s = now_s
        return self._waited_s < self._patience_s
