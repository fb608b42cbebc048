"""A Ray cluster of two nodes forges and diagnoses as processes do, also where a node dies in the middle."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow

WORLDS = ("--seed", "5", "--single", "5", "--none", "1", "--outside", "0", "--double", "0", "--duration", "6")


def samrl(*arguments: str, **environment: str) -> subprocess.Popen[bytes]:
    """The command line in a process of its own."""
    command = [sys.executable, "-m", "samrl_ros.cli.main", *arguments]
    return subprocess.Popen(command, env={**os.environ, **environment})


def run(*arguments: str, **environment: str) -> None:
    """A command that must succeed."""
    assert samrl(*arguments, **environment).wait(timeout=900) == 0, arguments


def contents(study: Path) -> dict[str, bytes]:
    """All logs, models and mappings of a study; what they are labelled with shows in the scores."""
    files = study.glob("obs/*/*")
    return {str(file.relative_to(study)): file.read_bytes() for file in files}


def scores(study: Path) -> dict[str, Any]:
    """All scores but times."""
    run("forge", "score", str(study))
    found = json.loads((study / "score.json").read_text())
    return {kind: without_times(found[kind]) for kind in ("scores", "worlds")}


def without_times(value: Any) -> Any:
    """The same without how long things took."""
    if isinstance(value, dict):
        return {k: without_times(v) for k, v in value.items() if "time" not in k and "seconds" not in k}
    return [without_times(v) for v in value] if isinstance(value, list) else value


def test_a_node_that_dies_loses_nothing(tmp_path: Path) -> None:
    pytest.importorskip("ray", reason="needs the extra `cluster`")
    from ray.cluster_utils import Cluster

    here, there = tmp_path / "processes", tmp_path / "cluster"
    run("forge", "servos", "--out", str(here), *WORLDS)
    run("forge", "diagnose", str(here))

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        second = cluster.add_node(num_cpus=1)
        cluster.wait_for_nodes()
        run("forge", "servos", "--out", str(there), *WORLDS, "--ray", RAY_ADDRESS=cluster.address)
        diagnosing = samrl("forge", "diagnose", str(there), "--ray", RAY_ADDRESS=cluster.address)
        while not list(there.glob("diagnosis/*/report.json")):
            assert diagnosing.poll() is None, "ended before the first diagnosis was there"
            time.sleep(0.2)
        cluster.remove_node(second, allow_graceful=False)
        assert diagnosing.wait(timeout=900) == 0
    finally:
        cluster.shutdown()

    assert contents(there) == contents(here)
    assert scores(there) == scores(here)
