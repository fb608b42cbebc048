"""A decoded topic to one signal in a given joint order, with stamps that increase."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.common.errors import InputError
from samrl_ros.recordings.joint_messages import JointMessages

_MOST_REPEATED = 0.1  # of a topic's messages; more are no slips, but two sources
_EFFORT = ("effort",)
# One of them; a speed loop is told a velocity alone.
_NEEDED = {"commanded_effort": _EFFORT, "torque_enabled": _EFFORT, "command": ("position", "velocity")}
_ORDER = ("position", "velocity", "acceleration", "effort")


def common_joints(messages: JointMessages) -> tuple[str, ...]:
    """Every joint that a topic names, in order of first appearance."""
    groups = sorted(messages.groups, key=lambda group: int(group.index.min()))
    return tuple(dict.fromkeys(name for group in groups for name in group.names))


def signal_of(
    where: str,
    channel: str,
    messages: JointMessages,
    logged_ns: np.ndarray,
    start_ns: int,
    joints: tuple[str, ...],
    notes: list[str],
) -> JointSignal:
    """The signal of a topic.

    Messages that name none of the joints (a gripper on the same topic) are left out. A quantity that is
    NaN throughout, as drivers send for what they do not measure, counts as not recorded.

    Args:
        where: bag and topic, for messages.
        channel: topic name within the arm.
        messages: decoded topic.
        logged_ns: (N,) log times, used (and noted) only where no header was ever stamped.
        start_ns: time zero of the recording.
        joints: wanted joints in order.
        notes: gets what is worth saying.

    Raises:
        InputError: some of the joints are missing in a message, a quantity comes and goes, or stamps do
            not increase.
    """
    stamps = messages.stamp_ns
    if not stamps.any():
        notes.append(f"{where}: no header is stamped; the recorder's log times are used instead")
        stamps = logged_ns
    columns: list[tuple[np.ndarray, dict[str, np.ndarray]]] = []
    skipped = 0
    for group in messages.groups:
        order = _order(where, group.names, joints, int(group.index.min()), group.values, notes)
        if order is None:
            skipped += len(group.index)
            continue
        columns.append((group.index, {q: block[:, order] for q, block in group.values.items()}))
    if not columns:
        raise InputError(f"{where}: no message holds joints {list(joints)}")
    if skipped:
        notes.append(f"{where}: {skipped} messages of other joints are ignored")
    index = np.concatenate([rows for rows, _ in columns])
    order = np.argsort(index, kind="stable")
    quantities = [q for q in _ORDER if any(q in values for _, values in columns)]
    values: dict[str, np.ndarray] = {}
    for quantity in quantities:
        lacking = sum(len(rows) for rows, parts in columns if quantity not in parts)
        if lacking:
            raise InputError(
                f"{where}: {quantity} is empty in {lacking} of {len(index)} messages; a quantity is recorded"
                " throughout or not at all: cut the bag where it starts"
            )
        block = np.concatenate([parts[quantity] for _, parts in columns])[order]
        if np.isnan(block).all():
            notes.append(f"{where}: {quantity} is NaN throughout and counts as not recorded")
        else:
            values[quantity] = block
    stamps = stamps[index[order]]
    keep = first_of_each(where, stamps, start_ns, notes)
    stamps, values = stamps[keep], {quantity: block[keep] for quantity, block in values.items()}
    needed = _NEEDED.get(channel, ("position",))
    if not set(needed) & set(values):
        raise InputError(f"{where} carries no {' or '.join(needed)}; it has {', '.join(values) or 'nothing'}")
    if needed == _EFFORT:
        values = {"effort": values["effort"]}
    return JointSignal(time=(stamps - start_ns) * 1e-9, **values)


def _order(
    where: str,
    names: tuple[str, ...],
    joints: tuple[str, ...],
    first: int,
    values: dict[str, np.ndarray],
    notes: list[str],
) -> list[int] | None:
    """Column of each wanted joint in a group, None where it has none of them."""
    if not names:
        if any(block.shape[1] != len(joints) for block in values.values()):
            raise InputError(
                f"{where}, message {first}: no joint names and not {len(joints)} numbers; fill in the names"
            )
        notes.append(f"{where}: messages without joint names are taken in the order {list(joints)}")
        return list(range(len(joints)))
    if len(set(names)) != len(names):
        raise InputError(f"{where}, message {first}: joint names {list(names)} hold one twice")
    missing = [joint for joint in joints if joint not in names]
    if len(missing) == len(joints) and set(names).isdisjoint(joints):
        return None
    if missing:
        raise InputError(
            f"{where}, message {first}: joints {missing} are missing; wanted are {list(joints)},"
            f" the message has {list(names)}"
        )
    return [names.index(joint) for joint in joints]


def first_of_each(where: str, stamps_ns: np.ndarray, start_ns: int, notes: list[str]) -> np.ndarray:
    """Which messages to keep (N,): of those with the same stamp the first, with a note.

    Raises:
        InputError: stamps jump back, or so many repeat that two publishers write to the topic: first place,
            size, how often, remedy.
    """
    steps = np.diff(stamps_ns)
    bad = np.flatnonzero(steps <= 0)
    keep = np.concatenate([[True], steps > 0])
    if not len(bad):
        return keep
    first = int(bad[0])
    at = f"at message {first + 1}, {(stamps_ns[first] - start_ns) * 1e-9:.6f} s into the recording"
    back = steps[bad[steps[bad] < 0]]
    if len(back):
        first = int(bad[steps[bad] < 0][0])
        at = f"at message {first + 1}, {(stamps_ns[first] - start_ns) * 1e-9:.6f} s into the recording"
        raise InputError(
            f"{where}: the clock jumps back by {-steps[first] * 1e-9:.6f} s {at}"
            f" ({len(back)} such jumps, {len(bad) - len(back)} repeated stamps in all); cut the bag there, or"
            " record again with one source of time (no restart of the simulation within a recording)"
        )
    message = f"{where}: stamps repeat, first {at} ({len(bad)} of {len(stamps_ns)} messages)"
    if len(bad) > _MOST_REPEATED * len(stamps_ns):
        raise InputError(
            f"{message}, at most {_MOST_REPEATED:.0%} can be left out; stamp each sample with its own"
            " measurement time, and let one publisher only write to the topic"
        )
    notes.append(f"{message}; those after the first of a stamp are left out")
    return keep
