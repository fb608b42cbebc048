"""Drafts of eight labs' logs: what each leaves to ask, and that nothing else is asked or guessed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.types.body_recording import BodyRecording
from samrl_ros.cli.main import run
from samrl_ros.log_import.devices import read_devices
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Effort
from tests.recordings.logs.eight_labs import LABS, make_lab

ASKED: dict[str, tuple[str, tuple[str, ...]]] = {  # kind, and a part of each question
    "ur_rtde": ("joints", ()),
    "dynamixel": ("joints", ("is the unit counts/4096?", "torque constant")),
    "dc_motor": ("joints", ("how many counts make a turn", "resistance [ohm]")),
    "pendulum": ("joints", ()),
    "optitrack": ("bodies", ()),
    "apriltag": ("poses", ("inverse: true",)),
    "depth_wall": ("readings", ()),
    "block": ("bodies", ("level plane",)),
}


@pytest.mark.parametrize("name", LABS)
def test_each_lab_is_asked_what_its_log_does_not_say(name: str, tmp_path: Path) -> None:
    folder = make_lab(name, tmp_path)
    model = next(folder.glob("*.urdf"), None)
    effort = Effort.passive if name == "pendulum" else Effort.ask
    draft = draft_any([folder], model and model.read_text(), model and str(model), effort)
    kind, asked = ASKED[name]
    assert draft.kind == kind
    assert len(draft.questions) == len(asked), draft.questions
    for question, part in zip(draft.questions, asked, strict=True):
        assert part in question
    count = len(list(folder.glob("*.csv")))
    assert len(draft.recordings) == {"apriltag": 1, "optitrack": 1, "block": 1}.get(name, count)


def test_the_box_that_was_tossed_is_told_from_its_stand(tmp_path: Path) -> None:
    made = read_devices([make_lab("optitrack", tmp_path)], [])
    assert made is not None
    boxes = [*made.fit, *made.held_out]
    assert len(boxes) == 6 and all(isinstance(box, BodyRecording) for box in boxes)
    assert {box.body.name for box in boxes} == {"box"} and len(made.held_out) == 2
    for box in boxes:
        assert box.gravity == (0.0, -9.81, 0.0)
        fall = 2.0 * np.polyfit(box.track.time, box.track.position, 2)[0]
        assert np.linalg.norm(fall) == pytest.approx(9.81, rel=0.02)


def test_what_asks_writes_no_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("apriltag", "block"):
        folder = make_lab(name, tmp_path)
        assert run(["diagnose", str(folder), "--out", str(tmp_path / "report")]) == 3
        assert f"samrl bag draft {folder}" in capsys.readouterr().err
        assert not (tmp_path / "report").exists()
