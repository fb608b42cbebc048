"""A behaviour for tests: it answers phase marks, and fails or hangs when told to."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from typing import Any

from samrl_ros.contract.behaviour import Behaviour, Outbox
from samrl_ros.contract.settings import setting
from samrl_ros.contract.topics import NAMESPACE, cell_topic

PHASE, WEIGHTS = cell_topic("phase"), cell_topic("residual_trainer/weights")
ESTOP = f"{NAMESPACE}/estop"


@dataclass(frozen=True)
class EchoSettings:
    """One setting of each kind."""

    gain: float = setting(2.0, "a gain", "1/s", range=(0.0, 10.0), former="strength")
    count: int = setting(1, "a count", range=(1, 5))
    mode: str = setting("plain", "how to answer", choices=("plain", "loud"))
    weights: tuple[float, ...] = setting((0.5, 0.5), "some weights", range=(0.0, 1.0))


class Echo(Behaviour):
    """Answers every phase with its settings; `boom` raises, `hang` sleeps, `stray` speaks out of turn."""

    name = "echo"
    inputs = (PHASE,)
    outputs = (WEIGHTS,)
    queues = {PHASE: 40}  # noqa: RUF012 (a constant)

    def __init__(self, settings: EchoSettings, outbox: Outbox) -> None:
        self._settings, self._outbox, self._handled = settings, outbox, 0

    def start(self) -> None:
        self._say("started")

    def handle(self, topic: str, message: Any) -> None:
        self._handled += 1
        if message.data == "boom":
            raise ValueError("boom was asked for")
        if message.data == "hang":
            time.sleep(3.0)
        if message.data == "stray":
            self._outbox.publish(PHASE, message)
        if message.data == "estop":
            from std_srvs.srv import Trigger

            self._outbox.call(ESTOP, Trigger.Request(), lambda answer: self._say(f"estop {answer.message}"))
        self._say(f"{message.data} gain={self._settings.gain} weights={self._settings.weights}")

    def status(self) -> dict[str, str]:
        return {"handled": str(self._handled)}

    def _say(self, text: str) -> None:
        from std_msgs.msg import String

        self._outbox.publish(WEIGHTS, String(data=text))


if __name__ == "__main__":
    from samrl_ros.hosting import run_node

    sys.exit(run_node(Echo, EchoSettings, "echo", sys.argv[1:]))
