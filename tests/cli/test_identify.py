"""`samrl identify` on files of pushes that the model made, and on files that are none."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.studies.model.identify_pushes import read_push, write_push
from samrl_ros.cli.main import run
from samrl_ros.contract.exit_codes import INPUT_REFUSED, OK
from tests.model.physical_parameters.pushes import DISC, made_push

SIZES = ["--mass", "1.0", "--radius", str(DISC.radius), "--thickness", str(DISC.thickness),
         "--rim-radius", str(DISC.rim_radius)]  # fmt: skip


@pytest.fixture(scope="module")
def push_files(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("pushes")
    for k, force in enumerate((6.0, 8.0)):
        write_push(folder / f"{k}.npz", made_push(0.7, 0.35, force, seed=k))
    return [str(folder / f"{k}.npz") for k in range(2)]


def test_a_push_is_read_as_it_was_written(push_files: list[str]) -> None:
    made, found = made_push(0.7, 0.35, 6.0, seed=0), read_push(Path(push_files[0]))
    assert (found.period_s, found.push_steps) == (made.period_s, made.push_steps)
    np.testing.assert_array_equal(found.tip, made.tip)
    np.testing.assert_array_equal(found.seen, made.seen)


@pytest.mark.thorough
def test_two_pushes_give_the_mass_with_its_interval(
    push_files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["identify", *push_files, *SIZES, "--out", str(tmp_path / "new")]) == OK
    record = json.loads((tmp_path / "new" / "identify.json").read_text())
    mass = next(p for p in record["physical_parameters"] if p["name"] == "mass")
    assert mass["value"] == pytest.approx(0.7, rel=0.1) and mass["determined"]
    assert mass["lower"] < 0.7 < mass["upper"]
    assert record["explained"] and record["why_stopped"] == "converged"
    assert (tmp_path / "new" / "identify.png").stat().st_size > 5000
    assert "mass is" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (SIZES[2:], "--mass is 0.0 kg; give a first guess above 0"),
        (SIZES[:2], "--radius 0.0 m and --thickness 0.0 m must be given"),
    ],
)
def test_missing_sizes_are_named(
    push_files: list[str], arguments: list[str], why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["identify", *push_files, *arguments, "--out", str(tmp_path)]) == INPUT_REFUSED
    assert why in capsys.readouterr().err


def test_a_file_that_is_not_there_is_named_before_its_sizes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["identify", str(tmp_path / "nope.npz")]) == INPUT_REFUSED
    assert "nope.npz does not exist" in capsys.readouterr().err


def test_files_that_are_no_push_are_refused(
    push_files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bad.npz"
    path.write_bytes(b"no arrays")
    assert run(["identify", str(path), *SIZES, "--out", str(tmp_path / "out")]) == INPUT_REFUSED
    assert "bad.npz cannot be read as arrays" in capsys.readouterr().err
    with np.load(push_files[0]) as file:
        arrays = dict(file)
    np.savez(path, **{**arrays, "period_s": np.array([0.1, 0.2])})
    with pytest.raises(InputError, match=r"period_s has shape \(2,\), must be one number"):
        read_push(path)
    np.savez(path, **{**arrays, "free_acceleration": arrays["tip"][:-1]})
    with pytest.raises(InputError, match=r"bad\.npz: free_acceleration has shape"):
        read_push(path)
    assert not (tmp_path / "out" / "identify.json").exists()


def test_without_files_a_study_of_no_case_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["identify", "--cases", "0", "--light", "0", "--out", str(tmp_path)]) == INPUT_REFUSED
    assert "not both 0" in capsys.readouterr().err
