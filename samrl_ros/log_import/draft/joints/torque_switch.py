"""Whether a log says when its drives gave torque: servos write `torque_enable` beside their positions."""

from __future__ import annotations

from collections.abc import Sequence

from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.named_sources import NamedBlock, name_of, quantity_of, shares_rows


def add_torque_switch(
    found: Sequence[NamedBlock], position: NamedBlock, order: list[str], draft: Draft
) -> list[NamedBlock]:
    """The switch of all joints beside their positions, where it was ever off; the blocks that it is in."""
    for each in found:
        beside = shares_rows(each, position) and set(order) <= set(each.block.labels)
        if each.meaning.quantity != "enabled" or not beside:
            continue
        if each.block.values.all():
            draft.unused.append(f"{name_of(each)}: on all the time")
            return [each]
        draft.note("channels.torque_enabled.enabled", f"{name_of(each)}: the name says so; 0 is off")
        quantity = quantity_of(each, order, "1", draft, "states")
        draft.channels["torque_enabled"] = {"source": "states", "enabled": quantity}
        return [each]
    return []
