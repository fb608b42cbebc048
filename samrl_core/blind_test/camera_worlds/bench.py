"""Makes worlds of a camera, diagnoses each, and prints a line for each and the rates.

Worlds are drawn anew from `--first-seed`; recordings stay in `--folder` and are used again.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from samrl_core.blind_test.camera_worlds.plan import (
    NOTHING,
    UNKNOWN,
    CameraTruth,
    CameraWorld,
    instance_of,
    planned,
)
from samrl_core.blind_test.camera_worlds.record import CameraRecorder
from samrl_core.diagnosis.diagnose import diagnose
from samrl_core.diagnosis.result import Diagnosis


@dataclass(frozen=True)
class CameraAnswer:
    """What was said of one world."""

    world: CameraWorld
    truth: CameraTruth
    verdict: str
    named: str  # `family@place` of what was named first, or of the nearest
    among: tuple[str, ...]  # the ambiguity set
    values: dict[str, float]
    shrink: float | None
    unexplained: float

    @property
    def right(self) -> bool:
        """No gap where there is none, no name for what is unknown, else the name, alone or among others."""
        if self.truth.answer == NOTHING:
            return self.verdict == "no_gap"
        if self.truth.answer == UNKNOWN:
            return self.verdict in ("none_of_mine", "no_gap")
        if self.verdict == "ambiguous":
            return self.truth.answer in self.among
        return self.verdict == "effect" and self.named == self.truth.answer

    def line(self) -> str:
        """For the terminal."""
        w, t = self.world, self.truth
        sizes = ", ".join(f"{v:.4g}" for v in t.values)
        found = ", ".join(f"{k} {v:.4g}" for k, v in self.values.items())
        among = f" of {' '.join(self.among)}" if self.among else ""
        shrink = "-" if self.shrink is None else f"{self.shrink:.0%}"
        return (
            f"{w.name} {'right' if self.right else 'WRONG'}  {w.cause or 'nothing'} x{w.severity:g}"
            f" [{t.answer or 'no gap'} {sizes}] -> {self.verdict} {self.named}{among} ({found})"
            f" shrink {shrink}, unexplained {self.unexplained:.0%}"
        )


def answer(world: CameraWorld, truth: CameraTruth, found: Diagnosis) -> CameraAnswer:
    """From a diagnosis."""
    first = found.effects[0] if found.effects else found.nearest
    return CameraAnswer(
        world, truth, found.verdict, first.name if first else "",
        tuple(name for group in found.ambiguity_set for name in group),
        {k: p.value for k, p in first.parameters.items()} if first else {},
        None if found.gap is None else found.gap.shrink, found.unexplained_fraction,
    )  # fmt: skip


def rates(answers: Sequence[CameraAnswer]) -> list[str]:
    """One line for each kind of world."""
    groups = {
        "nothing: no gap": [a for a in answers if a.truth.answer == NOTHING],
        "unknown: not named": [a for a in answers if a.truth.answer == UNKNOWN],
    }
    for severity in sorted({a.world.severity for a in answers if a.truth.answer not in (NOTHING, UNKNOWN)}):
        groups[f"known, severity {severity:g}: family and place"] = [
            a for a in answers if a.truth.answer not in (NOTHING, UNKNOWN) and a.world.severity == severity
        ]
    return [f"{name} {sum(a.right for a in g)} of {len(g)}" for name, g in groups.items() if g]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the bench."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("out/camera_worlds"), help="keeps recordings")
    parser.add_argument("--nothing", type=int, default=3, help="worlds without a cause")
    parser.add_argument("--seeds", type=int, default=1, help="worlds per cause and severity")
    parser.add_argument("--severities", type=float, nargs="+", default=[0.5, 1.0])
    parser.add_argument("--first-seed", type=int, default=500, help="of the cells; 500 is for development")
    parser.add_argument("--only", nargs="*", help="names of worlds, as 004")
    given = parser.parse_args(arguments)
    recorder, answers = CameraRecorder(), []
    for world in planned(given.nothing, given.seeds, tuple(given.severities), given.first_seed):
        if given.only and world.name not in given.only:
            continue
        fitted, held_out = recorder.recordings(world, given.folder)
        found, _ = diagnose([fitted], [held_out])
        answers.append(answer(world, instance_of(world, recorder.cell)[1], found))
        print(answers[-1].line(), flush=True)
    print("\n".join(rates(answers)))


if __name__ == "__main__":
    main()
