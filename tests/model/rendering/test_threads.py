"""Sharing work out: every item once, failures come back."""

from __future__ import annotations

import threading

import pytest

from samrl_core.model.rendering.threads import in_threads, shares
from tests.waiting import PATIENCE_S


def test_shares_cover_all_once() -> None:
    for count in (1, 2, 5, 16):
        for workers in (1, 2, 3, 40):
            items = [k for part in shares(count, workers) for k in range(count)[part]]
            assert items == list(range(count))
            assert len(shares(count, workers)) == min(count, workers)


def test_parts_run_at_the_same_time() -> None:
    meet = threading.Barrier(3, timeout=PATIENCE_S)
    in_threads(lambda part: meet.wait() and None, shares(3, 3))


def test_a_failure_is_raised_again_after_all_have_ended() -> None:
    done = []

    def work(part: slice) -> None:
        if part.start == 1:
            raise ValueError("part 1")
        done.append(part.start)

    with pytest.raises(ValueError, match="part 1"):
        in_threads(work, shares(3, 3))
    assert sorted(done) == [0, 2]
