"""Logs of every kind that the mapping's language covers, made here, to bags and back."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.io import savemat
from typer.testing import CliRunner

from samrl_core.common.errors import InputError
from samrl_ros.cli.bag import bag_app
from samrl_ros.cli.main import run as run_command
from samrl_ros.log_import.any_importer import import_any
from samrl_ros.log_import.importer import ImportedRecording
from samrl_ros.recordings import load_recordings

N = 400
TIME = np.arange(N) * 0.01
Q = 0.3 * np.sin(2 * np.pi * TIME)
URDF = (
    '<robot name="r"><link name="a"><visual><geometry><mesh filename="no.stl"/></geometry></visual></link>'
    '<link name="b"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    '</inertial></link><joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
    '<limit lower="-2" upper="2" effort="9" velocity="3"/></joint></robot>'
)
BASE: dict[str, Any] = {
    "joints": ["j"],
    "sources": {"log": {"file": "log.csv", "time": {"column": "t"}, "columns": {"q": "q"}}},
    "channels": {"states": {"position": ["q"]}},
    "recordings": [{"name": "one"}],
}
Run = Callable[..., list[ImportedRecording]]


def csv_text(columns: dict[str, Any]) -> str:
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(f'"{c}"' if "," in str(c) else str(c) for c in r) for r in rows)]
    return "\n".join(lines) + "\n"


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Imports a mapping made of BASE with keys set by dotted path."""

    def make(changes: dict[str, Any], out: Path | None = None) -> list[ImportedRecording]:
        mapping = copy.deepcopy(BASE)
        for path, value in changes.items():
            inside: Any = mapping
            *parents, last = path.split(".")
            for key in parents:
                inside = inside[int(key)] if isinstance(inside, list) else inside.setdefault(key, {})
            inside[int(last) if isinstance(inside, list) else last] = value
        (tmp_path / "m.yaml").write_text(yaml.safe_dump(mapping))
        return list(import_any(tmp_path / "m.yaml", tmp_path, out).made)

    return make


@pytest.fixture
def log(tmp_path: Path) -> Callable[..., None]:
    def write(name: str = "log.csv", **columns: Any) -> None:
        (tmp_path / name).write_text(csv_text(columns))

    return write


def position(made: list[ImportedRecording], index: int = 0) -> np.ndarray:
    value = made[index].recording.states.position
    assert value is not None
    return value


def test_csv_with_urdf_controller_and_tolerances(run: Run, log: Callable[..., None], tmp_path: Path) -> None:
    log(t=TIME, q=Q, tau=2 * Q)
    (tmp_path / "arm.urdf").write_text(URDF)
    made = run(
        {
            "urdf": "arm.urdf",
            "constants": {"kp": 5},
            "controller": {"stiffness": ["2 * kp"], "damping": [1], "armature": [0.1]},
            "tolerances": {"mass": 0.1},
            "sources.log.columns.tau": "tau",
            "channels.commanded_effort": {"effort": ["tau"]},
        },
        tmp_path / "out",
    )
    assert "visual" not in str(made[0].recording.arm.urdf)
    (back,) = load_recordings(tmp_path / "out" / "one.mcap").recordings
    np.testing.assert_array_equal(back.states.position, Q[:, None])
    assert back.arm.controller is not None and back.arm.controller.stiffness.tolist() == [10.0]
    assert back.arm.controller.armature is not None and back.arm.tolerances.mass == 0.1
    assert json.loads((tmp_path / "out" / "recordings.json").read_text()) == {
        "fit": ["one.mcap"],
        "held_out": [],
    }
    with pytest.raises(InputError, match="exists already"):
        run({}, tmp_path / "out")


def test_lists_in_cells_and_microseconds(run: Run, log: Callable[..., None]) -> None:
    log(t=TIME * 1e6, q=[f"[{a}, {2 * a}]" for a in Q])
    made = run(
        {
            "joints": ["a", "b"],
            "sources.log.time": {"column": "t", "unit": "us"},
            "channels.states.position": {"formula": "q", "unit": "deg"},
        }
    )
    np.testing.assert_allclose(position(made), np.radians(np.column_stack([Q, 2 * Q])))
    np.testing.assert_allclose(made[0].recording.states.time, TIME)


def test_iso_time_and_missing_first_row(run: Run, log: Callable[..., None]) -> None:
    stamps = [f"2025-11-12T10:03:{20 + int(t):02d}.{round(t % 1 * 1000):03d}Z" for t in TIME]
    cells = ["", *map(str, Q[1:])]
    log(t=stamps, q=cells)
    with pytest.raises(InputError, match=r"columns\.q: 1 cells are missing, first in row 0; set `missing`"):
        run({"sources.log.time": {"column": "t", "iso": True}})
    made = run({"sources.log.time": {"column": "t", "iso": True}, "sources.log.missing": "drop_row"})
    np.testing.assert_array_equal(position(made)[:, 0], Q[1:])
    assert any("1 missing cells, drop_row" in note for note in made[0].notes)


@pytest.mark.parametrize(("rule", "value"), [("hold", 2.0), ("linear", 2.5)])
def test_missing_cells_are_filled_as_stated(
    run: Run, log: Callable[..., None], rule: str, value: float
) -> None:
    cells = [str(v) for v in np.linspace(0, N - 1, N)]
    cells[0] = cells[-1] = ""
    cells[2:5] = ["2.0", "nan", "3.0"]
    log(t=TIME, q=cells)
    made = run({"sources.log.columns.q": {"column": "q", "missing": rule}})
    assert position(made)[2, 0] == value
    assert len(position(made)) == (N - 1 if rule == "hold" else N - 2)


@pytest.mark.parametrize("rule", ["hold", "linear"])
def test_only_the_empty_cells_of_a_list_are_filled(run: Run, tmp_path: Path, rule: str) -> None:
    both = np.column_stack([Q, 2 * Q])
    both[50, 0] = np.nan
    np.savez(tmp_path / "log.npz", t=TIME, q=both)
    columns = {"q": {"column": "q", "missing": rule}, "raw": {"column": "q", "missing": "drop_row"}}
    source = {"file": "log.npz", "time": {"column": "t"}, "columns": columns}
    made = run({"joints": ["a", "b"], "sources.log": source, "channels.states.position": "q"})
    np.testing.assert_array_equal(position(made)[:, 1], 2 * Q)
    assert any("1 missing cells" in note for note in made[0].notes)
    # Another key of the same column has a rule of its own.
    made = run({"joints": ["a", "b"], "sources.log": source, "channels.states.position": "raw + 0 * q"})
    assert len(position(made)) == N - 1


def test_gaps_that_resampling_fills_are_told(run: Run, log: Callable[..., None]) -> None:
    kept = (TIME < 1.0) | (TIME > 1.8)
    log(t=TIME[kept], q=Q[kept])
    assert not any("straight lines" in note for note in run({})[0].notes)
    notes = run({"resample": {"rate_hz": 50, "filter": "none"}})[0].notes
    assert any("states: 1 gaps of up to 0.8" in note and "straight lines" in note for note in notes)


def test_rate_instead_of_time_rows_and_time_ranges(run: Run, log: Callable[..., None]) -> None:
    log(q=Q)
    made = run(
        {
            "sources.log.time": {"rate_hz": 100},
            "recordings": [
                {"name": "early", "rows": [0, 250]},
                {"name": "late", "time_range": [2.0, None], "role": "held_out"},
            ],
        }
    )
    np.testing.assert_array_equal(position(made, 0)[:, 0], Q[:250])
    np.testing.assert_array_equal(position(made, 1)[:, 0], Q[200:])
    assert [each.role for each in made] == ["fit", "held_out"]
    assert made[0].recording.sha256 != made[1].recording.sha256


def test_resampling_keeps_the_band_without_phase_and_removes_the_rest(
    run: Run, log: Callable[..., None]
) -> None:
    fine = np.arange(8000) * 0.0005
    slow = 0.3 * np.sin(2 * np.pi * fine)
    log(t=fine, q=slow + 0.05 * np.sin(2 * np.pi * 300 * fine))
    plan = {"rate_hz": 100, "filter": {"kind": "butterworth", "order": 4, "cutoff_hz": 20}}
    made = run({"resample": plan, "channels.states.velocity": "derivative"})
    states = made[0].recording.states
    assert len(states) == 400 and states.velocity is not None
    inner = slice(20, -20)
    np.testing.assert_allclose(
        position(made)[inner, 0], 0.3 * np.sin(2 * np.pi * states.time)[inner], atol=1e-4
    )
    wanted = 0.6 * np.pi * np.cos(2 * np.pi * states.time)
    np.testing.assert_allclose(states.velocity[inner, 0], wanted[inner], atol=5e-3)
    assert "Butterworth order 4 zero-phase 20 Hz" in made[0].report[0]
    assert any("derivative of position" in line for line in made[0].report)


def test_a_rate_without_a_stated_filter_is_refused(run: Run, log: Callable[..., None]) -> None:
    log(t=TIME, q=Q)
    with pytest.raises(InputError, match=r"resample\.filter is missing"):
        run({"resample": {"rate_hz": 50}})
    with pytest.raises(InputError, match="below half the new rate"):
        run({"resample": {"rate_hz": 50, "filter": {"cutoff_hz": 30}}})
    with pytest.raises(InputError, match="below half the recorded rate"):
        run({"resample": {"filter": {"cutoff_hz": 60}}})
    made = run({"resample": {"rate_hz": 50, "filter": "none"}})
    assert any("aliasing" in note for note in made[0].notes)


def test_two_files_side_by_side_and_a_coupling_matrix(run: Run, log: Callable[..., None]) -> None:
    log("a.csv", t=TIME, m1=10 * Q, m2=10 * Q + 20 * Q**2)
    log("b.csv", c1=Q, c2=2 * Q)
    made = run(
        {
            "joints": ["x", "y"],
            "constants": {"R": [[10, 0], [10, 20]], "Rt": [[10, 10], [0, 20]], "zero": [0.0, 0.1]},
            "sources.log": {
                "file": ["a.csv", "b.csv"],
                "time": {"column": "t"},
                "columns": {
                    "m1": "m1", "m2": "m2",
                    "c1": {"file": 1, "column": "c1"}, "c2": {"file": 1, "column": "c2"},
                },
                "values": {"motor": "stack(m1, m2)"},
            },
            "channels.states.position": "solve(R, motor) + zero",
            "channels.commanded_effort": {"effort": "apply(Rt, stack(c1, c2))"},
        }
    )  # fmt: skip
    np.testing.assert_allclose(position(made), np.column_stack([Q, Q**2 + 0.1]), atol=1e-12)
    effort = made[0].recording.commanded_effort
    assert effort is not None and effort.effort is not None
    np.testing.assert_allclose(effort.effort, np.column_stack([30 * Q, 40 * Q]))


def test_sources_of_different_rates_share_one_clock(run: Run, log: Callable[..., None]) -> None:
    log(t=TIME + 50, q=Q)
    log("cmd.csv", t=TIME[::2] + 50.005, w=Q[::2])
    made = run(
        {
            "sources.other": {"file": "cmd.csv", "time": {"column": "t"}, "columns": {"w": "w"}},
            "channels.states.source": "log",
            "channels.command": {"source": "other", "position": ["w"], "velocity": [0]},
        }
    )
    command = made[0].recording.command
    assert command is not None and command.time[0] == pytest.approx(0.005) and len(command) == 200
    assert command.velocity is not None and not command.velocity.any()


def test_repeated_rows(run: Run, log: Callable[..., None]) -> None:
    time = TIME.copy()
    time[7] = time[6]
    log(t=time, q=Q)
    with pytest.raises(InputError, match=r"log\.time: goes from 0\.06.* at row 7"):
        run({})
    made = run({"sources.log.time": {"column": "t", "repeated": "drop"}})
    assert len(position(made)) == N - 1


def test_npz_and_mat(run: Run, tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", t=TIME, q=np.column_stack([Q, 2 * Q]))
    savemat(tmp_path / "log.mat", {"data": {"t": TIME, "q": np.vstack([Q, 2 * Q])}, "scale": 3.0})
    made = run({"sources.log.file": "log.npz", "joints": ["a", "b"], "channels.states.position": "q"})
    np.testing.assert_array_equal(position(made), np.column_stack([Q, 2 * Q]))
    made = run(
        {
            "sources.log.file": "log.mat",
            "sources.log.time.column": "data.t",
            "sources.log.columns": {"q": {"column": "data.q", "transpose": True}, "s": "scale"},
            "channels.states.position": ["s * q[1] / 6"],
        }
    )
    np.testing.assert_allclose(position(made)[:, 0], Q)


def test_matlab_7_3_without_h5py_says_what_to_do(run: Run, tmp_path: Path) -> None:
    try:
        import h5py  # noqa: F401
    except ImportError:
        (tmp_path / "log.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(600))
        with pytest.raises(InputError, match="pip install h5py"):
            run({"sources.log.file": "log.mat"})
    else:
        pytest.skip("h5py is here")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"joint": 3}, r"m\.yaml: recordings\[0\]\.joint is not known here; known keys are"),
        ({"joints": []}, r"recordings\[0\]\.joints is \[\]"),
        ({"channels.states.position": ["q", "q"]}, r"channels\.states\.position has 2 formulas for 1 joints"),
        (
            {"channels.states.position": ["p"]},
            r"channels\.states\.position: 'p' is not known in source 'log'",
        ),
        ({"channels.states.position": {"formula": ["q"], "unit": "inch"}}, r"position\.unit: unit 'inch'"),
        ({"channels.states.effort": "derivative"}, r"states\.effort: only velocity"),
        ({"channels.motor": {"effort": ["q"]}}, r"channels\.motor is no channel; there are states"),
        ({"channels": {"command": {"position": ["q"]}}}, r"channels\.states\.position is missing"),
        ({"channels.states.source": "x"}, r"states\.source is 'x'; sources are \['log'\]"),
        ({"sources.log.time": {"column": "T"}}, r"time\.column: log\.csv has no column 'T'; it has 't', 'q'"),
        ({"sources.log.time": {"column": "t", "unit": "h"}}, r"time\.unit: unit 'h' is unknown"),
        ({"sources.log.columns": {"sin": "q"}}, r"'sin' cannot be a name"),
        ({"sources.log.columns": {"q": "Q"}}, r"columns\.q: log\.csv has no column 'Q'"),
        ({"sources.log.columns.q": {"column": "q", "missing": "guess"}}, r"q\.missing is 'guess'"),
        ({"sources.log.file": "none.csv"}, r"log\.file: no file .*none\.csv; --data"),
        ({"sources.log.file": "m.yaml"}, "m.yaml holds no samples"),
        ({"sources.log.csv": {"delimiter": ";;"}}, r"csv\.delimiter is ';;'"),
        ({"controller": {"stiffness": [1]}}, r"controller lacks damping"),
        ({"urdf": "no.urdf"}, r"urdf: no file"),
        ({"urdf": URDF.replace('"j"', '"k"')}, r"urdf moves \['k'\], it lacks \['j'\]"),
        ({"recordings": []}, "at least one"),
        ({"recordings": [{"name": "a"}, {"name": "a"}]}, "each name once"),
        ({"recordings": [{"name": "../a"}]}, "usable as a file name"),
        ({"recordings": [{"name": "a", "role": "test"}]}, r"role is 'test', must be one of fit, held_out"),
        ({"recordings": [{"name": "a", "time_range": [90, 99]}]}, r"time_range \[90, 99\] s holds no sample"),
        ({"recordings": [{"name": "a", "rows": [5]}]}, r"rows is \[5\], must be \[begin, end\]"),
        ({"recordings": [{"name": "a", "files": {"x": "y"}}]}, r"files: no source \['x'\]"),
        ({"tolerances": {"mass": "big"}}, r"tolerances"),
        ({"constants": {"k": "many"}}, r"constants\.k is 'many'"),
        ({"channels.states.position": ["q / 0"]}, r"position: 400 numbers are not finite"),
    ],
)
def test_refusals_name_the_key(run: Run, log: Callable[..., None], change: dict[str, Any], said: str) -> None:
    log(t=TIME, q=Q)
    with pytest.raises(InputError, match=said):
        run(change)


def test_text_in_a_number_column_is_named_by_row(run: Run, log: Callable[..., None]) -> None:
    log(t=TIME, q=[*Q[:-1], "oops"])
    with pytest.raises(InputError, match=r"column 'q' of log\.csv, row 399: 'oops' is no number"):
        run({})


def test_the_command_line(log: Callable[..., None], tmp_path: Path) -> None:
    log(t=TIME, q=Q)
    file = tmp_path / "m.yaml"
    file.write_text(yaml.safe_dump(BASE))
    cli = CliRunner()
    dry = cli.invoke(bag_app, ["import", str(file), "--check"])
    assert dry.exit_code == 0 and "states from log: 400 samples at 100 Hz" in dry.output
    assert cli.invoke(bag_app, ["import", str(file)]).exit_code == 2
    done = cli.invoke(bag_app, ["import", str(file), "--out", str(tmp_path / "out")])
    assert done.exit_code == 0 and (tmp_path / "out" / "one.mcap").is_file()
    assert run_command(["bag", "import", str(tmp_path / "none.yaml"), "--check"]) == 3


def test_the_worked_example_of_the_manual(tmp_path: Path) -> None:
    page = (Path(__file__).resolve().parents[2] / "msgs_docs" / "guide" / "import.md").read_text()
    (tmp_path / "mapping.yaml").write_text(page.split("```yaml\n")[1].split("```")[0])
    chain = "".join(
        f'<joint name="{joint}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        '<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="90" velocity="3"/></joint>'
        for joint, parent, child in (("shoulder", "base", "upper"), ("elbow", "upper", "lower"))
    )
    links = '<link name="base"/>' + "".join(
        f'<link name="{link}"><inertial><mass value="1"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
        for link in ("upper", "lower")
    )
    (tmp_path / "arm.urdf").write_text(f'<robot name="r">{links}{chain}</robot>')
    for run_name, size in (("run1", 20), ("run2", 30)):
        log: dict[str, Any] = {"ms": 2 * np.arange(1000)}
        q = size * np.sin(4 * np.pi * log["ms"] / 1000)
        log |= {"q1": q, "q2": -q, "target1": q, "target2": -q, "m1": q / 100, "m2": q / 100}
        (tmp_path / f"{run_name}.csv").write_text(csv_text(log))
    made = import_any(tmp_path / "mapping.yaml", tmp_path, tmp_path / "bags").made
    first = load_recordings(tmp_path / "bags" / "run1.mcap").recordings[0]
    assert [each.role for each in made] == ["fit", "held_out"]
    assert first.states.position is not None and first.commanded_effort is not None
    assert first.states.position[:, 0].max() == pytest.approx(np.radians(20), rel=1e-3)
    assert first.commanded_effort.effort is not None
    assert first.commanded_effort.effort[:, 1].max() == pytest.approx(6.0, rel=1e-3)
    assert first.arm.tolerances.mass == 0.05 and first.arm.controller is not None
