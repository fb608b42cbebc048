"""What was not recorded is not made up: the longest part in which all channels are there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.recordings import longest_whole
from tests.diagnosis import worlds


def _without(signal: JointSignal, begin: float, end: float) -> JointSignal:
    keep = (signal.time < begin) | (signal.time >= end)
    parts = {q: getattr(signal, q) for q in ("position", "velocity", "acceleration", "effort")}
    return JointSignal(signal.time[keep], **{q: None if v is None else v[keep] for q, v in parts.items()})


def _recording() -> ArmRecording:
    (recording,) = worlds.record(worlds.plant(), "A", duration_s=4.0)
    return recording


def test_a_whole_recording_stays_as_it_is() -> None:
    recording = _recording()
    assert longest_whole(recording) == (recording, "")


def test_it_is_cut_where_no_command_is_known_and_at_gaps() -> None:
    recording = _recording()
    assert recording.command is not None
    command = _without(recording.command, -1.0, 0.5)  # nobody commanded before half a second
    cut, note = longest_whole(
        replace(recording, command=command, states=_without(recording.states, 1.5, 2.0))
    )
    assert cut.states.time[0] >= 2.0 - 1e-9 and np.isclose(cut.states.time[-1], recording.states.time[-1])
    assert cut.command is not None and cut.command.time[0] >= 2.0 - 1e-9
    assert "2.00 to 4.00 s of 0.00 to 4.00 s (2 such parts)" in note


def test_setpoints_now_and_then_cut_nothing() -> None:
    recording = _recording()
    assert recording.command is not None
    rows = recording.command.time % 1.0 < 5e-4
    sparse = JointSignal(recording.command.time[rows], recording.command.position[rows])
    same, note = longest_whole(replace(recording, command=sparse))
    assert not note and len(same.states) == len(recording.states)
