"""`samrl train`: Learn@Sim of one task, with progress on the terminal."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, read_correction
from samrl_core.cell.tasks import task_named
from samrl_core.common.errors import InputError
from samrl_core.learning.sim.regressions import EXPLAINED
from samrl_core.learning.sim.train import SUMMARY, train
from samrl_core.learning.sim.train_picture import write_picture
from samrl_core.learning.sim.train_settings import TrainSettings

LEAST_EXPLAINED = 0.05  # of the returns' variance, by a Q that is of use


DEFAULTS = TrainSettings()


@dataclass(frozen=True)
class TrainOptions:
    """Options of `samrl train`; those named like a field of `TrainSettings` are that field."""

    task: Annotated[str, typer.Argument(help="Task to learn.")]
    out: Annotated[
        Path | None, typer.Option(help="Folder of this training; out/train-TASK by default. Goes on from it.")
    ] = None
    cell: Annotated[str, typer.Option(help="Arms and camera, by name.")] = DEFAULTS.cell
    seed: Annotated[int, typer.Option(help="Of everything that is random.", min=0)] = DEFAULTS.seed
    device: Annotated[str, typer.Option(help="cpu, or cuda:0.")] = DEFAULTS.device
    states: Annotated[int, typer.Option(help="Labelled states.", min=100)] = DEFAULTS.states
    rounds: Annotated[int, typer.Option(help="Of labelling the actor's own states.", min=0)] = DEFAULTS.rounds
    episodes: Annotated[int, typer.Option(help="Episodes in the model for Q.", min=256)] = DEFAULTS.episodes
    q_target: Annotated[
        str, typer.Option(help="What Q learns: return (of an episode), or action (how near to the expert's).")
    ] = DEFAULTS.q_target
    q_loss: Annotated[
        str, typer.Option(help="How: square (eq. 24), or likelihood (where most returns are near 0).")
    ] = DEFAULTS.q_loss
    q_unit: Annotated[
        float,
        typer.Option(help="Error that leaves 1/e of an action's worth, in action limits (target action)."),
    ] = DEFAULTS.acted.unit
    actor_epochs: Annotated[int, typer.Option(help="Times that the actor sees every state.", min=1)] = (
        DEFAULTS.actor.epochs
    )
    q_epochs: Annotated[int, typer.Option(help="Times that Q sees every action.", min=1)] = DEFAULTS.q.epochs
    batch_size: Annotated[int, typer.Option(help="Images per step.", min=1)] = DEFAULTS.actor.batch_size
    max_actions: Annotated[int, typer.Option(help="Of an episode in the model; 0: the task's.", min=0)] = (
        DEFAULTS.max_actions
    )
    given_actor: Annotated[
        Path | None,
        typer.Option("--actor", help="Weights of an actor: its Q is trained, and nothing before."),
    ] = None
    kept: Annotated[
        int, typer.Option(help="Cached images of each state, rendered once; 0: new ones.", min=0)
    ] = DEFAULTS.kept
    workers: Annotated[
        int, typer.Option(help="Processes for states, labels and episodes; 0: free cores.", min=0)
    ] = DEFAULTS.workers
    visited: Annotated[
        tuple[Path, ...],
        typer.Option(help="States that a run of the cell found (its visited.npz); may be repeated."),
    ] = ()
    randomisation: Annotated[
        str, typer.Option(help="What differs between models: real2sim, uniform, adr or simopt.")
    ] = DEFAULTS.randomisation
    correction: Annotated[
        Path | None,
        typer.Option(help="cell.json of `samrl diagnose --apply`: images are wrong by what it leaves open."),
    ] = None

    def settings(self) -> TrainSettings:
        """Those of the training.

        Raises:
            InputError: see `TrainSettings`.
        """
        own = {f.name: getattr(self, f.name) for f in fields(TrainSettings) if hasattr(self, f.name)}
        fit = {
            "batch_size": self.batch_size,
            "device": self.device,
            "bfloat16": self.device.startswith("cuda"),
        }
        return replace(
            DEFAULTS,
            **own,
            acted=replace(DEFAULTS.acted, unit=self.q_unit),
            actor=replace(DEFAULTS.actor, epochs=self.actor_epochs, **fit),
            q=replace(DEFAULTS.q, epochs=self.q_epochs, **fit),
        )


def train_task(options: TrainOptions) -> int:
    """Run what is left of a training. After an interrupt the same command goes on.

    Raises:
        InputError: the settings cannot be met, or the folder is of another training or cannot be written.
        KeyboardInterrupt: interrupted.
    """
    console = Console()
    correction = NO_CORRECTION if options.correction is None else read_correction(options.correction)
    task_named(options.task)  # refused before a folder is made
    settings, out = options.settings(), options.out or Path("out") / f"train-{options.task}"

    def print_progress(stage: str, row: dict[str, float]) -> None:
        text = "  ".join(f"{name} {value:.4g}" for name, value in row.items())
        console.print(f"[bold]{stage}[/]  {text}", highlight=False, soft_wrap=True)

    try:
        summary = train(
            options.task, out, settings, print_progress, options.given_actor, options.visited, correction
        )
    except KeyboardInterrupt:
        console.print(f"interrupted; the same command goes on from {out}", highlight=False)
        raise
    except OSError as error:
        raise InputError(f"cannot write the training to {out} ({error}); give another --out") from error
    picture = out / "summary.png"
    write_picture(out, summary, picture)
    for name, found in summary["success"].items():
        console.print(
            f"{name}: {100 * found['success']:.1f} % of {found['episodes']} episodes in the model",
            highlight=False,
        )
    if summary["q"][EXPLAINED] < LEAST_EXPLAINED:
        ways = ["with --q-loss likelihood"] if options.q_loss != "likelihood" else []
        ways += ["with a larger --q-unit"] if options.q_target == "action" else []
        console.print(
            f"Q explains {100 * summary['q'][EXPLAINED]:.1f} % of what differs between returns, less than "
            f"{100 * LEAST_EXPLAINED:.0f} %: its views will hardly help; train it "
            f"{', '.join([*ways, 'longer'])}, or from a better actor",
            highlight=False,
            soft_wrap=True,
        )
    console.print(f"summary: {out / SUMMARY}\npicture: {picture}", highlight=False, soft_wrap=True)
    return 0
