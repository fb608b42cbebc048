"""A world made as the command makes it, sealed, and its oracle read back by the scores."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from samrl_core.blind_test.scores.shrink_scores import shrinks_of
from samrl_core.blind_test.scores.study import Study
from samrl_core.blind_test.worlds import world
from samrl_core.blind_test.worlds.plan import PlanItem, PlannedEffect
from samrl_ros.blind_test.runs import Making, make
from samrl_ros.recordings.read import read_recordings

EFFECT = PlannedEffect("viscous_friction", "joint:panda_joint4", "T0", 0.95, None)
ITEM = PlanItem("w007", "single", "pybullet", "tool_arm", 0, (EFFECT,), 1.0, 5, 0.6)


@pytest.fixture
def study(short_worlds: None, tmp_path: Path) -> Study:

    made = Study(tmp_path / "study")
    make(Making(made.root, ITEM))
    return made


def test_a_made_world_is_whole_and_its_oracle_is_what_the_scores_need(study: Study, tmp_path: Path) -> None:
    assert study.made("w007")
    assert sorted(p.name for p in study.observations("w007").iterdir()) == ["A.mcap", "B.mcap", "C.mcap"]
    study.plan.write_text('{"settings": {"seed": 77}}')
    published = study.seal(["w007"], {"commit": None})
    assert "77" not in json.dumps({k: v for k, v in published.items() if k != "sealed_sha256"})
    sealed = study.open_seal()
    assert sealed.labels()["w007"]["effects"][0]["family"] == "viscous_friction"
    oracle = sealed.oracle("w007")
    assert oracle is not None and set(oracle) >= {
        "time", "effect_position", "effect_velocity", "effect_effort", "effect_commanded_effort",
        "scale_position", "scale_velocity", "scale_effort", "scale_commanded_effort",
    }  # fmt: skip

    # A diagnosis that re-simulates the truth itself shrinks as far as the oracle, one without an effect not.
    (held_out,) = read_recordings(study.observations("w007") / "C.mcap")
    time = oracle["time"]
    measured = {
        "position": held_out.states.position,
        "velocity": held_out.states.velocity,
        "effort": held_out.states.effort,
    }
    arrays = {"time": time}
    nominal_run = world._nominal("tool_arm", 0, 0.6, "pybullet")
    for name, values in measured.items():
        assert values is not None
        columns = [np.interp(time, held_out.states.time, column) for column in values.T]
        arrays[f"{name}_measured"] = np.stack(columns, axis=1)
        arrays[f"{name}_nominal"] = getattr(nominal_run, name)
        arrays[f"{name}_with_effect"] = oracle[f"effect_{name}"]
    np.savez(tmp_path / "resimulation.npz", **arrays)
    found = shrinks_of(tmp_path / "resimulation.npz", oracle)
    assert found.oracle_shrink is not None and found.oracle_shrink > 0.2
    assert found.shrink == pytest.approx(found.oracle_shrink, abs=1e-6)
    assert oracle["oracle_effect"] < oracle["oracle_nominal"]


def test_what_is_kept_is_used_and_a_cut_file_is_made_anew(study: Study, tmp_path: Path) -> None:
    (path,) = (tmp_path / "cache" / "samrl" / "forge" / "nominal").glob("*.npz")
    first = world._nominal("tool_arm", 0, 0.6, "pybullet").effort.copy()
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    np.savez(path, **(arrays | {"effort": arrays["effort"] + 1.0}))
    world._nominal.cache_clear()
    assert np.allclose(world._nominal("tool_arm", 0, 0.6, "pybullet").effort, first + 1.0)
    path.write_bytes(path.read_bytes()[:1000])
    world._nominal.cache_clear()
    assert np.array_equal(world._nominal("tool_arm", 0, 0.6, "pybullet").effort, first)
