"""Cell instances: what a name draws, and what it does not change."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.instance.cell_instance import (
    GROUPS,
    CellInstance,
    InstanceName,
    instance_named,
    read_instance_file,
    seal_instance,
)
from samrl_core.cell.instance.difference import CUT, LEVELS, differences_of
from samrl_core.cell.instance.dominant import DOMINANT
from samrl_core.cell.robots.cells import cell_named
from samrl_core.common.errors import InputError

CELL = cell_named()
EVERY_GROUP = pytest.mark.parametrize("group", sorted(GROUPS))


def values(instance: CellInstance) -> Iterator[tuple[str, str, np.ndarray]]:
    for group, kind in GROUPS.items():
        for one in fields(kind):
            yield group, one.name, np.asarray(getattr(getattr(instance, group), one.name))


def flat(instance: CellInstance, group: str) -> np.ndarray:
    return np.concatenate([v.ravel() for g, _, v in values(instance) if g == group])


def test_nominal_is_zero_everywhere() -> None:
    for group, name, value in values(instance_named("nominal", CELL)):
        assert not value.any(), (group, name)


@EVERY_GROUP
def test_every_field_says_what_it_is(group: str) -> None:
    for name, one in differences_of(GROUPS[group]).items():
        assert one.meaning and one.unit and len(one.source) > 20, (group, name)
        assert "|" not in one.meaning + one.source  # it would break the table


@pytest.mark.parametrize("level", LEVELS[1:])
def test_drawn_values_keep_to_their_law(level: str) -> None:
    """50 instances: within the law's bounds, and of about its spread."""
    drawn: dict[tuple[str, str], list[np.ndarray]] = {}
    for seed in range(50):
        for group, name, value in values(instance_named(f"{level}:{seed}", CELL)):
            drawn.setdefault((group, name), []).append(value.ravel())
    for (group, name), found in drawn.items():
        one = differences_of(GROUPS[group])[name]
        numbers, size = np.concatenate(found), one.size(level)
        assert np.abs(numbers).max() <= size * (CUT if one.law == "normal" else 1.0) * (1 + 1e-12)
        if one.law == "share":
            assert numbers.min() >= 0.5 * size
        else:
            ratio = numbers.std() / size * (1.0 if one.law == "normal" else 3**0.5)
            assert 0.7 < ratio < 1.3, (group, name, ratio)


def test_a_name_draws_the_same_and_another_another() -> None:
    one, again, other = (instance_named(n, CELL) for n in ("typical:3", "typical:3", "typical:4"))
    for group in GROUPS:
        np.testing.assert_array_equal(flat(one, group), flat(again, group))
        assert (flat(one, group) != flat(other, group)).all()


def test_development_and_test_instances_are_apart() -> None:
    for group in GROUPS:
        here, there = (flat(instance_named(n, CELL), group) for n in ("typical:3", "typical:test:3"))
        assert (here != there).all()


def test_a_careless_cell_is_the_typical_one_treated_worse() -> None:
    typical, careless = (instance_named(f"{level}:3", CELL) for level in LEVELS[1:])
    np.testing.assert_allclose(
        careless.calibration.tool_arm_zeros, 4.0 * typical.calibration.tool_arm_zeros, rtol=1e-12
    )


@EVERY_GROUP
def test_a_scale_changes_its_group_alone(group: str) -> None:
    plain, scaled = (instance_named(n, CELL) for n in ("typical:3", f"typical:3 {group}=2"))
    for other in GROUPS:
        np.testing.assert_allclose(flat(scaled, other), (2.0 if other == group else 1.0) * flat(plain, other))


@pytest.mark.parametrize("text", ["nominal", "typical:7", "careless:test:3", "typical:7 depth=2 look=0.5"])
def test_names_are_written_as_they_are_read(text: str) -> None:
    assert str(InstanceName.parse(text)) == text


def test_scales_of_the_command_line_join_the_name() -> None:
    assert str(InstanceName.parse("typical:7", ("depth=2",))) == "typical:7 depth=2"


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("", "typical:7"),
        ("typical", "typical:7"),
        ("sloppy:7", "careless"),
        ("typical:-1", "typical:7"),
        ("typical:train:7", "development"),
        ("typical:test:more:7", "typical:7"),
        ("typical:7 depht=2", "calibration"),
        ("typical:7 depth=two", "GROUP=FACTOR"),
        ("typical:7 depth=nan", "0 .. 10"),
        ("typical:7 depth=1 depth=2", "twice"),
        ("nominal depth=2", "typical:SEED"),
    ],
)
def test_names_that_are_none_are_refused_with_a_remedy(text: str, hint: str) -> None:
    with pytest.raises(InputError, match=hint.replace(".", r"\.")):
        InstanceName.parse(text)


def test_the_sealed_file_holds_every_value(tmp_path: Path) -> None:
    instance = instance_named("typical:7 depth=2", CELL)
    seal_instance(tmp_path / "evaluation" / "instance.json", instance)
    found = read_instance_file(tmp_path / "evaluation" / "instance.json")
    assert found["name"] == "typical:7 depth=2"
    for group, name, value in values(instance):
        np.testing.assert_array_equal(found["differences"][group][name], value)
    with pytest.raises(InputError, match="no cell instance"):
        read_instance_file(tmp_path / "instance.json")


@pytest.mark.parametrize("name", sorted(DOMINANT))
def test_an_error_that_stands_out_is_added_to_its_fields_alone(name: str) -> None:
    plain, one, two = (instance_named(f"typical:7{end}", CELL) for end in ("", f" {name}=1", f" {name}=2"))
    before = {(g, n): v for g, n, v in values(plain)}
    once, twice = ({(g, n): v - before[g, n] for g, n, v in values(i)} for i in (one, two))
    assert {key for key, v in once.items() if v.any()} == {
        (DOMINANT[name].group, field) for field in DOMINANT[name].sizes
    }
    for field, (size, _) in DOMINANT[name].sizes.items():
        added = once[DOMINANT[name].group, field]
        assert np.linalg.norm(added) == pytest.approx(size)
        np.testing.assert_allclose(twice[DOMINANT[name].group, field], 2 * added, atol=1e-15)
    assert str(two.name) == f"typical:7 {name}=2"


def test_names_of_errors_and_of_groups_differ() -> None:
    assert not set(DOMINANT) & set(GROUPS)
    with pytest.raises(InputError, match="hand_eye"):
        InstanceName.parse("typical:7 wobble=2")
