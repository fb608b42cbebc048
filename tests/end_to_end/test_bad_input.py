"""What the command line refuses: one line with the value and the remedy, its exit code, nothing written."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from samrl_core.cell.robots.cells import cell_named
from samrl_core.common.errors import InputError
from samrl_core.policy.networks.networks import ResidualActor
from samrl_core.policy.networks.weights import WeightsInfo, save_weights, shipped
from samrl_ros.cli.main import run

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros


def refused(capfd: pytest.CaptureFixture[str], arguments: list[str], code: int = 3) -> str:
    """Run a command line that must be refused; returns the last line it printed."""
    assert run(arguments) == code
    said = capfd.readouterr().err
    assert "Traceback" not in said
    return " ".join(said.split())


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--task", "nope"], 3, ("'nope'", "peg_insertion")),
        (["--strategy", "nope"], 3, ("'nope'", "best, fixed, random")),
        (["--policy", "nope"], 3, ("'nope'", "learned, optimised, touch")),
        (["--policy", "learned", "--weights", "/no/such"], 3, ("sim_actor", "--strategy best, which need")),
        (["--strategy", "q", "--weights", "/no/such"], 3, ("/no/such", "--policy optimised")),
        (["--residual", "/no/such"], 3, ("--residual", "/no/such")),
        (["--residual", str(shipped("peg_insertion", "sensing_q"))], 3, ("sensing_q", "residual_actor")),
        (["--cell", "nope"], 3, ("'nope'", "panda_rizon")),
        (["--world", "nope"], 3, ("'nope'", "pybullet, mock")),
        (["--layout", "nope"], 3, ("'nope'", "split, processes, threads")),
        (["--episodes", "0"], 2, ("--episodes", "1")),
        (["--seed", "-1"], 2, ("--seed", "0")),
        (["--nope"], 2, ("--nope",)),
        (["--ros-args", "--nope"], 3, ("--nope",)),
        (["--ros-args", "-p", "no_value"], 3, ("no_value",)),
    ],
)
def test_an_option_that_does_not_fit(
    options: list[str], code: int, words: tuple[str, ...], tmp_path: Path, capfd: Any
) -> None:
    out = tmp_path / "out"
    said = refused(capfd, ["cell", "--out", str(out), *options], code)
    assert all(word in said for word in words), said
    assert not out.exists()


def test_a_ros_domain_with_a_cell_in_it(tmp_path: Path, capfd: Any) -> None:
    """Two cells would command each other's arms."""
    script = tmp_path / "other.py"
    script.write_text(
        "import rclpy, time\nfrom sensor_msgs.msg import JointState\n"
        "from samrl_ros.hosting.host import start_ros\nstart_ros(['other'])\n"
        "node = rclpy.create_node('other')\n"
        "publisher = node.create_publisher(JointState, '/cell/tool_arm/joint_states', 1)\n"
        "print('there', flush=True)\ntime.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE) as other:
        try:
            # Fast DDS writes its own errors to the same stream, before a node of ours says a word.
            assert other.stdout is not None and b"there\n" in other.stdout, other.poll()
            said = refused(capfd, ["cell", "--out", str(tmp_path / "out")])
        finally:
            other.kill()
    assert "ROS_DOMAIN_ID" in said and not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, ("no parameter file",)),
        ("a: [b", ("is not YAML",)),
        ("- 1", ("must name nodes",)),
        ("manipulator: {horizon: 0.04}", ("ros__parameters",)),
        ("manipulator: {ros__parameters: 3}", ("maps no names", "3")),
        ("griper: {ros__parameters: {x: 1}}", ("unknown node 'griper'", "manipulator")),
        ("/cell/manipulator: {ros__parameters: {horizzon: 0.04}}", ("'horizzon'", "leash")),
        ("manipulator: {ros__parameters: {horizon: 5.0}}", ("horizon = 5.0", "0.004 .. 0.1")),
        ("manipulator: {ros__parameters: {horizon: 1}}", ("horizon = 1", "must be a float")),
        ("manipulator: {ros__parameters: {horizon: .nan}}", ("horizon = nan", "not finite")),
        ("view_planner: {ros__parameters: {strategy: nope}}", ("'nope'", "best, fixed, random")),
        ("recorder: {ros__parameters: {out: elsewhere}}", ("'elsewhere'", "--out")),
        ("supervisor: {ros__parameters: {episodes: 7}}", ("episodes", "7", "--episodes")),
    ],
)
def test_a_parameter_file_that_does_not_fit(
    text: str | None, words: tuple[str, ...], tmp_path: Path, capfd: Any
) -> None:
    out, file = tmp_path / "out", tmp_path / "params.yaml"
    if text is not None:
        file.write_text(text)
    said = refused(capfd, ["cell", "--out", str(out), "--params", str(file)])
    assert all(word in said for word in words), said
    assert not out.exists()


def test_all_defaults_as_a_parameter_file_change_nothing(tmp_path: Path) -> None:
    from samrl_ros.cell.options import CellOptions, prepare
    from samrl_ros.docs import default_parameters

    file = tmp_path / "params.yaml"
    file.write_text(default_parameters())
    runs = {}
    for name, params in (("with", file), ("without", None)):
        options = CellOptions(task="peg_insertion", episodes=3, seed=4, out=tmp_path / name, params=params)
        runs[name] = yaml.safe_load(prepare(options).read_text())
    assert runs["with"]["/cell/manipulator"]["ros__parameters"]["leash"] == 0.02
    assert {body["ros__parameters"]["cell"] for body in runs["without"].values()} == {"panda_rizon"}
    for node, body in runs["without"].items():
        for key, value in body["ros__parameters"].items():
            expected = str(value).replace("/without/", "/with/") if isinstance(value, str) else value
            assert runs["with"][node]["ros__parameters"][key] == expected


def test_a_policy_brings_its_strategy(tmp_path: Path) -> None:
    from samrl_ros.cell.options import CellOptions, prepare

    def options(**given: str) -> CellOptions:
        return CellOptions(task="peg_insertion", episodes=1, seed=0, out=tmp_path / "out", **given)

    assert options(policy="learned").strategy == "q"
    assert options(policy="optimised").strategy == "best"
    asked = options(policy="optimised", strategy="fixed")
    written = yaml.safe_load(prepare(asked).read_text())
    planner, policy = (written[f"/cell/{node}"]["ros__parameters"] for node in ("view_planner", "policy"))
    assert (policy["policy"], planner["strategy"]) == ("optimised", "fixed")
    assert planner["weights"] == policy["weights"] == ""


def test_a_hard_peg_is_led_by_touch_unless_asked_otherwise(tmp_path: Path) -> None:
    from samrl_ros.cell.options import CellOptions, prepare

    hard = CellOptions(task="peg_insertion_hard", out=tmp_path / "hard")
    assert (hard.policy, hard.strategy) == ("touch", "best")
    written = yaml.safe_load(prepare(hard).read_text())
    node = {name: written[f"/cell/{name}"]["ros__parameters"] for name in ("policy", "view_planner")}
    assert node["policy"]["policy"] == "optimised" and node["policy"]["touch"]
    assert node["view_planner"]["touch"] and written["/cell/supervisor"]["ros__parameters"]["heed_touch"]
    plain = CellOptions(task="peg_insertion_hard", out=tmp_path / "plain", policy="optimised")
    assert "touch" not in yaml.safe_load(prepare(plain).read_text())["/cell/policy"]["ros__parameters"]
    assert CellOptions().policy == "learned"
    with pytest.raises(InputError, match="leave touch off"):
        prepare(CellOptions(task="needle_threading", out=tmp_path / "none", policy="touch"))
    assert not (tmp_path / "none").exists()


def test_make_cell_asks_for_what_there_is(tmp_path: Path) -> None:
    from samrl_ros.cell.options import CellOptions, prepare
    from tests.end_to_end.test_first_command import makefile_defaults

    asked = makefile_defaults()
    options = CellOptions(task=asked["TASK"], instance=asked["INSTANCE"], out=tmp_path / "out")
    assert f"instance: {asked['INSTANCE']}" in prepare(options).read_text()


def test_a_parameter_under_its_former_name_goes_to_its_node(tmp_path: Path) -> None:
    """Files from before `policy` acted name its parameters under `view_planner`."""
    from samrl_ros.cell.options import CellOptions, prepare

    file = tmp_path / "params.yaml"
    file.write_text("view_planner: {ros__parameters: {exploration: 0.00075, max_bad_frames: 20}}\n")
    options = CellOptions(task="peg_insertion", episodes=1, seed=0, out=tmp_path / "out", params=file)
    with pytest.warns(FutureWarning, match="exploration of view_planner is called exploration of policy"):
        written = yaml.safe_load(prepare(options).read_text())
    planner, policy = (written[f"/cell/{node}"]["ros__parameters"] for node in ("view_planner", "policy"))
    assert policy["exploration"] == 0.00075 and "exploration" not in planner
    assert planner["max_bad_frames"] == 20
    file.write_text("view_planner: {ros__parameters: {exploration: 7.0}}\n")
    with pytest.warns(FutureWarning), pytest.raises(InputError, match=r"policy: .*exploration = 7\.0"):
        prepare(replace(options, out=tmp_path / "none"))


def test_an_option_goes_to_the_node_it_is_for(tmp_path: Path) -> None:
    from samrl_ros.cell.options import CellOptions, prepare

    options = CellOptions(task="peg_insertion", episodes=1, seed=0, out=tmp_path / "plain")
    plain = yaml.safe_load(prepare(options).read_text())
    assert (
        "stop_on_model_success" not in plain["/cell/supervisor"]["ros__parameters"]
    )  # its own default, or a file's
    assert "residual" not in plain["/cell/residual_trainer"]["ros__parameters"]
    blind = yaml.safe_load(prepare(replace(options, update=False, out=tmp_path / "blind")).read_text())
    assert blind["/cell/supervisor"]["ros__parameters"]["stop_on_model_success"] is False
    assert blind["/cell/model_updater"]["ros__parameters"]["enabled"] is False
    file, training = tmp_path / "residual.safetensors", tmp_path / "training.yaml"
    about = WeightsInfo("residual_actor", "peg_insertion", cell_named().intrinsics, 0.003, 0)
    save_weights(file, ResidualActor(0.003), about)
    mine = replace(options, residual=file, out=tmp_path / "mine")
    written = yaml.safe_load(prepare(mine).read_text())["/cell/residual_trainer"]["ros__parameters"]
    assert written["residual"] == str(file.resolve())
    training.write_text("residual_trainer: {ros__parameters: {train: true, folder: somewhere}}\n")
    with pytest.raises(InputError, match="leave out --residual"):
        prepare(replace(mine, params=training, out=tmp_path / "both"))
    assert not (tmp_path / "both").exists()
    hard = CellOptions(task="peg_insertion_hard", episodes=1, seed=0, out=tmp_path / "hard")
    for given, said in (({"residual": file}, "--residual is"), ({"params": training}, "folder of residual_")):
        with pytest.raises(InputError, match=f"^{said}.*--policy touch.*leave it out"):
            prepare(replace(hard, **given))
    assert not hard.out.exists()
    prepare(replace(hard, residual=file, policy="optimised", strategy="best"))


def test_a_replay_of_an_older_run_ends_as_that_did(tmp_path: Path) -> None:
    from samrl_ros.cell.options import CellOptions, prepare
    from samrl_ros.cli.cell.replay import recorded_settings

    out = tmp_path / "run"
    file = prepare(CellOptions(task="peg_insertion", episodes=1, seed=0, out=out))
    (out / "bag").mkdir()
    assert recorded_settings(out / "bag")["supervisor"]["done_confirmations"] == 2
    older = yaml.safe_load(file.read_text())
    del older["/cell/supervisor"]["ros__parameters"]["done_confirmations"]
    file.write_text(yaml.safe_dump(older))
    assert recorded_settings(out / "bag")["supervisor"]["done_confirmations"] == 1


def test_an_out_folder_in_use_is_not_touched(tmp_path: Path, capfd: Any) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    said = refused(capfd, ["cell", "--out", str(tmp_path)])
    assert str(tmp_path) in said and "another --out" in said
    assert [p.name for p in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize("place", ["under_a_file", "proc"])
def test_an_out_folder_that_cannot_be_made(place: str, tmp_path: Path, capfd: Any) -> None:
    (tmp_path / "file").write_text("")
    out = {"under_a_file": tmp_path / "file" / "out", "proc": Path("/proc/samrl")}[place]
    assert "another --out" in refused(capfd, ["cell", "--out", str(out)])


@pytest.mark.parametrize("command", [["bag", "info"], ["bag", "repair"], ["replay"], ["replay", "--publish"]])
@pytest.mark.parametrize("what", ["nothing", "empty file", "text file", "empty folder"])
def test_what_is_no_bag(command: list[str], what: str, tmp_path: Path, capfd: Any) -> None:
    path = tmp_path / "bag.mcap"
    if what == "empty folder":
        path.mkdir()
    elif what != "nothing":
        path.write_text("" if what == "empty file" else "no bag, but text of some length\n" * 9)
    assert str(path) in refused(capfd, [*command, str(path)])
    assert not list(tmp_path.glob("*repaired*"))


def test_a_replay_report_is_not_overwritten(tmp_path: Path, capfd: Any) -> None:
    report = tmp_path / "report.json"
    report.write_text("mine")
    said = refused(capfd, ["replay", str(tmp_path / "bag"), "--out", str(report)])
    assert str(report) in said and "another --out" in said
    assert report.read_text() == "mine"
