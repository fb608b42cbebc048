"""Tests wait for a condition, never for a clock: a busy machine is slow, not wrong."""

from __future__ import annotations

import time
from collections.abc import Callable

PATIENCE_S = 600.0  # after which a condition counts as never coming; an idle machine needs a second or two


def wait_for(condition: Callable[[], object], what: str, period_s: float = 0.02) -> None:
    """Return once the condition holds.

    Args:
        condition: asked again and again.
        what: words for the failure.
        period_s: pause between two questions [s].
    """
    until = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < until, f"waited {PATIENCE_S:.0f} s in vain: {what}"
        time.sleep(period_s)
