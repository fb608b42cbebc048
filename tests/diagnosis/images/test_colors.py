"""Light told from the colours of painted surfaces: as sure as is said, also where a colour ends at white."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from samrl_core.cell.types.image_recording import ImageTolerances
from samrl_core.diagnosis.effects.images.lighting import EFFECT
from samrl_core.diagnosis.kinds.images.light_advice import CARD, LOCKED, advise_on_light, light_seen_from
from samrl_core.diagnosis.residuals.images.colors import TINTS, ComparedColors, compare_colors
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial
from samrl_core.diagnosis.residuals.images.rows import Rows
from samrl_core.diagnosis.residuals.images.scene import OBJECT, STATIC
from samrl_core.diagnosis.residuals.images.spreads import stated_spreads
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence
from samrl_core.diagnosis.verdict.least_sizes import least_sizes

BLOCK, TABLE = np.array([0.72, 0.30, 0.13]), np.array([0.53, 0.53, 0.53])
FACES = np.array([1.0, 1.0, 0.6, 0.35])  # of the block, how far they are lit
EXPECTED = np.concatenate([FACES[:, None] * BLOCK, np.tile(TABLE, (4, 1))])
GROUP, LIT = np.repeat([OBJECT, STATIC], 4), np.repeat([BLOCK, TABLE], 4, axis=0)
STATED = ImageTolerances()


def compared(light: float, paint: np.ndarray, table: np.ndarray, tint: float) -> ComparedColors:
    """Of a block with some paint more (3,) on a table whose colours are off by logarithms (3,)."""
    true = np.concatenate([FACES[:, None] * (BLOCK + paint), np.tile(TABLE * np.exp(table), (4, 1))])
    seen = np.minimum(true * np.exp(light + tint * TINTS[0]), 1.0)
    return compare_colors(EXPECTED, seen, GROUP, LIT)


def _painted(paint: np.ndarray, lit: float) -> np.ndarray:
    """What a block has more (3,) of each colour, its paint in half widths, and lit better by a logarithm."""
    return (BLOCK + STATED.paint * paint) * np.exp(lit) - BLOCK


def told(light: float, paint: np.ndarray, table: np.ndarray, tint: float) -> tuple[float, float]:
    """Logarithm of the light and its standard deviation, by least squares with all tolerances as stated."""
    of = compared(light, paint, table, tint)
    spreads = {**stated_spreads(STATED), "light": np.array([10.0])}
    design = np.concatenate([(spreads[n][:, None] * c / (0.05 * of.noise)) for n, c in of.columns.items()]).T
    covariance = np.linalg.inv(design.T @ design + np.eye(design.shape[1]))
    found = covariance @ design.T @ (of.value / (0.05 * of.noise))
    assert next(iter(of.columns)) == "light"
    return 10.0 * float(found[0]), 10.0 * float(np.sqrt(covariance[0, 0]))


@pytest.mark.parametrize(("light", "surest"), [(-0.6, 0.1), (0.0, 0.1), (0.7, 0.15)])
def test_light_is_known_as_well_as_is_said(light: float, surest: float) -> None:
    """Cells as typical ones are painted: each colour of the block by itself, a table that is darker.

    At 0.7 red ends at white. Taken for a difference of brightness, paint was told from light by the shade of
    the faces, and the deviation that was stated was less than half of the error.
    """
    rng = np.random.default_rng(0)
    by = STATED.deviation
    found = np.array(
        [
            told(
                light,
                _painted(rng.uniform(-1, 1, 3), by * STATED.shading * rng.standard_normal()),
                rng.normal([-0.1, -0.2, -0.3], 0.12),
                by * STATED.tint * rng.standard_normal(),
            )
            for _ in range(300)
        ]
    )
    error, said = found[:, 0] - light, found[:, 1]
    assert said.max() < surest
    assert abs(error.mean()) < 0.5 * surest
    assert 0.6 < np.sqrt(np.mean(error**2)) / said.mean() < 1.15


def test_a_colour_at_white_says_nothing_of_the_light() -> None:
    """As if the block had no red: what green and blue say is not said once more by what is made of them."""
    darker = np.array([0.0, -0.05, -0.02])
    with_red = told(0.7, darker, np.zeros(3), 0.0)
    other_red = told(0.7, darker + [0.05, 0.0, 0.0], np.zeros(3), 0.0)
    assert with_red == pytest.approx(other_red, abs=2e-3)
    assert with_red[1] > 1.3 * told(0.0, darker, np.zeros(3), 0.0)[1]


@dataclass(frozen=True)
class OfColors:
    """What effects ask of a recording."""

    tolerances: ImageTolerances
    camera: str = "camera"
    name: str = "A"
    duration: float = 1.0


def cell(
    light: float, paint: np.ndarray, table: np.ndarray, tint: float, stated: ImageTolerances = STATED
) -> Evidence:
    """Evidence of brightness alone, all noise as stated; arguments as of `told`."""
    of = compared(light, paint, table, tint)
    trial = cast(Any, object.__new__(ImageTrial))
    trial.recording = OfColors(stated)
    trial.channels, trial.cached, trial.frames = ("color",), {}, ()
    arms = SimpleNamespace(
        camera_arm=SimpleNamespace(joint_names=()), tool_arm=SimpleNamespace(joint_names=())
    )
    trial.constants = SimpleNamespace(
        scene=SimpleNamespace(body="block", cell=arms, table_grey=float(TABLE[0]))
    )
    trial._rows = {
        "color": Rows(of.value, np.zeros(len(of.value), dtype=int), of.noise, of.columns, of.surface)
    }
    trial._sigma = {"color": 0.05 * of.noise}
    return Evidence(Likelihood([trial]), 1.0)


def test_a_lamp_that_is_there_is_not_promised_once_more() -> None:
    """What is seen upwards is counted from what is stated, however bright the images are already."""
    ends = []
    for light in (0.0, 0.5):
        made = cell(light, np.zeros(3), np.zeros(3), 0.0)
        (said,) = least_sizes(made, made.screen([EFFECT]), 8.0)
        ends.append(np.log1p(said.stated[1]))
    assert ends[1] == pytest.approx(ends[0], abs=0.1)


def test_half_of_the_lamps_of_the_least_size_are_named() -> None:
    """Red of the block ends at white there: as images without a lamp tell, a weaker one would be seen."""
    nominal = cell(0.0, np.zeros(3), np.zeros(3), 0.0)
    (said,) = least_sizes(nominal, nominal.screen([EFFECT]), 8.0)
    down, up = np.log1p(said.stated)
    assert BLOCK[0] * np.exp(up) > 1.0, "no colour ends at white: the test shows nothing"
    assert up > 1.1 * -down, "as if all colours told of it"
    assert 0.3 < _named(up, STATED) < 0.8
    assert 0.3 < _named(down, STATED) < 0.8


def _named(light: float, stated: ImageTolerances) -> float:
    """Share of cells with a light off by a logarithm in which it is named, all else off as is stated."""
    rng, by, count, of = np.random.default_rng(0), stated.deviation, 60, 0
    for _ in range(count):
        own = by * stated.brightness * rng.standard_normal()
        made = cell(
            light + own,
            _painted(rng.uniform(-1, 1, 3), by * stated.shading * rng.standard_normal()),
            by * stated.table_paint * rng.standard_normal(3) @ [[1, 1, 1], *TINTS] / TABLE,
            by * stated.tint * rng.standard_normal(),
            stated,
        )
        of += max(made.fit([h]).log_evidence for h in made.screen([EFFECT])) >= 8.0
    return of / count


@pytest.mark.parametrize("known", [{"table_paint": CARD}, {"table_paint": CARD, "brightness": LOCKED}])
def test_a_card_of_known_grey_shows_a_weaker_light_as_the_report_says(known: dict[str, float]) -> None:
    """At the sizes that are advised every other light is named; without the card it passes."""
    nominal = cell(0.0, np.zeros(3), np.zeros(3), 0.0)
    before, after = light_seen_from(nominal, 8.0), light_seen_from(nominal, 8.0, **known)
    assert before is not None and after is not None
    (low, high), (down, up) = np.log1p(before.stated), np.log1p(after.stated)
    assert 0.0 < up < 0.8 * high and 0.0 > down > 0.85 * low
    assert 0.3 < _named(up, replace(STATED, **known)) < 0.8
    assert 0.3 < _named(down, replace(STATED, **known)) < 0.8
    assert _named(down, STATED) < 0.3
    (said,) = advise_on_light(nominal, 8.0)
    shown = " or ".join(f"{end:+.0%}" for end in after.stated)
    assert shown in said and f"{TABLE[0]:.2f} of white" in said
