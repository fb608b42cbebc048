"""The same work everywhere: results and failures come back from processes, threads and Ray."""

from __future__ import annotations

import os
import signal
import statistics
import sys
import types
from functools import partial

import pytest

from samrl_core.common import executor
from samrl_core.common.errors import InputError, SolveError


def double(x: int) -> int:
    if x == 3:
        raise InputError("three")
    return 2 * x


@pytest.mark.parametrize("mapping", [executor.run_in_threads, executor.run_in_processes])
def test_one_failure_does_not_stop_the_others(mapping: object) -> None:
    ends = list(mapping(double, [1, 2, 3], 2))  # ty: ignore[not-callable]
    assert {d.item: d.result for d in ends if d.error is None} == {1: 2, 2: 4}
    assert [str(d.error) for d in ends if d.error is not None] == ["three"]


def test_ray_without_ray_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(InputError, match="pip install 'ray"):
        list(executor.run_on_ray(double, [1], 1))


def test_ray_results_and_failures_come_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against a stand-in with Ray's calls: submission, waiting, and errors raised by `get`."""

    class RayError(Exception):
        pass

    class Task:
        def __init__(self, work: object) -> None:
            self.work = work

        def remote(self, item: int) -> tuple[object, int]:
            return (self.work, item)

    def get(reference: tuple[object, int]) -> object:
        try:
            return reference[0](reference[1])  # ty: ignore[not-callable]
        except InputError as error:
            raise RayError(str(error)) from error

    fake = types.SimpleNamespace(
        init=lambda **options: None,
        remote=lambda **options: Task,
        wait=lambda references, num_returns: (references[:num_returns], references[num_returns:]),
        get=get,
        exceptions=types.SimpleNamespace(RayError=RayError),
    )
    monkeypatch.setitem(sys.modules, "ray", fake)
    ends = list(executor.run_on_ray(double, [1, 2, 3], 2))
    assert {d.item: d.result for d in ends if d.error is None} == {1: 2, 2: 4}
    assert [str(d.error) for d in ends if d.error is not None] == ["three"]


def test_a_local_ray_gives_results_and_failures() -> None:
    ray = pytest.importorskip("ray", reason="needs the extra `cluster`")
    ray.init(num_cpus=1, include_dashboard=False, log_to_driver=False)
    try:
        ends = list(executor.run_on_ray(statistics.mean, [[1.0, 2.0], [], [4.0]], 1))
    finally:
        ray.shutdown()
    assert {d.index: d.result for d in ends if d.error is None} == {0: 1.5, 2: 4.0}
    assert ["at least one" in str(d.error) for d in ends if d.error is not None] == [True]


@pytest.mark.parametrize("workers", [1, 2])
def test_calls_end_with_the_first_error(workers: int) -> None:
    calls = [partial(double, x) for x in (1, 2)]
    assert {d.index: d.result for d in executor.run_calls(calls, workers)} == {0: 2, 1: 4}
    with pytest.raises(InputError, match="three"):
        list(executor.run_calls([*calls, partial(double, 3)], workers))


def test_a_worker_that_is_killed_is_named_with_the_remedy() -> None:
    calls = [partial(os.kill, 0, 0), partial(_end_this_process)]
    with pytest.raises(SolveError, match="one of 2 worker processes was ended.*ask for fewer workers"):
        list(executor.run_calls(calls, 2))


def _end_this_process() -> None:
    os.kill(os.getpid(), signal.SIGKILL)
