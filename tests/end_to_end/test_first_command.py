"""What a newcomer runs first, on a CPU and without a network: the closed loop with the package's networks in
the model's own cell, and what `make cell` runs, a peg led by touch in a cell that differs.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from samrl_ros.bags.reader import open_bag
from samrl_ros.contract.topics import cell_topic

pytest.importorskip("rclpy")
# Judged by simulated time, so that it runs beside the other tests: it leaves half of two cores idle.
pytestmark = [pytest.mark.ros, pytest.mark.timeout(3600)]

# Python imports it in every process: whoever asks for another machine is noted down, and refused.
OFFLINE = """
import os, socket

def _guarded(real, host_of):
    def call(*arguments, **named):
        host = str(host_of(arguments))
        if not host.startswith("127.") and host not in ("::1", "localhost", "None", "", "/"):
            with open(os.environ["ASKED_FOR"], "a") as file:
                file.write(host + "\\n")
            raise OSError(f"{host}: there is no network in this test")
        return real(*arguments, **named)
    return call

def _host(address):
    return address[0] if isinstance(address, tuple) else "/"

socket.getaddrinfo = _guarded(socket.getaddrinfo, lambda a: a[0])
socket.socket.connect = _guarded(socket.socket.connect, lambda a: _host(a[1]))
"""


def makefile_defaults() -> dict[str, str]:
    """Variables of the Makefile by name, as `make cell` has them unless it is given others."""
    text = (Path(__file__).parents[2] / "Makefile").read_text()
    return dict(re.findall(r"^([A-Z]+) +\?= (\S+)$", text, flags=re.MULTILINE))


@pytest.mark.slow
def test_make_cell_succeeds_in_a_cell_that_differs(tmp_path: Path) -> None:
    asked, out = makefile_defaults(), tmp_path / "out"
    assert asked["INSTANCE"].startswith("typical:")
    options = ["--task", asked["TASK"], "--instance", asked["INSTANCE"], "--seed", asked["SEED"]]
    command = [sys.executable, "-m", "samrl_ros.cli.main", "cell", *options, "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    summary = json.loads((out / "summary.json").read_text())
    assert summary["settings"]["policy"] == "touch" and summary["successes"] == 1
    assert summary["detector"]["true_positive"] == 1  # it noticed


def test_the_cell_succeeds_at_once(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(OFFLINE)
    asked, out = tmp_path / "asked_for", tmp_path / "out"
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    surroundings = {**os.environ, "PYTHONPATH": path, "ASKED_FOR": str(asked), "CUDA_VISIBLE_DEVICES": ""}
    probe = "import socket; socket.create_connection(('192.0.2.1', 80), 1)"  # TEST-NET-1, RFC 5737
    refused = subprocess.run([sys.executable, "-c", probe], env=surroundings, capture_output=True, text=True)
    assert "no network in this test" in refused.stderr and asked.read_text() == "192.0.2.1\n"
    asked.unlink()

    command = [sys.executable, "-m", "samrl_ros.cli.main", "cell", "--out", str(out)]
    done = subprocess.run(command, env=surroundings, capture_output=True, text=True)
    said = done.stdout + done.stderr
    assert done.returncode == 0, said
    assert not asked.exists(), asked.read_text()
    episode = json.loads((out / "summary.json").read_text())["episodes"][0]
    assert episode["success"] and episode["views"], said  # by evaluation truth; it looked around
    assert "1 of 1 episodes succeeded" in said and "Traceback" not in said
    assert (out / "contact_sheet.png").read_bytes().startswith(b"\x89PNG")
    phases = [message.data for _, message in open_bag(out / "bag").decoded([cell_topic("phase")])]
    assert phases.count("act") == episode["actions"] and {"update", "view", "look"} <= set(phases)
