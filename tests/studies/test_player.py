"""Episodes that are played for trainings end where they are told to, not with the last one asked for."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from samrl_core.studies.paper import residual_trainings
from samrl_core.studies.paper.residual_trainings import Player, Stopped

MANY = 300  # a minute of episodes


@pytest.mark.parametrize("pooled", [True, False])
def test_a_player_that_is_told_to_stop_plays_no_further_episode(
    pooled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An interrupt waited for twenty episodes of an evaluation."""
    begun: list[Any] = []

    def play(order: Any) -> Any:
        begun.append(order)
        time.sleep(0.2)
        return order

    monkeypatch.setattr(residual_trainings, "play", play)
    with ThreadPoolExecutor(1) as starter, ThreadPoolExecutor(2) as pool:
        player = Player(pool, starter) if pooled else Player()
        orders: Any = list(range(4))
        assert player(orders) == orders
        threading.Timer(0.5, player.stop.set).start()
        with pytest.raises(Stopped):
            player(list(range(MANY)))
        time.sleep(0.5)  # those that had begun
        count = len(begun)
        time.sleep(0.5)
        assert count < 40 and len(begun) == count


def test_the_first_error_is_told_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    released, ended = threading.Event(), []

    def play(order: Any) -> Any:
        if order:
            raise RuntimeError("it broke")
        released.wait(60.0)
        ended.append(order)

    monkeypatch.setattr(residual_trainings, "play", play)
    with ThreadPoolExecutor(1) as starter, ThreadPoolExecutor(2) as pool:
        orders: Any = [False, True]
        try:
            with pytest.raises(RuntimeError, match="it broke"):
                Player(pool, starter)(orders)
            assert not ended
        finally:
            released.set()
