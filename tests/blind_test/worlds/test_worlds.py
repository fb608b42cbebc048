"""Plans, labels and seals: repeatable, complete, and silent about the truth."""

from __future__ import annotations

import ast
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from samrl_core.blind_test.disturbances.registry import CATALOGUE, DISTURBANCES, OUTSIDE
from samrl_core.blind_test.engines.engines import ENGINES
from samrl_core.blind_test.engines.simulate import DivergedError
from samrl_core.blind_test.second_set.registry import SECOND_OUTSIDE, form_of
from samrl_core.blind_test.worlds.plan import (
    ForgeSettings,
    PlanItem,
    PlannedEffect,
    plan_worlds,
    seed_from_commit,
)
from samrl_core.blind_test.worlds.world import make_world
from samrl_core.common.errors import InputError

EFFECT = PlannedEffect("coulomb_friction", "joint:panda_joint4", "T1", 0.5, None)
ITEM = PlanItem("w000", "single", "pybullet", "tool_arm", 1, (EFFECT,), 1.0, 11, 0.4)


def test_default_plan_has_the_numbers_asked_for() -> None:
    plan = plan_worlds(ForgeSettings(seed=3))
    kinds = [item.set for item in plan]
    assert [kinds.count(k) for k in ("single", "none", "outside", "double")] == [174, 60, 42, 24]
    for engine in ENGINES:
        assert sum(item.engine == engine for item in plan) == 100
        assert all(any(i.engine == engine for i in plan if i.set == k) for k in set(kinds))
    single = [i.effects[0] for i in plan if i.set == "single"]
    assert {e.family for e in single} == set(CATALOGUE)
    assert all(sum(e.series == 2 for e in single if e.family == f) == 3 for f in CATALOGUE)
    assert all({"T0", "T1"} == {e.form for e in single if e.family == f and e.series == 1} for f in CATALOGUE)
    assert all(e.form == form_of(e.family) for i in plan for e in i.effects if e.series == 2)
    assert {e.severity for e in single if e.series == 2} == {e.severity for e in single if e.series == 1}
    assert {e.severity for e in single} == {0.1, 0.25, 0.5, 0.75, 0.95}
    assert {i.effects[0].family for i in plan if i.set == "outside"} == {*OUTSIDE, *SECOND_OUTSIDE}
    assert sum(i.scale > 1 for i in plan) == 100 and max(i.scale for i in plan) <= 2.0
    assert {i.programme for i in plan} == set(range(6))
    assert any(e.onset for i in plan for e in i.effects)
    assert sum(a == b for a, b in zip(kinds, kinds[1:], strict=False)) < 250  # shuffled


def test_plan_follows_its_seed_alone() -> None:
    assert plan_worlds(ForgeSettings(seed=5)) == plan_worlds(ForgeSettings(seed=5))
    assert plan_worlds(ForgeSettings(seed=5)) != plan_worlds(ForgeSettings(seed=6))
    commit = "e8ca69c1f0"
    assert (
        seed_from_commit(commit) == seed_from_commit(commit.upper() + "\n") != seed_from_commit("e8ca69c1f1")
    )
    with pytest.raises(InputError, match="hexadecimal"):
        seed_from_commit("main")
    with pytest.raises(InputError, match="MuJoCo"):
        ForgeSettings(single=3, none=0, outside=0, double=0, mujoco=4, pinocchio=0)


def test_a_world_repeats_itself() -> None:
    first, second = make_world(ITEM), make_world(ITEM)
    assert json.dumps(first[1]) == json.dumps(second[1])
    assert list(first[0]) == ["A", "B", "C"]
    for letter, recording in first[0].items():
        assert np.array_equal(recording.states.effort, second[0][letter].states.effort)
        assert np.array_equal(recording.states.time, second[0][letter].states.time)
    assert np.array_equal(first[2].effect_states.position, second[2].effect_states.position)


def test_recordings_say_nothing_of_the_label() -> None:
    silent = make_world(replace(ITEM, effects=(), set="none"))[0]
    for letter, recording in make_world(ITEM)[0].items():
        text = repr(recording).replace(repr(recording.arm.tolerances), "")
        for word in (*DISTURBANCES, "severity", "T0", "T1", "pybullet", "mujoco", "w000", "seed"):
            assert word not in text
        # Everything but the measurements is that of a world without any effect.
        assert repr(recording.arm) == repr(silent[letter].arm)
        assert (recording.name, recording.source, recording.phases) == (letter, "", ())
        assert np.array_equal(recording.command.position, silent[letter].command.position)
        for signal in (recording.states, recording.command, recording.commanded_effort):
            assert (np.diff(signal.time) > 0).all() and signal.time[0] >= 0


def test_background_is_within_its_scale_and_never_absent() -> None:
    for scale in (1.0, 2.0):
        label = make_world(replace(ITEM, effects=(), set="none", scale=scale, seed=21))[1]["background"]
        assert np.abs(label["link_mass_error"]).max() <= 0.02 * scale
        assert np.abs(label["link_center_of_mass_error_m"]).max() <= 0.002 * scale
        assert np.abs(label["base_tilt_rad"]).max() <= 0.0005 * scale
        assert np.ptp(label["stamp_offsets_s"]) <= 0.0002 * scale
        for name in ("link_mass_error", "drive_offset_nm", "sensor_offset_nm", "coulomb_nm", "base_tilt_rad"):
            assert np.abs(label[name]).min() > 0


@pytest.mark.parametrize("engine", ENGINES)
def test_oracle_is_the_held_out_recording_without_background(engine: str) -> None:
    recordings, label, oracle = make_world(replace(ITEM, engine=engine))
    measured, j = recordings["C"], 3
    gap = measured.states.effort - measured.commanded_effort.effort
    told = oracle.effect_states.effort - oracle.effect_commanded.effort
    bare = oracle.nominal_states.effort - oracle.nominal_commanded.effort
    assert np.std((gap - told)[:, j]) < 0.7 * np.std((gap - bare)[:, j])
    assert label["effects"][0]["parameters"]["Fc"]["unit"] == "N m"


def test_places_are_checked() -> None:
    wrong = replace(EFFECT, place="joint:rizon_joint4")
    with pytest.raises(InputError, match="no place"):
        make_world(replace(ITEM, effects=(wrong,)))


def test_a_world_that_runs_away_is_loud(monkeypatch: pytest.MonkeyPatch) -> None:
    from samrl_core.blind_test.disturbances.disturbance import Injection
    from samrl_core.blind_test.worlds import world

    def push(hooks: object, rng: object) -> None:
        hooks.external.append(lambda t, q, v: 50.0 * v)  # ty: ignore[missing-attribute]

    monkeypatch.setattr(world, "_inject", lambda *_: Injection({}, push))
    with pytest.raises(DivergedError, match="range"):
        make_world(ITEM)


def test_forge_knows_nothing_of_the_diagnosis() -> None:
    import samrl_core.blind_test as package

    folder = Path(package.__file__).parent
    files = [f for room in ("engines", "disturbances", "worlds") for f in (folder / room).rglob("*.py")]
    assert len(files) > 40
    for path in files:
        for node in ast.walk(ast.parse(path.read_text())):
            module = getattr(node, "module", None) or "" if isinstance(node, ast.ImportFrom) else ""
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            for name in (module, *names):
                assert not name.startswith(("samrl_core.diagnosis", "samrl_ros"))
