"""The live view, where Foxglove's SDK is installed."""

from __future__ import annotations

import base64
import importlib.util
import json
import os
import socket
import struct
from typing import Any

import pytest

from samrl_core.common.errors import InputError
from samrl_ros.bags.visualise import LiveView

INSTALLED = importlib.util.find_spec("foxglove") is not None


class FoxgloveClient:
    """As much of a WebSocket client of Foxglove's protocol as these tests need (RFC 6455)."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=60)
        self._file = self._socket.makefile("rb")
        key = base64.b64encode(os.urandom(16)).decode()
        self._socket.sendall(
            f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n".encode()
        )
        assert b" 101 " in self._file.readline()
        while self._file.readline().strip():
            pass
        self.channels: dict[int, dict[str, Any]] = {}  # by number, which is the subscription's as well

    def __enter__(self) -> FoxgloveClient:
        return self

    def __exit__(self, *ignored: object) -> None:
        self._file.close()
        self._socket.close()

    def subscribe_to_all(self, count: int) -> list[str]:
        """Wait for as many topics, and subscribe to each."""
        while len(self.channels) < count:
            code, data = self._frame()
            if code == 1 and json.loads(data)["op"] == "advertise":
                self.channels.update({c["id"]: c for c in json.loads(data)["channels"]})
        wanted = [{"id": channel, "channelId": channel} for channel in self.channels]
        self._send(json.dumps({"op": "subscribe", "subscriptions": wanted}).encode())
        return [channel["topic"] for channel in self.channels.values()]

    def next_message(self) -> tuple[str, bytes]:
        """Topic and content of the next message."""
        while True:
            code, data = self._frame()
            if code == 2 and data[0] == 1:  # message data: subscription, time, content
                return self.channels[struct.unpack_from("<I", data, 1)[0]]["topic"], data[13:]

    def fetch(self, uri: str) -> bytes:
        """Content of an asset; empty where the server has none."""
        self._send(json.dumps({"op": "fetchAsset", "uri": uri, "requestId": 7}).encode())
        while True:
            code, data = self._frame()
            if code == 2 and data[0] == 4:  # asset: request, status (0 is success), length of an error text
                request, status, length = struct.unpack_from("<IBI", data, 1)
                assert request == 7
                return b"" if status else data[10 + length :]

    def _frame(self) -> tuple[int, bytes]:
        first, second = self._file.read(2)
        size = second & 127
        if size > 125:
            size = int.from_bytes(self._file.read(2 if size == 126 else 8), "big")
        return first & 15, self._file.read(size)

    def _send(self, text: bytes) -> None:
        mask = os.urandom(4)
        head = bytes([0x81]) + (
            bytes([0x80 | len(text)]) if len(text) < 126 else bytes([0xFE]) + struct.pack(">H", len(text))
        )
        self._socket.sendall(head + mask + bytes(b ^ mask[i % 4] for i, b in enumerate(text)))


@pytest.mark.skipif(INSTALLED, reason="Foxglove's SDK is installed")
def test_without_the_sdk_the_remedy_is_named() -> None:
    with pytest.raises(InputError, match=r"samrl\[viz\]"):
        LiveView()


@pytest.mark.skipif(not INSTALLED, reason="needs Foxglove's SDK")
def test_it_serves_and_refuses_a_taken_port(string_cdr) -> None:
    with LiveView(port=0) as view:
        view.show("/cell/phase", "std_msgs/msg/String", string_cdr("approach"), 1_000)
        with socket.create_connection(("127.0.0.1", view.port), timeout=5):
            pass
        with pytest.raises(InputError, match="choose another port"):
            LiveView(port=view.port)


@pytest.mark.skipif(not INSTALLED, reason="needs Foxglove's SDK")
def test_a_latched_message_reaches_every_client_however_late(string_cdr) -> None:
    with LiveView(port=0) as view:
        robot, phase = string_cdr("<robot/>"), string_cdr("approach")
        view.show(
            "/cell/tool_arm/robot_description", "std_msgs/msg/String", string_cdr("old"), 1, latched=True
        )
        view.show("/cell/tool_arm/robot_description", "std_msgs/msg/String", robot, 1_000, latched=True)
        view.show("/cell/phase", "std_msgs/msg/String", phase, 1_000)
        for _ in range(2):
            with FoxgloveClient(view.port) as client:
                topics = client.subscribe_to_all(2)
                assert client.next_message() == ("/cell/tool_arm/robot_description", robot)
                view.show("/cell/phase", "std_msgs/msg/String", phase, 2_000)  # not kept: sent now alone
                assert client.next_message() == ("/cell/phase", phase)
                assert set(topics) == {"/cell/phase", "/cell/tool_arm/robot_description"}


@pytest.mark.skipif(not INSTALLED, reason="needs Foxglove's SDK")
def test_every_mesh_of_the_arms_is_served() -> None:
    import re

    from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
    from samrl_core.cell.robots.robot import ROLES
    from samrl_ros.cell.viewer.meshes import asset, with_meshes

    def unreadable(uri: str) -> bytes:
        raise InputError(f"{uri} is no mesh")

    served = 0
    with LiveView(port=0, asset=asset) as view, FoxgloveClient(view.port) as client:
        for role in ROLES:
            arm = cell_named(DEFAULT_CELL).arm(role)
            urdf = with_meshes(arm.urdf.read_text(), arm.meshes)
            for uri in re.findall(r'<mesh filename="([^"]+)"', urdf):
                assert client.fetch(uri)[:4] == b"glTF", uri
                served += 1
        assert client.fetch("package://franka_panda/../../pybullet_data/r2d2.urdf") == b""
    with LiveView(port=0, asset=unreadable) as view, FoxgloveClient(view.port) as client:
        assert client.fetch("package://arm/link.obj") == b""  # and the server lives on
        assert client.fetch("package://arm/link.obj") == b""
    assert served == 8  # of the Panda; no package that samrl installs has the Rizon's


@pytest.mark.skipif(not INSTALLED, reason="needs Foxglove's SDK")
def test_every_channel_can_be_decoded_by_its_schema_alone() -> None:
    from mcap.records import Schema

    from samrl_ros.bags.decode import Decoders
    from samrl_ros.cell.viewer.viewer_messages import MADE
    from samrl_ros.contract.topics import TOPICS

    types = {topic.name: topic.type for topic in TOPICS.values() if topic.recorded} | MADE
    with LiveView(port=0) as view:
        for topic, type_name in types.items():
            view.offer(topic, type_name)
            assert not view.is_watched(topic)
        with FoxgloveClient(view.port) as client:
            assert set(client.subscribe_to_all(len(types))) == set(types)
            for channel in client.channels.values():
                assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
                schema = Schema(1, channel["schema"].encode(), "ros2msg", types[channel["topic"]])
                assert channel["schemaName"] == schema.name
                assert callable(Decoders().get(channel["topic"], "cdr", schema))
