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
from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.images.depth_scale import EFFECT as DEPTH_SCALE
from samrl_core.diagnosis.effects.images.hand_eye import EFFECT as HAND_EYE_EFFECT
from samrl_core.diagnosis.effects.images.intrinsics import EFFECT as INTRINSICS_EFFECT
from samrl_core.diagnosis.kinds.images import images
from samrl_core.diagnosis.kinds.images.light_advice import CARD, LOCKED
from samrl_core.diagnosis.residuals.images.expected import NOISE, expected_rows, expected_scene
from samrl_core.diagnosis.residuals.images.image_trial import ImageConstants, ImageTrial
from samrl_core.diagnosis.residuals.images.rows import Rows, joined
from samrl_core.diagnosis.residuals.images.scene import FrameGeometry, ImageScene
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import Diagnosis
from samrl_core.diagnosis.selection.hypothesis import Evidence, Hypothesis
from samrl_core.diagnosis.selection.twins import principal_angle
from samrl_core.studies.camera_angles import MOTIONS, SECONDS, TASK

FRAMES = 12
Cause = dict[str, tuple[float, ...]]  # name of columns -> sizes
OFF, RAISED = (0.006, -0.006, 0.005, 0.008, -0.008, 0.01), (0.0, 0.0, 0.012, 0.0, 0.0, 0.0)
LATE_200MS: Cause = {"camera_late": (0.2,), "tool_late": (0.2,)}
HAND_EYE, BASE = "hand_eye@sensor:camera", "base_to_base@cell"
LATE, TOOL_CLOCK = "camera_latency@sensor:camera", "clock_offset@arm:tool_arm"
LAST_ZERO = "encoder_offset@joint:rizon_joint7"
INTRINSICS, DEPTH = "intrinsics@sensor:camera", "depth_scale@sensor:camera"
FAR, BEYOND = {"depth_scale": (0.04,)}, {"depth_offset": (0.016,)}


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


def diagnosed(fitted: str, held_out: str, cause: Cause, monkeypatch: pytest.MonkeyPatch) -> Diagnosis:
    """Of two recordings of a cell with one effect, each along a motion."""
    made = [recorded(fitted, cause, "A", 0), recorded(held_out, cause, "C", 1)]
    monkeypatch.setattr(images, "prepared", lambda *_: made)
    found, _ = diagnose([made[0].recording], [made[1].recording])
    return found


def form_of(effect: Effect[Any], name: str, likelihood: Likelihood) -> Hypothesis:
    """A form of an effect, its prior as narrow as it comes."""
    pool = Evidence(likelihood).screen([effect])
    return next(h for h in pool if h.form.name == name and h.shape["scale"] == 1.0)


def most_alike(motion: str, nat: float) -> tuple[Cause, Cause]:
    """The hand-eye and the intrinsics that images of a motion tell apart least, each worth `nat` there."""
    likelihood = Likelihood([recorded(motion, {}, "A", 0)])
    pair = [form_of(HAND_EYE_EFFECT, "", likelihood), form_of(INTRINSICS_EFFECT, "both", likelihood)]
    bases, sizes = [], []
    for h in pair:
        units = [likelihood.prediction(h.regressors, row) for row in np.diag(h.spread)]
        q, r = np.linalg.qr(np.stack([likelihood.whitened(u) for u in units], axis=1))
        bases.append(q)
        sizes.append(h.spread[:, None] * np.linalg.inv(r))
    left, _, right = np.linalg.svd(bases[0].T @ bases[1])
    energy = np.sqrt(4.0 * nat)  # two samples count as one
    turn, lens = energy * sizes[0] @ left[:, 0], energy * sizes[1] @ right[0]
    return {"hand_eye": tuple(turn)}, {"focal": tuple(lens[:2]), "centre": tuple(lens[2:])}


@pytest.mark.parametrize(
    ("motion", "depths", "cameras"),
    [
        ("still camera", (50, 70), (5, 20)),
        ("straight down", (5, 20), (0, 2)),
        ("rolled views", (75, 90), (55, 90)),
    ],
)
def test_twelve_views_tell_apart_what_one_view_hardly_does(
    motion: str, depths: tuple[float, float], cameras: tuple[float, float]
) -> None:
    """Angles [deg] of what tolerances do not undo: a depth's scale and offset, a lens and a hand-eye."""
    likelihood = Likelihood([recorded(motion, {}, "A", 0)])
    scale, offset = (form_of(DEPTH_SCALE, name, likelihood) for name in ("scale", "offset"))
    assert depths[0] <= np.degrees(principal_angle(likelihood, scale, offset)) <= depths[1]
    lens, turn = form_of(INTRINSICS_EFFECT, "both", likelihood), form_of(HAND_EYE_EFFECT, "", likelihood)
    assert cameras[0] <= np.degrees(principal_angle(likelihood, lens, turn)) <= cameras[1]


@pytest.mark.thorough
@pytest.mark.parametrize("cause", [FAR, BEYOND])
def test_one_distance_leaves_open_how_depth_is_off(cause: Cause, monkeypatch: pytest.MonkeyPatch) -> None:
    """Depth is wrong for sure, by a factor or by an offset: both sizes are given, each may be zero."""
    found = diagnosed("straight down", "straight down", cause, monkeypatch)
    assert [e.name for e in found.effects] == [DEPTH], (found.verdict, found.reasons)
    sizes = found.effects[0].parameters
    true = {"a": cause.get("depth_scale", (0.0,))[0], "b": cause.get("depth_offset", (0.0,))[0]}
    for name, value in true.items():
        assert sizes[name].ci95[0] <= value <= sizes[name].ci95[1], (name, sizes)
    assert all(p.ci95[0] <= 0.0 <= p.ci95[1] for p in sizes.values()), sizes
    assert any("scale" in r and "offset" in r and "0.27 to 0.6 m" in r for r in found.reasons), found.reasons


@pytest.mark.thorough
@pytest.mark.parametrize(("cause", "form"), [(FAR, "scale"), (BEYOND, "offset")])
def test_views_near_and_far_tell_how_depth_is_off(
    cause: Cause, form: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = diagnosed("rolled views", "rolled views", cause, monkeypatch)
    assert [(e.name, e.form) for e in found.effects] == [(DEPTH, form)], (found.verdict, found.reasons)
    assert found.verdict == "effect"
    ((value,),) = cause.values()
    (size,) = found.effects[0].parameters.values()
    assert size.ci95[0] <= value <= size.ci95[1]
    assert not any("known together" in reason for reason in found.reasons)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("motion", "which"), [("still camera", 0), ("straight down", 0), ("straight down", 1)]
)
def test_a_camera_that_sits_elsewhere_may_have_another_lens(
    motion: str, which: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The hand-eye (0) and the intrinsics (1) that images of a motion tell apart least.

    From one distance the lens won by its fewer numbers, whichever of the two it was.
    """
    found = diagnosed(motion, motion, most_alike(motion, 30.0)[which], monkeypatch)
    assert found.verdict == "ambiguous", (found.verdict, [e.name for e in found.effects], found.reasons)
    assert {HAND_EYE, INTRINSICS} <= set(found.ambiguity_set[0])
    assert any("--set camera" in reason for reason in found.reasons), found.reasons


@pytest.mark.thorough
@pytest.mark.parametrize("which", [0, 1])
def test_twelve_views_tell_a_lens_from_a_camera_that_sits_elsewhere(
    which: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The two that even these views tell apart least."""
    found = diagnosed("rolled views", "rolled views", most_alike("rolled views", 30.0)[which], monkeypatch)
    assert [e.name for e in found.effects] == [(HAND_EYE, INTRINSICS)[which]], (found.verdict, found.reasons)
    assert found.verdict == "effect"


@pytest.mark.thorough
def test_a_lamp_that_passes_is_told_to_show_on_a_card(monkeypatch: pytest.MonkeyPatch) -> None:
    """From which size on, as recorded and on a card; with a card, and that stated, it is named."""
    lamp: Cause = {"light": (0.45,)}
    found = diagnosed("rolled views", "rolled views", lamp, monkeypatch)
    assert found.verdict == "no_gap", [e.name for e in found.effects]
    (light,) = (one for one in found.least_sizes if one.family == "lighting")
    assert any("matt card" in r and f"{light.stated[1]:+.0%}" in r for r in found.reasons), found.reasons
    made = [recorded("rolled views", lamp, name, seed) for name, seed in (("A", 0), ("C", 1))]
    for one in made:
        stated = replace(one.recording.tolerances, table_paint=CARD, brightness=LOCKED)
        one.recording = replace(one.recording, tolerances=stated)
    monkeypatch.setattr(images, "prepared", lambda *_: made)
    found, _ = diagnose([made[0].recording], [made[1].recording])
    assert [e.name for e in found.effects] == ["lighting@cell"], found.reasons
    low, high = found.effects[0].parameters["g"].ci95
    assert low < np.expm1(0.45) < high


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
    found = diagnosed(motion, motion, cause, monkeypatch)
    assert found.verdict == "ambiguous", (found.verdict, [e.name for e in found.effects], found.reasons)
    assert alike <= set(found.ambiguity_set[0])
    assert any(split in reason for reason in found.reasons), found.reasons
