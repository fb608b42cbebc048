"""A machine's log beside a simulator's: what parts first is where the difference is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.report.parting_page import parting_page
from samrl_core.diagnosis.two_logs import compare_logs
from tests.diagnosis import worlds
from tests.diagnosis.worlds import LIFT


def later(recording: ArmRecording, by_s: float) -> ArmRecording:
    """The same on another clock."""

    def moved(signal: JointSignal | None) -> JointSignal | None:
        return None if signal is None else replace(signal, time=signal.time + by_s)

    states = moved(recording.states)
    assert states is not None
    return replace(
        recording, states=states, command=moved(recording.command),
        commanded_effort=moved(recording.commanded_effort),
    )  # fmt: skip


def part_of(signal: JointSignal, count: int) -> JointSignal:
    """Its first samples."""
    values = {k: v[:count] for k, v in vars(signal).items() if isinstance(v, np.ndarray)}
    return JointSignal(**values)


def test_two_logs_of_one_machine_agree() -> None:
    (a,), (b,) = worlds.world(1, "A"), worlds.world(2, "A")
    found = compare_logs(a, b)
    assert all(c.parts_at is None for c in found.channels if c.quantity in ("position", "velocity"))
    assert found.command_error == pytest.approx(0.0, abs=1e-9)


def test_the_joint_with_friction_parts_and_the_clocks_are_put_together() -> None:
    (real,) = worlds.world(3, "A", coulomb={LIFT: 4.0})
    (simulated,) = worlds.world(4, "A")
    found = compare_logs(real, later(simulated, 41.3))
    assert found.shift_s == pytest.approx(-41.3, abs=0.006)
    parted = [c for c in found.channels if c.parts_at is not None]
    efforts = {c.joint: c for c in parted if c.quantity == "commanded_effort"}
    assert parted[0].joint == "lift" and max(efforts.values(), key=lambda c: c.relative).joint == "lift"
    assert efforts["lift"].relative > 0.05 and "turn" not in efforts
    page = parting_page(found, "real", "simulated", ["a <note>"])
    assert "a &lt;note&gt;" in page and "commanded_effort" in page


def test_when_they_part_is_when_the_difference_begins() -> None:
    (real,) = worlds.world(5, "A")
    assert real.states.position is not None
    position = real.states.position.copy()
    position[real.states.time > 4.0, 2] += 0.2
    changed = replace(real, states=replace(real.states, position=position))
    first = compare_logs(changed, real).channels[0]
    assert (first.joint, first.quantity) == ("bend", "position")
    assert first.parts_at == pytest.approx(4.0, abs=0.1)


def test_other_commands_are_told_and_other_joints_refused() -> None:
    (a,), (b,) = worlds.world(6, "A"), worlds.world(6, "B")
    assert any("commanded differently" in note for note in compare_logs(a, b).notes)
    fewer = replace(b, arm=replace(b.arm, joints=("turn", "lift", "other")))
    with pytest.raises(InputError, match=r"lacks \['bend'\].*log the same joints"):
        compare_logs(a, fewer)
    short = replace(
        b, states=JointSignal(*(x[:300] if isinstance(x, np.ndarray) else x for x in vars(b.states).values()))
    )
    with pytest.raises(InputError, match="in common"):
        compare_logs(replace(a, command=None), replace(short, command=None))


def moved_by(position: Callable[[np.ndarray], np.ndarray], length_s: float, step_s: float) -> ArmRecording:
    """States alone: all joints together along a path."""
    (a,) = worlds.world(7, "A")
    time = np.arange(0.0, length_s, step_s)
    states = JointSignal(time, np.repeat(position(time)[:, None], len(a.arm.joints), axis=1))
    return replace(a, states=states, command=None, commanded_effort=None)


def test_short_logs_whose_clocks_agree_nowhere_are_told() -> None:
    a = moved_by(lambda t: 0.1 * t**2, 4.0, 0.01)
    later_part = moved_by(lambda t: 0.1 * (t + 1.8) ** 2, 4.0, 0.01)
    assert not any("agree nowhere" in note for note in compare_logs(a, a).notes)
    assert any("agree nowhere within 0.99 s" in note for note in compare_logs(a, later_part).notes)


def test_logs_of_five_samples_a_second_are_compared() -> None:
    a, b = (moved_by(lambda t, o=o: np.maximum(t - 0.7, 0.0) + o, 1.5, 0.2) for o in (0.0, 3.0))
    parted = [c for c in compare_logs(a, b).channels if c.parts_at is not None]
    assert len(parted) == len(a.arm.joints) and {c.phase for c in parted} <= {"rest", "fast"}
