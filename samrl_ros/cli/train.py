"""`samrl train`: Learn@Sim of one task, with progress on the terminal."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from samrl_core.common.errors import InputError
from samrl_core.learning.data.fit_settings import FitSettings
from samrl_core.learning.images.acted_samples import ActedSettings
from samrl_core.learning.randomisation.names import REAL2SIM
from samrl_core.learning.sim.train import SUMMARY, train
from samrl_core.learning.sim.train_picture import write_picture
from samrl_core.learning.sim.train_settings import TrainSettings
from samrl_core.learning.sim.value import EXPLAINED

LEAST_EXPLAINED = 0.05  # of the returns' variance, by a Q that is of use


@dataclass(frozen=True)
class TrainOptions:
    """What the command line asks for."""

    task: str
    out: Path
    seed: int
    device: str
    states: int
    rounds: int
    episodes: int
    q_target: str
    q_loss: str
    q_unit: float
    actor_epochs: int
    q_epochs: int
    batch_size: int
    max_actions: int
    kept: int
    workers: int
    actor: Path | None = None  # weights of one; only its Q is trained then
    visited: tuple[Path, ...] = ()  # files of states that Real2Sim found
    randomisation: str = REAL2SIM


def train_task(options: TrainOptions) -> int:
    """Run what is left of a training. After an interrupt the same command goes on.

    Raises:
        InputError: the settings cannot be met, or the folder is of another training or cannot be written.
        KeyboardInterrupt: interrupted.
    """
    console = Console()
    bfloat16 = options.device.startswith("cuda")
    common = {"batch_size": options.batch_size, "device": options.device, "bfloat16": bfloat16}
    settings = TrainSettings(
        states=options.states,
        rounds=options.rounds,
        episodes=options.episodes,
        q_target=options.q_target,
        q_loss=options.q_loss,
        acted=ActedSettings(unit=options.q_unit),
        actor=FitSettings(epochs=options.actor_epochs, **common),
        q=FitSettings(epochs=options.q_epochs, **common),
        randomisation=options.randomisation,
        seed=options.seed,
        max_actions=options.max_actions,
        kept=options.kept,
        device=options.device,
        workers=options.workers,
    )

    def tell(stage: str, row: dict[str, float]) -> None:
        text = "  ".join(f"{name} {value:.4g}" for name, value in row.items())
        console.print(f"[bold]{stage}[/]  {text}", highlight=False, soft_wrap=True)

    try:
        summary = train(options.task, options.out, settings, tell, options.actor, options.visited)
    except KeyboardInterrupt:
        console.print(f"interrupted; the same command goes on from {options.out}", highlight=False)
        raise
    except OSError as error:
        raise InputError(
            f"cannot write the training to {options.out} ({error}); give another --out"
        ) from error
    picture = options.out / "summary.png"
    write_picture(options.out, summary, picture)
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
            f"{100 * LEAST_EXPLAINED:.0f} %: it will hardly know where to look; train it "
            f"{', '.join([*ways, 'longer'])}, or from a better actor",
            highlight=False,
            soft_wrap=True,
        )
    console.print(f"summary: {options.out / SUMMARY}\npicture: {picture}", highlight=False, soft_wrap=True)
    return 0
