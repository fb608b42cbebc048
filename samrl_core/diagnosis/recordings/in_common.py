"""Several recordings of one arm, reduced to what all of them carry, so that they form the same equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError


def in_common(recordings: Sequence[ArmRecording]) -> tuple[list[ArmRecording], list[str]]:
    """The recordings without the channels that some of them lack, and a note for each that is left out.

    Raises:
        InputError: some have a URDF or a controller and others none: nobody can know what arm these are.
    """
    found, notes = list(recordings), []
    _all_or_none("URDF", [r.name for r in found if r.arm.urdf is None], found, "name one with --urdf")
    _all_or_none(
        "description of the controller",
        [r.name for r in found if r.arm.controller is None],
        found,
        "record the same topics in all of them, or leave these out",
    )

    def reduce(what: str, lacking: list[bool], without: list[ArmRecording]) -> None:
        nonlocal found
        if any(lacking) and not all(lacking):
            names = ", ".join(r.name for r, lacks in zip(found, lacking, strict=True) if lacks)
            notes.append(f"{what} is not used: {names} {'has' if sum(lacking) == 1 else 'have'} none")
            found = without

    reduce("the command", [r.command is None for r in found], [replace(r, command=None) for r in found])
    reduce(
        "the commanded effort",
        [r.commanded_effort is None for r in found],
        [replace(r, commanded_effort=None) for r in found],
    )
    reduce(
        "the measured effort",
        [r.states.effort is None for r in found],
        [replace(r, states=replace(r.states, effort=None)) for r in found],
    )
    return found, notes


def _all_or_none(what: str, without: list[str], recordings: Sequence[ArmRecording], remedy: str) -> None:
    if without and len(without) < len(recordings):
        have = "carries" if len(without) == 1 else "carry"
        raise InputError(f"{', '.join(without)} {have} no {what}, the others do; {remedy}")
