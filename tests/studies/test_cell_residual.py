"""A residual of one careless cell: cells are chosen before it is learnt, and pairs say what it gained."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from samrl_core.common.errors import InputError
from samrl_core.studies import cell_residual
from samrl_core.studies.episodes.residual_episodes import EpisodeSite, Order, Played
from samrl_core.studies.experiment import Options
from samrl_core.studies.paper import residual_trainings
from samrl_core.studies.paper.residual_evaluation import RunSettings
from tests.learning import toy_cell
from tests.learning.small_cell import SMALL
from tests.studies.test_residual_run import SETTINGS, FakeCell

SUCCESSES = {7: 0, 8: 2, 9: 4, 10: 3, 11: 1}  # of the screening's episodes, by the cell's number


def test_a_cell_needs_something_to_gain_and_something_to_learn_from() -> None:
    some = [[True] * hits + [False] * (4 - hits) for hits in SUCCESSES.values()]
    assert cell_residual.cells_to_learn_in(some) == [1, 3]
    assert cell_residual.cells_to_learn_in(some[::2]) == [2]
    assert cell_residual.cells_to_learn_in(some[:1]) == []


def test_gain_is_counted_in_pairs() -> None:
    first = [{"outcomes": [True, False, False]}, {"outcomes": []}, {"outcomes": [True, True, True]}]
    second = [{"outcomes": [True, False]}, {"outcomes": [False, True]}]
    found = cell_residual.gain_of([first, second])
    assert (found["won"], found["lost"]) == (3, 1) and found["p"] == pytest.approx(5 / 16)
    assert (found["before"]["successes"], found["after"]["successes"], found["after"]["trials"]) == (2, 4, 5)


def test_an_instance_is_a_place_of_its_own() -> None:
    plain = EpisodeSite("spatula_flipping_hard", "touch", None, (0.0, 0.0, 0.0))
    there = replace(plain, instance="careless:test:7")
    assert there.name == "spatula_flipping_hard-careless-test-7" and plain.name == plain.task
    assert there.max_actions == 56 > plain.max_actions


@pytest.mark.thorough
def test_cells_are_chosen_first_and_what_is_found_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    orders: list[Order] = []
    toy = FakeCell()

    def play(order: Order) -> Played:
        orders.append(order)
        return _screened(order) if order.max_actions == 56 else toy.play(order)

    def _screened(order: Order) -> Played:
        number = int(order.site.instance.split(":")[-1])
        episode = sum(o.site == order.site for o in orders[: orders.index(order)])
        return Played((), "done", "", episode < SUCCESSES.get(number, 4), 0.0)

    def settings(points: tuple[int, ...], max_actions: int) -> RunSettings:
        assert max_actions == 56
        return replace(SETTINGS, points=points)

    monkeypatch.setattr(residual_trainings, "cell_named", lambda name: SMALL)
    monkeypatch.setattr(residual_trainings, "nominal_encoder", lambda *_: toy_cell.ENCODER)
    monkeypatch.setattr(residual_trainings, "play", play)
    monkeypatch.setattr(cell_residual, "RunSettings", settings)
    options = Options(tmp_path, ("spatula_flipping_hard",), 6, 7, workers=1, conditions=("careless_test",))
    told: list[str] = []
    first = cell_residual.EXPERIMENT.result(options, told.append)
    assert told[0] == "spatula_flipping_hard: learns in careless:test:8, careless:test:10"
    played = len(orders)
    assert cell_residual.EXPERIMENT.result(options, told.append) == first and len(orders) == played
    found: dict[str, Any] = json.loads((tmp_path / "cell_residual.json").read_text())
    assert list(found["cells"]) == [f"spatula_flipping_hard careless:test:{n}" for n in (8, 10)]
    assert [one["point"] for one in found["cells"]["spatula_flipping_hard careless:test:8"]["curve"]] == [
        0,
        6,
    ]
    assert found["gain"]["spatula_flipping_hard"]["before"]["trials"] == 2 * SETTINGS.evaluated
    assert len(list(tmp_path.rglob("spatula_flipping_hard_residual_actor.safetensors"))) == 4
    assert (tmp_path / "cell_residual.png").stat().st_size > 1000
    # No episode that something is learnt from is one that it is judged by, nor another cell's.
    learnt = {o.seed for o in orders if o.max_actions != 56 and o.exploration > 0}
    judged = {o.seed for o in orders if o.max_actions != 56 and o.exploration == 0}
    assert learnt and judged and not learnt & judged


def test_a_peg_that_is_led_by_touch_has_no_residual_to_learn(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="peg_insertion_hard"):
        cell_residual.EXPERIMENT.result(Options(tmp_path, ("peg_insertion_hard",), workers=1), print)
