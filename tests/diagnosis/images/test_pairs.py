"""Effects that images of a kind cannot tell apart: `ambiguous`, with the recording that splits them.

Images are the model's own, so that a row costs seconds: tiles as the model sees them, one effect added by its
columns, noise of typical cells.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.diagnosis.diagnose import diagnose
from samrl_core.diagnosis.kinds.images import images
from samrl_core.diagnosis.residuals.images.expected import NOISE, expected_rows, expected_scene
from samrl_core.diagnosis.residuals.images.image_trial import ImageConstants, ImageTrial
from samrl_core.diagnosis.residuals.images.rows import Rows, joined
from samrl_core.diagnosis.residuals.images.scene import FrameGeometry, ImageScene
from samrl_core.studies.camera_angles import MOTIONS, SECONDS, TASK

FRAMES = 12
Cause = dict[str, tuple[float, ...]]  # name of columns -> sizes
OFF, RAISED = (0.006, -0.006, 0.005, 0.008, -0.008, 0.01), (0.0, 0.0, 0.012, 0.0, 0.0, 0.0)
LATE_200MS: Cause = {"camera_late": (0.2,), "tool_late": (0.2,)}
HAND_EYE, BASE = "hand_eye@sensor:camera", "base_to_base@cell"
LATE, TOOL_CLOCK = "camera_latency@sensor:camera", "clock_offset@arm:tool_arm"
LAST_ZERO = "encoder_offset@joint:rizon_joint7"


@cache
def seen(motion: str) -> tuple[ImageRecording, ImageScene, tuple[FrameGeometry, ...], dict[str, Rows]]:
    """What the model sees along a motion when nothing is off."""
    recording = MOTIONS[motion](task_named(TASK), cell_named(DEFAULT_CELL))
    scene, times = expected_scene(recording), np.linspace(0.3, SECONDS - 0.3, FRAMES)
    made = [expected_rows(scene, recording, float(t)) for t in times]
    rows = {channel: joined([m[channel] for m in made]) for channel in NOISE}
    return recording, scene, tuple(scene.view(recording, float(t)) for t in times), rows


def recorded(motion: str, cause: Cause, name: str, seed: int) -> ImageTrial:
    """A recording of a cell with one effect."""
    recording, scene, views, rows = seen(motion)
    rng = np.random.default_rng(seed)
    out = cast(Any, object.__new__(ImageTrial))
    out.recording = replace(recording, name=name, source=name)
    out.constants, out.cached = ImageConstants(scene, np.eye(4), {}), {}
    out.frames = tuple(SimpleNamespace(view=view) for view in views)
    out.channels, out.level, out.outliers = tuple(NOISE), dict(NOISE), {}
    out._sigma = {c: noise * rows[c].shape for c, noise in NOISE.items()}
    out._frame = {c: np.zeros(len(rows[c].value), dtype=int) for c in NOISE}
    out._rows = {}
    for channel, sigma in out._sigma.items():
        of = rows[channel].columns
        caused = sum(np.asarray(a) @ of[n] for n, a in cause.items() if n in of)
        out._rows[channel] = replace(rows[channel], value=caused + sigma * rng.standard_normal(len(sigma)))
    return out


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("motion", "cause", "alike", "split"),
    [
        ("still camera", {"base": OFF}, {HAND_EYE, BASE}, "--set camera"),
        ("orbit", {"base": RAISED}, {HAND_EYE, BASE}, "--set camera"),
        ("still camera", LATE_200MS, {LATE, TOOL_CLOCK}, "camera moving past"),
        ("rolled views", {"camera_zeros": (*(0.0,) * 6, 0.02)}, {HAND_EYE, LAST_ZERO}, "no motion"),
    ],
)  # fmt: skip
def test_what_images_of_a_kind_cannot_tell_is_ambiguous_with_what_splits_it(
    motion: str, cause: Cause, alike: set[str], split: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = [recorded(motion, cause, name, seed) for name, seed in (("A", 0), ("C", 1))]
    monkeypatch.setattr(images, "prepared", lambda *_: made)
    found, _ = diagnose([made[0].recording], [made[1].recording])
    assert found.verdict == "ambiguous", (found.verdict, [e.name for e in found.effects], found.reasons)
    assert alike <= set(found.ambiguity_set[0])
    assert any(split in reason for reason in found.reasons), found.reasons
