"""What of a named effect a cell puts right, what it does not, and that both are said."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from samrl_core.cell.calibration.cell_correction import read_correction
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.diagnosis.effects import IMAGE_EFFECTS
from samrl_core.diagnosis.export.recalibration import write_recalibration
from samrl_core.diagnosis.kinds.images.image_corrections import recalibration
from samrl_core.diagnosis.result import Diagnosis
from samrl_ros.cli.diagnosis.apply import apply

INTRINSICS = Intrinsics(width=128, height=128, fx=166.7, fy=166.7, cx=64.0, cy=64.0)
RECORDING = SimpleNamespace(camera="camera", source="A.mcap", sha256="00", intrinsics=INTRINSICS)


def named(**families: tuple[float, ...]) -> Any:
    """Corrections of effects of these families with these amplitudes."""
    parts = []
    for family, amplitudes in families.items():
        (effect,) = (e for e in IMAGE_EFFECTS if e.family == family)
        form = next(
            f for f in effect.forms(cast(Any, None), "sensor:camera") if len(f.amplitudes) == len(amplitudes)
        )
        h = SimpleNamespace(effect=effect, form=form, shape={}, place="sensor:camera")
        h.name = f"{family}@sensor:camera"
        parts.append((h, np.array(amplitudes), np.eye(len(amplitudes))))
    fit = cast(Any, SimpleNamespace(parts=lambda: parts))
    return recalibration(fit, cast(Any, [SimpleNamespace(recording=RECORDING)]))


def test_a_strong_lens_is_applied() -> None:
    found = named(lens_distortion=(0.53, -0.1))
    assert dict(found.cell.numbers) == {"k1": 0.53, "k2": -0.1} and found.refused == ()


def test_a_lens_beyond_any_is_left_out_whole_and_the_depth_beside_it_is_applied(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = named(lens_distortion=(1.4, -0.1), depth_scale=(0.03,))
    assert dict(found.cell.numbers) == {"depth_scale": 0.03}
    assert found.cell.effects == ("depth_scale@sensor:camera",)
    (refused,) = found.refused
    assert refused.effect == "lens_distortion@sensor:camera" and "k1 is 1.4" in refused.says
    lines = apply(found, cast(Diagnosis, SimpleNamespace(verdict="effect")), tmp_path)
    assert "applied: depth_scale 0.03, from depth_scale@sensor:camera" in lines
    assert any(line.startswith("not applied: lens_distortion@sensor:camera: k1 is 1.4") for line in lines)
    assert dict(read_correction(tmp_path / "apply" / "cell.json").numbers) == {"depth_scale": 0.03}
    assert "# Not in cell.json: lens_distortion" in (tmp_path / "apply" / "corrected.yaml").read_text()


def test_what_is_applied_says_how_well_it_is_known(tmp_path: Path) -> None:
    """Amplitudes here have unit covariance; those of a depth are its numbers, those of a lens too."""
    found = named(lens_distortion=(0.53, -0.1), depth_scale=(0.03,))
    write_recalibration(found, tmp_path)
    known = read_correction(tmp_path / "cell.json").covariance
    assert known.of == ("k1", "k2", "depth_scale")
    np.testing.assert_allclose(known.matrix, np.eye(3), atol=1e-9)


def test_where_nothing_is_left_no_correction_is_written(tmp_path: Path) -> None:
    found = named(lens_distortion=(1.4, -0.1))
    assert found.cell.is_empty
    assert write_recalibration(found, tmp_path) == [tmp_path / "corrected.yaml"]


@pytest.mark.parametrize(("zero", "written"), [(0.015, True), (0.15, False)])
def test_a_joints_zero_is_applied_up_to_what_a_cell_corrects(
    zero: float, written: bool, tmp_path: Path
) -> None:
    (effect,) = (e for e in IMAGE_EFFECTS if e.family == "encoder_offset")
    joints = {"camera": ("c1", "c2"), "tool": ("t1",)}
    trial = SimpleNamespace(recording=RECORDING, joints=joints, joint_of=lambda _: ("camera", 1))
    (form,) = effect.forms(cast(Any, trial), cast(Any, SimpleNamespace(name="joint:c2")))
    h = SimpleNamespace(effect=effect, form=form, shape={}, place="joint:c2", name="encoder_offset@joint:c2")
    fit = SimpleNamespace(parts=lambda: [(h, np.array([zero]), np.eye(1))])
    found = recalibration(cast(Any, fit), cast(Any, [trial]))
    lines = "; ".join(apply(found, cast(Diagnosis, SimpleNamespace(verdict="effect")), tmp_path))
    if not written:
        assert found.cell.is_empty and "not applied: encoder_offset@joint:c2: c2 is off by 0.15 rad" in lines
        return
    assert "applied: c2 reads 0.01500 rad too much, from encoder_offset@joint:c2" in lines
    read = read_correction(tmp_path / "apply" / "cell.json")
    assert read.encoder_zeros == {"camera_arm": {"c2": zero}} and read.effects == (h.name,)
