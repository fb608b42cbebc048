"""Node `recorder`: every topic of the cell, as bytes, into a bag.

Log time is the simulated clock, taken from the recorder's own `/clock` subscription (wall clock without
use_sim_time); messages from before the first clock value are held until it comes, see `bags.recorder`.
Publish time is the header's stamp where a message has one: raw callbacks of the events executor carry no
source time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, final

from std_srvs.srv import Trigger

from samrl_core.common.errors import InputError
from samrl_core.common.version import samrl_version
from samrl_ros.bags.qos_metadata import topic_qos
from samrl_ros.bags.recorder import Recorder, clock_ns, header_stamp_ns
from samrl_ros.bags.writer import COMPRESSIONS, BagWriter
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.qos import qos_named
from samrl_ros.contract.settings import setting
from samrl_ros.contract.topics import CLOCK, TOPICS, Topic
from samrl_ros.hosting.cell_node import ACTIVE, CellNode
from samrl_ros.hosting.diagnostics import TopicCounter
from samrl_ros.hosting.host import run_process

NAME = "recorder"
QUEUE = 1000  # messages per topic: a recorder that is late for a moment must not lose any


@dataclass(frozen=True)
class RecorderSettings:
    """What to record, and where to."""

    out: str = setting("bag", "bag folder; must not exist. Later bags of the same run get _1, _2, ...")
    compression: str = setting("zstd", "of the bag's chunks", choices=tuple(COMPRESSIONS))
    topics: tuple[str, ...] = setting(
        ("",), "topics to record; empty for all that samrl_ros.contract.topics marks"
    )
    task: str = setting("", "name of the task, written into the bag")
    cell: str = setting("", "name of the cell, written into the bag")
    record_on_start: bool = setting(True, "open a bag when the node becomes active")


@final
class RecorderNode(CellNode):
    """Raw subscriptions to the recorded topics, with services ~/start, ~/stop and ~/split.

    Inactive or stopped, it subscribes but writes nothing.
    """

    def __init__(self, **node_options: Any) -> None:
        super().__init__(NAME, RecorderSettings, **node_options)
        self._settings = RecorderSettings()
        self._recorder: Recorder | None = None
        self._bags = 0
        self._clock_ns: int | None = None
        self._parts: list[Any] = []
        self._latched: dict[str, tuple[Topic, bytes]] = {}  # newest of each, for bags that start later

    # --- hooks of CellNode ---

    def set_up(self, settings: Any) -> None:
        """Subscribe and offer the services."""
        self._settings = settings
        for topic in _chosen(settings.topics):
            counter = self.health.topics[topic.name] = TopicCounter()
            subscription = self.create_subscription(
                message_class(topic.type),
                topic.name,
                partial(self._receive, topic, counter),
                qos_named(topic.qos, QUEUE),
                raw=True,
            )
            self._parts.append((self.destroy_subscription, subscription))
        for name, action in (("start", self._start), ("stop", self._stop), ("split", self._split)):
            service = self.create_service(Trigger, f"~/{name}", partial(self._answer, action))
            self._parts.append((self.destroy_service, service))

    def begin(self) -> None:
        """Open the first bag."""
        if self._settings.record_on_start:
            self._start()

    def halt(self) -> None:
        """Close the bag."""
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            recorder.close()

    def tear_down(self) -> None:
        """Unsubscribe."""
        for destroy, part in self._parts:
            destroy(part)
        self._parts, self._latched, self._clock_ns = [], {}, None

    def figures(self) -> dict[str, str]:
        """Of the bag being written."""
        return self._recorder.status() if self._recorder is not None else {"bag": "none"}

    def settle(self) -> None:
        """See `CellNode`; called at least every 50 ms, so it also bounds what a kill can lose."""
        if self._recorder is not None and not self.failure:
            self.guard("flush", self._recorder.flush_if_due)
        super().settle()

    # --- messages ---

    def _receive(self, topic: Topic, counter: TopicCounter, data: bytes) -> None:
        counter.received += 1
        counter.window += 1
        self.guard(f"recording {topic.name}", self._take, topic, counter, data)

    def _take(self, topic: Topic, counter: TopicCounter, data: bytes) -> None:
        if topic.qos == CLOCK:
            self._clock_ns = clock_ns(data) or self._clock_ns
        if topic_qos(topic.name).latched:
            self._latched[topic.name] = (topic, data)
        if self._recorder is None or self.stage != ACTIVE or self.failure:
            counter.ignored += 1
            return
        self._record(topic, data)

    def _record(self, topic: Topic, data: bytes) -> None:
        assert self._recorder is not None
        stamp = header_stamp_ns(topic.type, data)
        self._recorder.on_raw(topic.name, topic.type, topic_qos(topic.name), data, self._now_ns(), stamp)

    def _now_ns(self) -> int | None:
        if self.get_parameter("use_sim_time").value:
            return self._clock_ns
        return self.get_clock().now().nanoseconds

    # --- services ---

    def _answer(self, action: Any, _request: Any, response: Any) -> Any:
        try:
            if self.stage != ACTIVE:
                raise InputError(f"the recorder is {self.stage}; activate it first")
            response.message, response.success = action(), True
        except InputError as error:
            response.message, response.success = str(error), False
        return response

    def _start(self) -> str:
        if self._recorder is not None:
            raise InputError(f"already recording to {self._recorder.status()['bag']}; stop it first")
        out = Path(self._settings.out)
        folder = out if self._bags == 0 else out.with_name(f"{out.name}_{self._bags}")
        about = {"schema": "1", "task": self._settings.task, "cell": self._settings.cell}
        about["samrl_version"] = samrl_version()
        writer = BagWriter(folder, compression=self._settings.compression, custom_data=about)
        self._recorder = Recorder(writer, self.get_logger().warning)
        self._bags += 1
        for topic, data in list(self._latched.values()):  # a bag holds the descriptions, whenever it starts
            self._record(topic, data)
        return str(folder)

    def _stop(self) -> str:
        if self._recorder is None:
            raise InputError("nothing is being recorded; call start first")
        recorder, self._recorder = self._recorder, None
        recorder.close()
        status = recorder.status()
        return f"{status['bag']}: {status['messages']} messages"

    def _split(self) -> str:
        if self._recorder is None:
            raise InputError("nothing is being recorded; call start first")
        return self._recorder.split()


def _chosen(names: tuple[str, ...]) -> list[Topic]:
    names = tuple(name for name in names if name)
    unknown = [name for name in names if name not in TOPICS]
    if unknown:
        raise InputError(
            f"no topics {', '.join(unknown)} in the cell; samrl_ros/contract/topics.py lists them all"
        )
    chosen = [TOPICS[name] for name in names] if names else [t for t in TOPICS.values() if t.recorded]
    if not any(topic.qos == CLOCK for topic in chosen):
        chosen.append(TOPICS["/clock"])  # gives the log time
    return chosen


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the recorder alone."""
    return run_process([RecorderNode], arguments)
