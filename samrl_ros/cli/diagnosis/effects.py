"""`samrl effects`: the library of effects, as a table or one in full."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from samrl_core.common.errors import InputError
from samrl_core.common.names import known_are
from samrl_core.diagnosis.effects import EVERY_EFFECT, NOT_BY_JOINTS
from samrl_core.diagnosis.effects.effect import Effect
from samrl_ros.contract.exit_codes import OK


@dataclass(frozen=True)
class EffectsOptions:
    """Options of `samrl effects`."""

    family: Annotated[str | None, typer.Argument(help="One family in full; without it, the table.")] = None


def show_effects(options: EffectsOptions) -> int:
    """Print the table, or everything about one family.

    Raises:
        InputError: no effect of that name.
    """
    console = Console()
    if options.family is not None:
        _show_one(_find(options.family), console)
        return OK
    table = Table("no.", "family", "acts on", "places", "formula", "shown by")
    for effect in EVERY_EFFECT:
        table.add_row(
            str(effect.number),
            effect.family,
            effect.acts_on,
            effect.place_kind,
            escape(effect.formula),
            escape(effect.excitation),
        )
    console.print(table)
    for name, reason in NOT_BY_JOINTS.items():
        console.print(f"not by joint channels: {name}: {escape(reason)}", highlight=False)
    return OK


def _find(family: str) -> Effect[Any]:
    for effect in EVERY_EFFECT:
        if effect.family == family:
            return effect
    raise InputError(
        f"no effect '{family}'; {known_are(family, dict.fromkeys(e.family for e in EVERY_EFFECT))}"
    )


def _show_one(effect: Effect[Any], console: Console) -> None:
    lines = [
        f"{effect.number} {effect.family}: {effect.title}",
        effect.meaning,
        f"remedy         {effect.remedy}",
        f"formula        {effect.formula}",
        f"acts on        {effect.acts_on}, at each {effect.place_kind}",
        f"shown by       {effect.excitation} (samrl excite: {effect.experiment})",
        f"confused with  {', '.join(effect.confounded_with) or 'nothing known'}",
        f"source         {effect.source}",
    ]
    lines += [f"  {p.name} [{p.unit}]  {p.low:g} .. {p.high:g}  {p.meaning}" for p in effect.parameters]
    for line in lines:
        console.print(escape(line), highlight=False, soft_wrap=True)
