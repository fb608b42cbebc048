"""The table's faults of the part of the cell that moves arms: what is done, and what must happen."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass

from samrl_ros.contract.topics import arm_topic
from tests.faults.arms_graph import ArmsGraph, Late
from tests.faults.trial import Trial

ALL = ("before", "motion", "contact", "stopping")
SOME = ("motion", "contact")
COMMAND, JOINTS = arm_topic("tool_arm", "command"), arm_topic("tool_arm", "joint_states")
RELAYED = {COMMAND: "/faulty/tool_arm/command", JOINTS: "/faulty/tool_arm/joint_states"}
REMAPS = {
    "sim_bridge": [f"{COMMAND}:={RELAYED[COMMAND]}"],
    "manipulator": [f"{JOINTS}:={RELAYED[JOINTS]}"],
}
REST_S = 0.4  # simulated time in which an arm whose commands cease has braked
HARM_S = 2.0  # wall time of a fault of messages


@dataclass(frozen=True)
class Fault:
    """A row of the table. `setting` is the graph it is tried in, which serves many faults in turn."""

    name: str
    setting: str  # plain, relayed, hosts or cell
    moments: tuple[str, ...]
    promise: str
    harm: Callable[[ArmsGraph, Trial], None]
    brakes: bool = False  # commands cease, so the arm must come to rest
    told: str = ""  # pattern of what must be said
    goes_on: bool = True  # a whole action is executed afterwards, in this episode or a later one
    stranger: str = ""  # kind of the stranger who has to be there beforehand


def begin(graph: ArmsGraph, trial: Trial) -> None:
    """Note that the fault sets in now."""
    trial.harmed, trial.harmed_ns = time.monotonic(), int(graph.state.read()[0] * 1e9)


def heal(graph: ArmsGraph, trial: Trial) -> None:
    """Note that the fault is over."""
    trial.healed, trial.healed_ns = time.monotonic(), int(graph.state.read()[0] * 1e9)


def rest(graph: ArmsGraph, trial: Trial) -> None:
    """Until the arm has rested for a while of simulated time, which first waits for the commander."""
    graph.wait(
        lambda: graph.state.read()[0] > trial.harmed_ns * 1e-9 + REST_S and graph.at_rest(), "rest", 0.02
    )


def killed(*nodes: str) -> Callable[[ArmsGraph, Trial], None]:
    """SIGKILL to the first; once the arm rests, all of them are started anew."""

    def harm(graph: ArmsGraph, trial: Trial) -> None:
        children = graph.processes.children
        begin(graph, trial)
        os.kill(children[nodes[0]].pid, signal.SIGKILL)
        children[nodes[0]].wait()
        if nodes[0] != "sim_bridge":
            rest(graph, trial)
        others = [n for n in children if n not in nodes and not graph.processes.alive(n)]
        trial.check("all others live", not others, ", ".join(others) or "they do")
        heal(graph, trial)
        for node in nodes[1:]:
            children[node].send_signal(signal.SIGINT)
            children[node].wait()
        for node in nodes:
            graph.start_node(node)
        if "supervisor" in nodes:
            graph.ears.heard.phases.clear()

    return harm


def paused(node: str, seconds: float) -> Callable[[ArmsGraph, Trial], None]:
    """SIGSTOP, and SIGCONT after so long."""

    def harm(graph: ArmsGraph, trial: Trial) -> None:
        pid = graph.processes.children[node].pid
        begin(graph, trial)
        os.kill(pid, signal.SIGSTOP)
        time.sleep(seconds)
        heal(graph, trial)
        os.kill(pid, signal.SIGCONT)

    return harm


def relayed(topic: str, mode: str, amount: float) -> Callable[[ArmsGraph, Trial], None]:
    """The relay on a topic does something to its messages for a while."""

    def harm(graph: ArmsGraph, trial: Trial) -> None:
        graph.order("relay", f"{topic} {mode} {amount}")
        begin(graph, trial)
        if mode == "cease":
            rest(graph, trial)
        time.sleep(HARM_S)
        heal(graph, trial)
        graph.order("relay", f"{topic} pass")

    return harm


def visited(graph: ArmsGraph, trial: Trial) -> None:
    """The stranger, who is in the domain already, does harm."""
    graph.order("stranger", "go")
    begin(graph, trial)
    graph.processes.children["stranger"].wait()
    heal(graph, trial)


def cabled(mode: str, seconds: float) -> Callable[[ArmsGraph, Trial], None]:
    """The cable between the two hosts is bad for so long."""

    def harm(graph: ArmsGraph, trial: Trial) -> None:
        graph.order("wire", mode)
        begin(graph, trial)
        time.sleep(seconds)
        heal(graph, trial)
        graph.order("wire", "pass")

    return harm


def _brakes(what: str) -> str:
    return f"{what}: the arm brakes within the guard's time, rests, and goes on afterwards"


NODES = {
    "manipulator": (_brakes("Nobody commands"), True),
    "sim_bridge": ("No driver: nothing moves, all others live, and it goes on afterwards", False),
    "supervisor": ("Nobody asks: the action under way ends within limits, and it goes on afterwards", False),
    "recorder": ("Nobody records: the arms are not touched by it", False),
}

FAULTS: list[Fault] = [
    *(
        Fault(
            f"{node}_killed",
            "plain",
            ALL if node in ("manipulator", "supervisor") else ("motion",),
            f"{promise} (it was started anew{', with the supervisor' if node == 'sim_bridge' else ''})",
            killed(node, *(("supervisor",) if node == "sim_bridge" else ())),
            brakes,
        )
        for node, (promise, brakes) in NODES.items()
        if node != "recorder"
    ),
    *(
        Fault(f"{node}_paused_{s}s", "plain", moments, promise, paused(node, s), brakes)
        for node, (promise, brakes) in NODES.items()
        for s in (3, 30)
        for moments in (ALL if s == 3 and node in ("manipulator", "sim_bridge") else ("motion",),)
    ),
    *(
        Fault(f"{name}_{mode}", "relayed", moments, promise, relayed(topic, mode, amount), brakes)
        for name, topic in (("commands", COMMAND), ("joint_states", JOINTS))
        for mode, amount, moments, promise, brakes in (
            ("drop", 0.3, ALL, "30 % lost: limits are kept, and it goes on", False),
            ("cease", 1.0, SOME, _brakes("All are lost"), True),
            ("delay", 0.2, SOME, "200 ms late: limits are kept, and it goes on", False),
            ("duplicate", 3, SOME, "Each comes three times: as if it came once", False),
            ("reorder", 5, SOME, "Packs of five come the other way round: none leads the arm back", False),
            ("truncate", 0.05, SOME, "One in twenty is cut in half: limits are kept, and it goes on", False),
        )
    ),
    *(
        Fault(f"foreign_{kind}", "plain", moments, promise, visited, brakes, told, stranger=kind)
        for kind, moments, promise, brakes, told in (
            ("command", ALL, "Two commanders: the arm stops, and both are named", False,
             "2 publishers.*stranger"),
            ("nan_command", ("motion",), "Two commanders: the arm stops, and both are named", False,
             "2 publishers.*stranger"),
            ("joint_states", SOME, "Two drivers: limits are kept, and it goes on", False, ""),
            ("safety_alarm", ("motion",), "A false alarm moves nothing; it may end an episode", False, ""),
            ("safety_ok", ("stopping",), "A false all-clear does not end an emergency stop", True, ""),
            ("action", ("motion",), "An action that is too long is refused, and told", False, "rejected"),
            ("trajectory", ("motion",), "One beyond the limits is refused, and told", False, "rejected"),
            ("outcome", ("motion",), "A false outcome moves nothing", False, ""),
            ("clock_forward", ("motion",), "A clock 28 h ahead moves nothing", False, ""),
            ("clock_back", ("motion", "contact"), "A clock that jumps back moves nothing", False, ""),
            ("flood", SOME, "A flood of messages: limits are kept, and it goes on", False, ""),
            ("garbage", SOME, "Datagrams that are no RTPS are not heard", False, ""),
            ("participants", ("before", "motion"), "Participants that come and go change nothing", False, ""),
        )
    ),
    *(
        Fault(f"hosts_{name}", "hosts", moments, promise, cabled(mode, s), brakes)
        for name, mode, s, promise, brakes in (
            ("sound", "pass", 3.0, "Bridge and manipulator on two hosts: it goes on", False),
            ("loss", "loss 0.1", 10.0, "10 % of the packets lost: limits are kept, and it goes on", False),
            ("mix", "mix", 5.0, "One packet in ten twice or late: limits are kept, it goes on", False),
            ("cut_3s", "cut", 3.0, _brakes("The cable is unplugged for 3 s"), True),
            ("cut_30s", "cut", 30.0, _brakes("The cable is unplugged for 30 s"), True),
        )
        for moments in (SOME if name == "loss" else ("motion",),)
    ),
]  # fmt: skip


def run(graph: ArmsGraph, fault: Fault, moment: str) -> Trial:
    """Try one fault at one moment; the graph works again afterwards, or the trial has not passed."""
    trial = Trial(fault.name, moment, fault.promise, graph.steps, graph.text)
    safety_before = time.monotonic()
    try:
        if fault.stranger:
            graph.start_stranger(fault.stranger, HARM_S)
        graph.wait_for_moment(moment)
        fault.harm(graph, trial)
        graph.after_moment(moment)
        if fault.goes_on:
            graph.wait(lambda: graph.acted_since(trial.healed), "an action after the fault", 0.05)
            trial.check(
                "it goes on", True, f"an action was executed {time.monotonic() - trial.healed:.1f} s later"
            )
    except Late as late:
        trial.check("it goes on", False, str(late))
    dead = [n for n in graph.processes.children if n != "stranger" and not graph.processes.alive(n)]
    trial.check("all nodes live", not dead, ", ".join(dead) or "they do")
    if fault.brakes and trial.healed:
        trial.check_braked()
    if "foreign_command" in fault.name:
        trial.check_not_led()
    if fault.told:
        trial.check_told(
            fault.told, "safety state and logs", trial.said() + graph.safety_since(safety_before)
        )
    ended = graph.outcomes_since(safety_before)
    if ended:
        trial.check("episodes given up on the way are told", True, "; ".join(ended)[:300])
    trial.check_limits()
    trial.check_no_traceback()
    return trial
