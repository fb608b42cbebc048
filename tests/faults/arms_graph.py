"""The part of the cell that moves arms, each node a process: bridge, manipulator, supervisor, recorder.

What thinks (model_updater, view_planner, policy) is a script in the bench: its actions are always the same,
cost nothing, and lead to contact when that is wanted.
"""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import yaml

from tests.faults.ears import Ears
from tests.faults.processes import DOES, Processes, environment, marked
from tests.faults.watched_world import StateFile

NODES = ("sim_bridge", "manipulator", "recorder", "supervisor")  # in the order of their start
FAR = ("manipulator", "supervisor")  # on the other host, where there are two
PATIENCE_S = 150.0  # wall time for anything that is waited for; the machine may be busy with other work
MOVING = 0.05  # [rad/s] set point of a joint of the tool arm
AT_REST = 1e-6


class Late(AssertionError):
    """Something that was waited for did not come."""


class ArmsGraph:
    """Start it, wait for a moment, do it harm, and look."""

    def __init__(self, folder: Path, setting: str, relayed: Mapping[str, str] | None = None) -> None:
        """Nothing is started yet.

        Args:
            folder: of this graph alone.
            setting: plain; relayed, where the topics of `relayed` go through a relay; or hosts, where
                manipulator and supervisor run on another host, behind a cable.
            relayed: by topic, the name under which its reader hears it.
        """
        self.folder, self.run, self._setting = folder, folder.name, setting
        self.steps, self.bag = folder / "steps", folder / "bag"
        self.processes = Processes(folder / "logs", self.run)
        self._relayed = dict(relayed or {}) if setting == "relayed" else {}
        self._host: list[str] = []
        self._parameters = folder / "params.yaml"
        own: dict[str, dict[str, Any]] = {
            "sim_bridge": {"use_sim_time": False, "camera_hz": 1, "tf_hz": 1},  # nobody looks
            "supervisor": {
                "episodes": 1000,
                "max_actions": 6,
                "stop_on_model_success": False,
                "view_period": 1000,
            },
        }
        content = {
            f"/cell/{node}": {
                "ros__parameters": {
                    "use_sim_time": True,
                    "task": "peg_insertion",
                    **own.get(node, {}),
                }
            }
            for node in NODES
        }
        self._parameters.write_text(yaml.safe_dump(content))

    def start(self) -> None:
        """Start all nodes and wait until the first episode is asked about."""
        if self._setting == "hosts":
            self._plug_in()
        self.ears = Ears(thinks=True)
        if self._relayed:
            pairs = [f"{topic}={other}" for topic, other in self._relayed.items()]
            self.processes.start_module("relay", pairs, environment(self.run))
        for node in NODES:
            self.start_node(node)
        self.wait(lambda: self.ears.heard.phases, "the first episode")
        self.wait(self.ears.heard_by_all, "all nodes to hear the bench")
        self.state = StateFile(Path(f"{self.steps}.state"))

    def start_node(self, node: str) -> None:
        """Start one node's process, also once more."""
        arguments = ["--ros-args", "--params-file", str(self._parameters)]
        for topic, other in self._relayed.items():
            if node == ("sim_bridge" if topic.endswith("/command") else "manipulator"):
                arguments += ["-r", f"{topic}:={other}"]
        if node == "recorder":
            arguments += ["-p", f"out:={self.bag}_{len(list(self.folder.glob('bag*')))}"]
        env = environment(self.run, self.steps if node == "sim_bridge" else None)
        self.processes.start_node(node, arguments, env, *(self._host if node in FAR else ()))

    def start_stranger(self, kind: str, seconds: float) -> None:
        """Somebody foreign enters the domain, and waits for the order to do harm."""
        before = self.processes.text("stranger").count("ready")
        self.processes.start_module("stranger", [kind, str(seconds)], environment(self.run), "foreign")
        self.wait(lambda: self.processes.text("stranger").count("ready") > before, "the stranger", 0.05)

    def order(self, process: str, line: str) -> None:
        """Tell the relay, the wire or the stranger what to do, and wait until it does."""
        before = self.processes.text(process).count(DOES)
        self.processes.tell(process, line)
        self.wait(lambda: self.processes.text(process).count(DOES) > before, f"{process} to {line}", 0.001)

    def _plug_in(self) -> None:
        """A second host: network and shared memory of its own, and a cable to it."""
        set_up = "ip link set lo up && mount -t tmpfs tmpfs /dev/shm && echo ready && exec sleep infinity"
        self.processes.start("host", ["unshare", "-n", "-m", "sh", "-c", set_up], environment(self.run))
        self.wait(lambda: "ready" in self.processes.text("host"), "the other host")
        pid = str(self.processes.children["host"].pid)
        self.processes.start_module("wire", [pid], environment(self.run))
        self.wait(lambda: "ready" in self.processes.text("wire"), "the cable")
        self._host = ["nsenter", f"--net=/proc/{pid}/ns/net", f"--mount=/proc/{pid}/ns/mnt"]

    def wait_for_moment(self, moment: str) -> None:
        """Let the graph come to a moment of the table.

        before: an update is asked for and not answered, the arms rest. motion: the tool arm moves. contact:
        its tool touches. stopping: an emergency stop was called in motion, and the arm brakes.
        """
        ears = self.ears
        if moment == "before":
            ears.answering.clear()
            self.wait(lambda: ears.holds_a_request() and self.at_rest(), "a request of an update")
            return
        ears.down = moment == "contact"
        ears.answering.set()
        if moment == "contact":
            self.wait(lambda: self.state.read()[2] and self.state.read()[1] > MOVING / 5, "contact in motion")
            return
        self.wait(lambda: self.state.read()[1] > MOVING, "motion")
        if moment == "stopping":
            called = self.ears.trigger("estop")
            self.wait(lambda: called() is not None, "the emergency stop", 0.001)

    def after_moment(self, moment: str) -> None:
        """What the moment withheld is given: answers, or the reset of the emergency stop."""
        self.ears.down = False
        self.ears.answering.set()
        if moment == "stopping":
            self.wait(self.at_rest, "rest after the emergency stop")
            self.reset()

    def reset(self) -> None:
        """Reset the emergency stop, as often as it is refused because an arm still moves."""
        answer = self.ears.trigger("estop_reset")

        def done() -> bool:
            nonlocal answer
            said = answer()
            if said is not None and not said.success:
                answer = self.ears.trigger("estop_reset")
            return said is not None and said.success

        self.wait(done, "the reset of the emergency stop", 0.1)

    def at_rest(self) -> bool:
        """Whether the tool arm's set point stands."""
        return self.state.read()[1] < AT_REST

    def acted_since(self, when: float) -> bool:
        """Whether a whole action came to its end after a wall time: asked for, executed, and gone on."""
        later = [p for t, p in self.ears.heard.phases if t > when]
        return "act" in later and "update" in later[later.index("act") :]

    def outcomes_since(self, when: float) -> list[str]:
        """How episodes ended after a wall time."""
        return [reason for t, reason in self.ears.heard.outcomes if t > when]

    def safety_since(self, when: float) -> str:
        """All that the guard told after a wall time."""
        return "\n".join(text for t, _, text, _ in self.ears.heard.safety if t > when)

    def wait(self, condition: Callable[[], Any], what: str, period_s: float = 0.005) -> None:
        """Return once it holds. Raises Late."""
        until = time.monotonic() + PATIENCE_S
        while not condition():
            if time.monotonic() > until:
                raise Late(f"waited {PATIENCE_S:.0f} s in vain for {what}")
            time.sleep(period_s)

    def text(self) -> str:
        """All that the nodes have said."""
        return "\n".join(self.processes.text(node) for node in NODES)

    def stop(self) -> dict[str, int]:
        """Stop the nodes as their cell would; exit codes by node, of those that end by themselves."""
        codes = {}
        for node in reversed(NODES):
            child = self.processes.children.get(node)
            if child is None:
                continue
            if child.poll() is None:
                child.send_signal(signal.SIGINT)
        for node in reversed(NODES):
            child = self.processes.children.get(node)
            if child is None:
                continue
            try:
                codes[node] = child.wait(60)
            except subprocess.TimeoutExpired:  # a hang: a finding, told by its absence among the codes
                continue
        self.ears.close()
        self.processes.end()
        return codes

    def left_over(self) -> dict[int, list[str]]:
        """Processes of this run that still live."""
        return marked(self.run)
