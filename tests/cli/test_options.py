"""Options of a command follow from a dataclass, and what the command line gives becomes one."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from samrl_core.common.errors import InputError
from samrl_core.common.version import samrl_version
from samrl_ros.cli.learning.train import DEFAULTS, TrainOptions
from samrl_ros.cli.main import run
from samrl_ros.cli.options import add_command, command_function
from samrl_ros.contract.exit_codes import INPUT_REFUSED


@dataclass(frozen=True)
class ToyOptions:
    """One of each kind."""

    place: Annotated[str, typer.Argument(help="Where.")]
    count: Annotated[int, typer.Option(help="How many.", min=1)] = 3
    files: Annotated[tuple[Path, ...], typer.Option("--file", help="May be repeated.")] = ()
    names: Annotated[tuple[str, ...], typer.Option("--name")] = ("a", "b")
    flag: Annotated[bool, typer.Option("--flag")] = False
    made: Annotated[list[int], typer.Option("--made")] = field(default_factory=lambda: [7])
    hidden: tuple[str, ...] = ("stays",)


CALLS: list[tuple[ToyOptions, object]] = []


def toy(options: ToyOptions, context: typer.Context) -> int:
    CALLS.append((options, context.obj))
    return options.count


def invoked(*arguments: str) -> tuple[int, str]:
    CALLS.clear()
    app = typer.Typer()
    app.command("other")(lambda: None)
    add_command(app, "toy", f"{__name__}:toy", "Play.")
    result = CliRunner().invoke(app, list(arguments), obj="beside")
    return result.exit_code, result.output


def test_what_is_not_given_has_the_fields_default() -> None:
    assert invoked("toy", "here")[0] == 3
    assert CALLS == [(ToyOptions("here"), "beside")]


def test_what_is_given_becomes_the_dataclass() -> None:
    code, _ = invoked("toy", "here", "--count", "2", "--file", "x", "--file", "y", "--name", "c", "--flag")
    assert code == 2
    assert CALLS[0][0] == ToyOptions("here", 2, (Path("x"), Path("y")), ("c",), True)


def test_limits_and_types_hold_as_with_any_command() -> None:
    for arguments, why in (
        (("toy", "here", "--count", "0"), "equal to 1"),
        (("toy", "here", "--count", "one"), "--count"),
        (("toy",), "Missing argument"),
        (("toy", "here", "--hidden", "x"), "--hidden"),
    ):
        code, output = invoked(*arguments)
        assert code == 2 and why.lower() in output.lower() and not CALLS


def test_help_shows_text_limits_and_defaults() -> None:
    code, output = invoked("toy", "--help")
    assert code == 0
    for text in ("Play.", "How many.", "x>=1", "default: 3", "May be repeated.", "Where."):
        assert text in output
    assert "hidden" not in output


@dataclass(frozen=True)
class WritingOptions:
    """Of a command that writes."""

    out: Annotated[Path, typer.Option(help="Folder.")] = Path("out")


def works_long(options: WritingOptions) -> int:
    CALLS.append((ToyOptions("worked"), options.out))
    return 0


@pytest.mark.parametrize("out", ["there.csv", "there.csv/below"])
def test_a_file_in_the_way_of_the_results_is_told_before_the_work(tmp_path: Path, out: str) -> None:
    """A diagnosis of minutes ended with a traceback: `--out` was a file."""
    (tmp_path / "there.csv").touch()
    CALLS.clear()
    app = typer.Typer()
    app.command()(command_function(works_long))
    result = CliRunner().invoke(app, ["--out", str(tmp_path / out)])
    assert isinstance(result.exception, InputError) and not CALLS
    assert "there.csv is a file; give another --out" in str(result.exception)
    assert CliRunner().invoke(app, ["--out", str(tmp_path / "new" / "one")]).exit_code == 0 and CALLS
    assert not (tmp_path / "new").exists()  # looked at, not made


def test_a_file_in_the_way_is_refused_wherever_it_is_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.csv").write_text("t,q\n" + "".join(f"{k / 100},{k / 50}\n" for k in range(400)))
    (tmp_path / "m.yaml").write_text(
        "joints: [a]\nsources: {log: {file: a.csv, time: {column: t}, columns: {q: q}}}\n"
        "channels: {states: {position: {formula: [q], unit: rad}, velocity: derivative}}\n"
        "recordings: [{name: a}]\n"
    )
    assert run(["bag", "import", str(tmp_path / "m.yaml"), "--out", str(tmp_path / "a.csv")]) == INPUT_REFUSED
    assert "File exists; check the path" in capsys.readouterr().err


def test_the_version_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--version"]) == 0
    assert capsys.readouterr().out.split() == ["samrl", samrl_version()]


def test_a_function_can_be_a_command_at_once() -> None:
    app = typer.Typer()
    app.command()(command_function(toy))
    CALLS.clear()
    assert CliRunner().invoke(app, ["there"], obj=1).exit_code == 3 and CALLS == [(ToyOptions("there"), 1)]


def test_the_list_of_commands_loads_none_of_them() -> None:
    script = (
        "import sys; from samrl_ros.cli.main import run; code = run(['--help']); "
        "sys.exit('torch' in sys.modules or code)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0 and "train" in done.stdout


def test_options_of_a_training_default_to_its_settings() -> None:
    assert TrainOptions("peg_insertion").settings() == DEFAULTS


def test_options_of_a_training_reach_its_settings() -> None:
    options = TrainOptions("peg_insertion", batch_size=9, rounds=2, q_unit=0.3, actor_epochs=5, q_epochs=6)
    settings = options.settings()
    assert (settings.rounds, settings.acted.unit, settings.actor.epochs, settings.q.epochs) == (2, 0.3, 5, 6)
    assert settings.actor.batch_size == settings.q.batch_size == 9


def test_a_training_of_no_task_makes_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["train", "nosuch"]) == INPUT_REFUSED
    assert not list(tmp_path.iterdir())
