"""Keeps a run going while that is safe: restarts nodes, tells busy from dead, and waits for a reset."""

from __future__ import annotations

import re
import time
from typing import Any

from samrl_ros.cell.monitor import Monitor
from samrl_ros.cell.node_group import Home
from samrl_ros.cell.pulse import Pulse, Silence, pulse_of
from samrl_ros.nodes.registry import BRIDGES

# What answers one request from messages alone, or keeps its state on disk. Not the recorder (its bag would
# have a gap that nobody sees), and nothing that moves an arm or knows where the episode stands.
RESTARTABLE = frozenset({"view_planner", "policy", "model_updater", "residual_trainer"})
ANSWERS = {"update": "model_updater", "view": "view_planner", "act": "policy"}  # who, by stage

LOOK_PERIOD_S = 0.2
TOLD_S = 10.0  # wall time without joint states after which the run says what it waits for
ASLEEP_S = 30.0  # wall time in which a silent process neither runs nor could run: it hangs
IN_VAIN_S = 120.0  # processor time used without joint states: it computes without end
REPORTS = 30  # of a node's own timer, one a second, without joint states: its world stands
HELD_S = 60.0  # wall time for which SIGSTOP or a debugger may hold a node
START_ASLEEP_S = 180.0  # as ASLEEP_S, while nodes start: one may wait for what another one compiles
START_CPU_S = 900.0  # processor time after which a node that starts computes without end
FRESH_S = 1.0  # wall time in which messages of a node's former process may still arrive


class Supervision:
    """Looks after the nodes of one run; ask `trouble` often."""

    def __init__(self, group: Any, monitor: Monitor, estop_wait_s: float, restarts: int) -> None:
        """Look after a group that is watched by a monitor.

        Args:
            group: of nodes, see `node_group`.
            monitor: hears them.
            estop_wait_s: longest wait for the reset of an emergency stop by the wall clock, 0 for ever.
            restarts: how often a process may be started anew in a run.
        """
        self._group, self._monitor = group, monitor
        self._estop_wait_s, self._most = estop_wait_s, restarts
        self._silences: dict[tuple[str, ...], Silence] = {}
        self._pulses: dict[tuple[str, ...], Pulse] = {}
        self._looked = 0.0
        self._joints = 0.0  # when they were last heard
        self._active: set[str] = set()  # nodes that have been
        self._restarts: dict[tuple[str, ...], int] = {}
        self._away: dict[str, float] = {}  # nodes that start anew: when they were started
        self._held: set[str] = set()  # nodes that a signal holds
        self._told_silence = False
        self._judged: set[int] = set()  # outcomes looked at

    def trouble(self) -> str:
        """Why the run cannot go on, empty while it can."""
        self._look()
        excused = frozenset(n for n in RESTARTABLE if self._may_restart(n))
        found = self._after_ends() or self._monitor.trouble(excused) or self._held_long()
        self._welcome_back()
        self._end_what_hangs()
        return found or self._joint_silence() or self._overdue()

    def late(self, names: tuple[str, ...]) -> str:
        """Why nodes that are not active yet never will be, empty while they may."""
        self._look()
        found = self._after_ends() or self._monitor.trouble() or self._held_long()
        homes = [home for home in self._homes() if set(home.nodes) & set(names)]
        silences = [(home, self._silences[home.nodes]) for home in homes if home.nodes in self._silences]
        if found or not silences:
            return found
        who = ", ".join(names)
        if all(one.asleep_s > START_ASLEEP_S for _, one in silences):
            return f"nodes not active, and asleep for {START_ASLEEP_S:.0f} s: {who}"
        for home, one in silences:
            if not home.threads and one.used_s > START_CPU_S:
                return f"{'+'.join(home.nodes)} not active after {START_CPU_S:.0f} s of processor time"
        return ""

    # --- what the processes do ---

    def _homes(self) -> list[Home]:
        return self._group.homes()

    def _look(self) -> None:
        now = time.monotonic()
        if now - self._looked < LOOK_PERIOD_S:
            return
        self._looked = now
        for home in self._homes():
            pulse = self._pulses[home.nodes] = pulse_of(home.pid, home.threads)
            self._silences.setdefault(home.nodes, Silence(now)).look(pulse, now)
            self._tell_held(home, pulse)
        self._active |= {
            name for home in self._homes() for name in home.nodes if self._monitor.is_active(name)
        }

    def _tell_held(self, home: Home, pulse: Pulse) -> None:
        for name in home.nodes:
            if pulse.stopped and name not in self._held:
                self._held.add(name)
                self._monitor.note("held", f"{name} is held by a signal (SIGSTOP); the run waits")
                self._monitor.publish_watch(name, 1, "held by a signal")
            elif not pulse.stopped and name in self._held and name not in self._away:
                self._held.discard(name)
                self._monitor.note("released", f"{name} is not held any more")
                self._away[name] = time.monotonic()
                self._monitor.forget(name)

    def _held_long(self) -> str:
        for nodes, silence in self._silences.items():
            if silence.stopped_s <= HELD_S:
                continue
            text = f"{'+'.join(nodes)} is held by a signal for {HELD_S:.0f} s; continue it with SIGCONT"
            if not all(self._may_restart(name) for name in nodes):
                return text
            self._monitor.note("killed", f"{text}: killed, to start it anew")
            self._group.kill(nodes)
            self._silences.pop(nodes)
            return ""
        return ""

    # --- restarts ---

    def _may_restart(self, name: str) -> bool:
        nodes = next((home.nodes for home in self._homes() if name in home.nodes), (name,))
        alone = self._group.restarts_alone(nodes)
        known = set(nodes) <= RESTARTABLE & self._active
        return alone and known and self._restarts.get(nodes, 0) < self._most

    def _after_ends(self) -> str:
        for nodes, reason in self._group.ended().items():
            done = self._restarts.get(nodes, 0)
            first = reason.splitlines()[0]
            how = first.partition(";")[0].removeprefix(f"{'+'.join(nodes)} ")
            for name in nodes:  # the bridge waits no longer for commands, the supervisor for answers
                self._monitor.publish_watch(name, 2, how)
            if not all(self._may_restart(name) for name in nodes):
                return f"{reason}\n  restarted {done} times in this run" if done else reason
            self._restarts[nodes] = done + 1
            self._monitor.note("restart", f"{first}: restart {done + 1} of {self._most}")
            self._silences.pop(nodes, None)
            for name in nodes:
                self._held.discard(name)
                self._away[name] = time.monotonic()
                self._monitor.forget(name)
            self._group.restart(nodes)
        return ""

    def _welcome_back(self) -> None:
        now = time.monotonic()
        for name, since in list(self._away.items()):
            if now - since < FRESH_S:
                self._monitor.forget(name)
            elif self._monitor.is_active(name):
                del self._away[name]
                self._monitor.note("back", f"{name} is back after {now - since:.0f} s")
                self._monitor.publish_watch(name, 0, "back")
        if self._away or self._held:
            self._monitor.excuse_progress()

    def _end_what_hangs(self) -> None:
        """A node that did not answer in time will not answer the next episode either."""
        for episode, outcome in self._monitor.watch.outcomes.items():
            if episode in self._judged:
                continue
            self._judged.add(episode)
            asked = re.search(r"no answer to '(\w+)'", outcome.reason)
            name = ANSWERS.get(asked[1], "") if asked else ""
            if name and name not in self._away and self._may_restart(name):
                self._monitor.note("killed", f"{name} does not answer: killed, to start it anew")
                self._group.kill(next(home.nodes for home in self._homes() if name in home.nodes))

    # --- silence ---

    def _joint_silence(self) -> str:
        watch, now = self._monitor.watch, time.monotonic()
        home = next((home for home in self._homes() if set(BRIDGES) & set(home.nodes)), None)
        silence = self._silences.get(home.nodes) if home is not None else None
        if watch.last_joints != self._joints or not watch.last_joints:
            if self._told_silence:
                self._monitor.note("joints", f"joint states again after {now - self._joints:.0f} s")
            self._joints, self._told_silence = watch.last_joints, False
            if silence is not None:
                silence.heard()
            return ""
        if now - watch.last_joints < TOLD_S:
            return ""
        bridge = next((name for name in BRIDGES if home is not None and name in home.nodes), "")
        if home is None or silence is None:  # of a process that is not ours, the graph alone tells
            if self._monitor.has_joint_publisher():
                return f"no joint states for {TOLD_S:.0f} s: the arm's driver is silent"
            return "nobody publishes joint states any more: the arm's driver is gone"
        if not self._told_silence:
            self._told_silence = True
            doing = "is held by a signal" if silence.stopped_s else "lives"
            self._monitor.note("silence", f"no joint states for {TOLD_S:.0f} s, {bridge} {doing}: waiting")
        if silence.asleep_s > ASLEEP_S:
            return f"{bridge} hangs: no joint states, and asleep for {ASLEEP_S:.0f} s"
        if silence.used_s > IN_VAIN_S:
            return f"{bridge} hangs: no joint states in {IN_VAIN_S:.0f} s of processor time"
        if watch.reports > REPORTS:
            cause = "it hangs" if bridge == "sim_bridge" else "the arm's driver is silent"
            return f"{bridge} reported {REPORTS} times without any joint states: {cause}"
        return ""

    def _overdue(self) -> str:
        watch, limit = self._monitor.watch, self._estop_wait_s
        if watch.estop and limit and time.monotonic() - watch.estop_since > limit:
            return f"emergency stop not reset within {limit:g} s (--estop-wait): {watch.estop}"
        return ""
