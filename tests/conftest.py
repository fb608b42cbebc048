"""Every test process has a ROS domain of its own, on loopback, without shared-memory leftovers.

Numerical libraries get one thread, as in the cell's own processes (`samrl_ros.hosting.threads`): set here,
before any test module imports torch. Threads that wait for each other at every small image are 20 times
slower on a busy machine.
"""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import filelock
import pytest

if TYPE_CHECKING:
    from samrl_core.model.model import Model

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

LAST_DOMAIN = 101  # above it, DDS ports meet Linux's ephemeral ports


def _lock_domain() -> tuple[int, filelock.BaseFileLock]:
    folder = Path(tempfile.gettempdir()) / f"samrl_ros_domains_{os.getuid()}"
    folder.mkdir(exist_ok=True)
    for domain in range(1, LAST_DOMAIN + 1):
        lock = filelock.FileLock(folder / str(domain), timeout=0)
        try:
            lock.acquire()
        except filelock.Timeout:
            continue
        return domain, lock
    raise RuntimeError(f"all {LAST_DOMAIN} ROS domains are taken by other test runs (locks in {folder})")


@pytest.fixture(scope="session", autouse=True)
def ros_domain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """The domain of this test process; child processes inherit it through the environment."""
    domain, lock = _lock_domain()
    values = {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",  # a killed process leaves shared memory behind
        "ROS_LOG_DIR": str(tmp_path_factory.mktemp("ros_log")),
    }
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    yield domain
    for name, value in before.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value
    lock.release()


@pytest.fixture(scope="session")
def model() -> Model:
    """The model of peg insertion in the default cell: one for all tests of a run."""
    from samrl_core.cell.robots.cells import cell_named
    from samrl_core.cell.tasks import task_named
    from samrl_core.model.model import Model

    return Model(task_named("peg_insertion"), cell_named())


@pytest.fixture
def hangup() -> Iterator[None]:
    """SIGHUP acts as by default; under `nohup` it is ignored, by children too, which would wait for ever."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)
