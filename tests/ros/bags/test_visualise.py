"""The live view, where Foxglove's SDK is installed."""

from __future__ import annotations

import importlib.util
import socket

import pytest

from samrl_core.common.errors import InputError
from samrl_ros.bags.visualise import LiveView

INSTALLED = importlib.util.find_spec("foxglove") is not None


@pytest.mark.skipif(INSTALLED, reason="Foxglove's SDK is installed")
def test_without_the_sdk_the_remedy_is_named() -> None:
    with pytest.raises(InputError, match=r"samrl\[viz\]"):
        LiveView()


@pytest.mark.skipif(not INSTALLED, reason="needs Foxglove's SDK")
def test_it_serves_and_refuses_a_taken_port(string_cdr) -> None:  # type: ignore[no-untyped-def]
    with LiveView(port=0) as view:
        view.show("/cell/phase", "std_msgs/msg/String", string_cdr("approach"), 1_000)
        with socket.create_connection(("127.0.0.1", view.port), timeout=5):
            pass
        with pytest.raises(InputError, match="choose another port"):
            LiveView(port=view.port)
