"""Whose commands an arm hears."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from samrl_core.common.errors import InputError
from samrl_ros.hosting import CellNode
from samrl_ros.nodes.standstill import why_rivals

_NOT_IN_GRAPH = "_NODE_NAME_UNKNOWN_"  # rmw's word where an endpoint is discovered before its node


class Commanders:
    """Who publishes on an arm's command topic.

    A message does not say who sent it. The number of matched publishers is known at every message; their
    identities are asked of the graph when it changes, and every tenth of a second at 250 Hz.
    """

    _EVERY = 25  # messages

    def __init__(self, node: CellNode, subscription: Any) -> None:
        self._node = node
        self._subscription = subscription
        self._known: dict[str, str] = {}  # "node 'name'" by publisher id
        self._matched = self._age = 0

    def is_there(self) -> bool:
        """Whether anybody publishes commands."""
        return self._subscription.get_publisher_count() > 0

    def find_publishers(self) -> dict[str, str]:
        """Who, "node 'name'", by publisher id; empty while a matched publisher is not in the graph yet."""
        matched = self._subscription.get_publisher_count()
        self._age += 1
        if matched != self._matched or self._age >= self._EVERY or len(self._known) < matched:
            infos = self._node.get_publishers_info_by_topic(self._subscription.topic_name)
            self._known = {bytes(i.endpoint_gid).hex(): _named(i.node_name) for i in infos}
            self._matched, self._age = matched, 0
        return self._known if len(self._known) >= matched else {}


def _named(node: str) -> str:
    return "a node not yet known by name" if node == _NOT_IN_GRAPH else f"node {node!r}"


def refuse_rivals(commanders: Mapping[str, Commanders]) -> None:
    """Let no episode begin in which an arm would have two commanders; by role.

    Raises:
        InputError: an arm has; names all of its.
    """
    for role, of_arm in commanders.items():
        publishers = of_arm.find_publishers()
        if len(publishers) > 1:
            raise InputError(why_rivals(role, list(publishers.values())))
