"""What hosts the simulated world, apart from a graph."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from samrl_core.common.errors import SamrlError


@pytest.fixture
def stuck(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A bridge whose world takes longer for a step than anybody waits."""
    from samrl_ros.nodes.bridge import sim_bridge

    monkeypatch.setattr(sim_bridge, "HALT_S", 0.02)
    free = threading.Event()
    bridge = sim_bridge.SimBridge.__new__(sim_bridge.SimBridge)
    bridge._stop, bridge._thread = threading.Event(), threading.Thread(target=free.wait, daemon=True)
    bridge._thread.start()
    yield bridge
    free.set()
    bridge._thread.join()


def test_a_world_that_is_still_stepped_is_not_destroyed(stuck: Any) -> None:
    """Its client would be closed under a step: the process dies of that, and its bag's end with it."""
    for end in (stuck.halt, stuck.tear_down, lambda: stuck.set_up(None)):
        with pytest.raises(SamrlError, match="still being stepped"):
            end()
    assert stuck._stop.is_set() and stuck._thread.is_alive()
