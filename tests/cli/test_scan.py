"""`samrl scan` on a file of analytic photos of a ball, and on files that it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from samrl_core.common.errors import InputError
from samrl_core.studies.model.identify_pushes import read_push
from samrl_core.studies.model.scan_views import read_views, write_views
from samrl_ros.cli.main import run
from samrl_ros.contract.exit_codes import INPUT_REFUSED, OK
from tests.model.fusion.ball import CENTER, RADIUS, photos


@pytest.fixture(scope="module")
def view_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("views") / "views.npz"
    write_views(path, photos(12))
    return path


def test_views_are_read_as_they_were_written(view_file: Path) -> None:
    for made, found in zip(photos(12), read_views(view_file), strict=True):
        np.testing.assert_allclose(found.color, np.clip(made.color, 0.0, 1.0), atol=0.5 / 255 + 1e-9)
        np.testing.assert_array_equal(found.depth, made.depth)
        np.testing.assert_array_equal(found.mask, made.mask)
        pose = made.camera.camera_in_world.matrix()
        np.testing.assert_allclose(found.camera.camera_in_world.matrix(), pose, atol=1e-12)


def test_a_ball_is_scanned(view_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--voxel", "0.003", "--iterations", "2", "--out", str(tmp_path / "new")]
    assert run(["scan", str(view_file), *arguments]) == OK
    record = json.loads((tmp_path / "new" / "scan.json").read_text())
    assert record["views"] == 12 and record["watertight"] and record["voxel_size_m"] == 0.003
    np.testing.assert_allclose(record["center_in_world_m"], CENTER, atol=0.003)
    np.testing.assert_allclose(record["size_m"], 2 * RADIUS, atol=0.006)
    mesh = trimesh.load_mesh(tmp_path / "new" / "scan.ply")
    assert len(mesh.faces) == record["faces"] and mesh.volume == pytest.approx(record["volume_m3"], rel=1e-4)
    assert (tmp_path / "new" / "scan.png").stat().st_size > 5000
    assert "faces" in capsys.readouterr().out


def test_nobody_is_told_to_remove_views_of_their_own(tmp_path: Path) -> None:
    (tmp_path / "views.npz").write_bytes(b"no archive")
    with pytest.raises(InputError, match="cannot be read as arrays.*give an .npz file of views"):
        read_views(tmp_path / "views.npz")
    with pytest.raises(InputError, match="cannot be read as arrays.*give an .npz file of one push"):
        read_push(tmp_path / "views.npz")


def test_files_that_hold_no_views_are_refused(view_file: Path, tmp_path: Path) -> None:
    with np.load(view_file) as file:
        arrays = dict(file)
    path = tmp_path / "bad.npz"
    for change, why in (
        ({"intrinsics": arrays["intrinsics"][:3]}, r"intrinsics has \(3,\), must be \(4,\)"),
        ({"color": arrays["color"].astype(float)}, "color is float64, must be uint8"),
        ({"mask": np.zeros_like(arrays["mask"])}, "view 0: mask is empty"),
        ({"other": np.zeros(1)}, "must hold color"),
    ):
        np.savez(path, **{**arrays, **change})
        with pytest.raises(InputError, match=why):
            read_views(path)


def test_refusals_are_exit_codes(view_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, why in (
        ([str(tmp_path / "none.npz")], "cannot read"),
        ([str(view_file), "--voxel", "-1"], "sizes must be positive"),
        (["--body", "teapot"], "no body 'teapot'; there are hole_board, needle, pancake"),
    ):
        assert run(["scan", *arguments, "--out", str(tmp_path / "out")]) == INPUT_REFUSED
        assert why in capsys.readouterr().err
