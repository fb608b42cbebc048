"""What the commands of `samrl forge` share: worlds made and sealed, a bar, and what failed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import typer
from rich.markup import escape

from samrl_core.blind_test.scores.study import Study
from samrl_core.common import executor
from samrl_ros.blind_test.study import versions
from samrl_ros.cli.blind_test.show import console as make_console
from samrl_ros.cli.progress import with_progress
from samrl_ros.contract.exit_codes import FAILED


def make_and_seal(
    study: Study,
    plan: Sequence[str],
    make: Callable[[Any], Any],
    todo: Sequence[Any],
    facts: dict[str, Any],
    ran: type[Exception],
    workers: int,
    ray: bool,
) -> None:
    """Make what is missing of a plan's worlds, then seal all, or name what failed.

    Args:
        plan: ids of all worlds, in their order.
        make: makes one of `todo`, each with an `item` that has an id.
        facts: of forge.json.
        ran: error of a world that ran away; it is left out.
    """
    screen = make_console()
    failed: dict[str, str] = {}
    ran_away: list[str] = []
    for part in ("obs", "sealed"):
        study.sweep(part)
    for done in with_progress(
        "worlds", make, todo, len(plan), mapping_of(ray, executor.run_in_processes), workers
    ):
        if isinstance(done.error, ran):
            ran_away.append(done.item.item.id)
        elif done.error is not None:
            failed[done.item.item.id] = f"{type(done.error).__name__}: {done.error}"
    order = [world for world in plan if study.made(world)]
    facts = {"schema": 1, **facts, "versions": versions(), "ran_away": sorted(ran_away)}
    if ran_away:  # no arm could be recorded like this, and nobody samples it again until it suits
        screen.print(f"{len(ran_away)} worlds ran away in simulation and are left out: {sorted(ran_away)}")
    if failed:
        screen.print("[red]nothing is sealed[/] while worlds are missing; the same command tries them again")
    name_failed("not made", failed)
    if not study.forge_file.exists():
        study.seal(order, facts)
    screen.print(
        f"{len(order)} worlds in {study.root}, labels sealed: sha256 {study.published()['sealed_sha256']}"
    )


def name_failed(what: str, failed: dict[str, str]) -> None:
    """Say at the end what could not be done; one failure does not stop the hours of the others."""
    console = make_console()
    for name, why in failed.items():
        console.print(f"[red]{what}[/] {name}: {escape(why)}", soft_wrap=True)
    if failed:
        raise typer.Exit(FAILED)


def mapping_of(
    ray: bool, local: Callable[..., Iterator[executor.Done]]
) -> Callable[..., Iterator[executor.Done]]:
    """Over a Ray cluster, or what does it here."""
    return executor.run_on_ray if ray else local
