"""Worlds of a camera: one cause each, the same whenever they are asked for, and answers that can be wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.blind_test.camera_worlds.bench import CameraAnswer, rates
from samrl_core.blind_test.camera_worlds.plan import (
    CAUSES,
    NOTHING,
    OUTSIDE,
    UNKNOWN,
    CameraTruth,
    CameraWorld,
    instance_of,
    planned,
)
from samrl_core.cell.instance.cell_instance import GROUPS
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.effects import IMAGE_EFFECTS


def _values(instance: object) -> dict[str, np.ndarray]:
    groups = {g: getattr(instance, g) for g in GROUPS}
    return {f"{g}.{n}": np.asarray(v) for g, group in groups.items() for n, v in vars(group).items()}


def test_a_cause_changes_one_group_of_its_cell() -> None:
    cell = cell_named(DEFAULT_CELL)
    families = {e.family for e in IMAGE_EFFECTS}
    for cause in CAUSES:
        world = CameraWorld("x", 7, "typical", cause, 1.0)
        there, truth = instance_of(world, cell)
        plain, _ = instance_of(replace(world, cause=NOTHING), cell)
        a, b = _values(there), _values(plain)
        changed = {name.partition(".")[0] for name in a if not np.array_equal(a[name], b[name])}
        assert len(changed) == 1, cause
        assert (truth.answer == UNKNOWN) == (cause in OUTSIDE)
        if cause not in OUTSIDE:
            assert truth.answer.partition("@")[0] in families
        again, _ = instance_of(world, cell)
        assert all(np.array_equal(v, _values(again)[n]) for n, v in a.items())
    with pytest.raises(InputError, match="no cause is called"):
        instance_of(CameraWorld("x", 7, "typical", "gremlin", 1.0), cell)


def test_worlds_are_cells_of_their_own() -> None:
    made = planned(2, 1, (0.5, 1.0), 500)
    assert len({w.seed for w in made}) == len(made) == 2 + 2 * (len(CAUSES) - len(OUTSIDE)) + len(OUTSIDE)
    assert [w.cause for w in made[:2]] == [NOTHING, NOTHING]


def test_answers_are_right_only_where_they_are() -> None:
    world = CameraWorld("004", 1, "typical", "hand_eye", 1.0)
    known = CameraTruth("hand_eye@sensor:camera", (0.005,))
    said = CameraAnswer(world, known, "effect", "hand_eye@sensor:camera", (), {"x": 0.004}, 0.7, 0.1)
    assert said.right and "right" in said.line()
    assert not replace(said, named="base_to_base@cell").right
    assert not replace(said, verdict="none_of_mine").right
    assert replace(said, verdict="ambiguous", among=("base_to_base@cell", known.answer)).right
    assert not replace(said, truth=CameraTruth(NOTHING, ())).right
    assert not replace(said, truth=CameraTruth(UNKNOWN, ())).right
    nothing = replace(said, truth=CameraTruth(NOTHING, ()), verdict="no_gap", named="")
    assert nothing.right
    assert rates([said, nothing]) == ["nothing: no gap 1 of 1", "known, severity 1: family and place 1 of 1"]
