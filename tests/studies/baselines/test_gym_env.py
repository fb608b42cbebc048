"""The environment passes Gymnasium's own checks, pays what the paper pays, and shows no truth."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import TASKS
from samrl_core.cell.tasks.peg_insertion.task import BODY
from samrl_core.common.errors import InputError
from samrl_core.policy.networks.network_image import XYZ_UNIT

pytest.importorskip("gymnasium", reason="needs the extra `baselines`")


@pytest.mark.parametrize("task", ["peg_insertion", pytest.param("needle_threading", marks=pytest.mark.slow)])
@pytest.mark.filterwarnings("ignore:.*not within the observation space bounds.*")
def test_gymnasium_finds_nothing_wrong(task: str) -> None:
    from gymnasium.utils.env_checker import check_env

    from samrl_core.studies.baselines.gym_env import CellEnv

    env = CellEnv(task, render_mode="rgb_array")
    check_env(env, skip_render_check=True)
    picture = env.render()
    assert picture is not None and picture.shape == (128, 128, 3) and picture.std() > 5
    env.close()
    env.close()


def test_observations_rewards_and_refusals() -> None:
    from gymnasium import spaces

    from samrl_core.studies.baselines.gym_env import CellEnv

    env = CellEnv("peg_insertion")
    first, info = env.reset(seed=3)
    assert env.observation_space.contains(first) and set(info) == {"success", "final_error", "refused"}
    again, _ = env.reset(seed=3)
    other, _ = env.reset()
    assert np.array_equal(first["image"], again["image"])
    assert not np.allclose(first["image"][3:], other["image"][3:], atol=0.05)
    env.reset(seed=3)
    assert isinstance(env.action_space, spaces.Box)
    limit = float(env.action_space.high[0])
    down = np.array([0.0, 0.0, -limit], dtype=np.float32)
    seen, reward, terminated, truncated, info = env.step(down)
    assert seen["tip"][2] - first["tip"][2] == pytest.approx(-limit, abs=0.003)
    assert reward == pytest.approx(-info["final_error"]) and -0.3 < reward < 0
    assert not (terminated or truncated or info["refused"])
    at = seen["tip"]
    seen, *_ = env.step(np.full(3, limit, dtype=np.float32))  # a corner of the cube: shortened to the limit
    assert np.linalg.norm(seen["tip"] - at) == pytest.approx(limit, abs=0.003)
    for bad in (2 * down, np.full(3, np.nan), np.zeros(2)):
        with pytest.raises(InputError, match="three numbers within"):
            env.step(bad)
    env.close()


def test_the_world_of_the_sample_efficiency() -> None:
    """The calibration is off: what is seen lies elsewhere by as much. Episodes are as long as there."""
    from samrl_core.studies.baselines.gym_env import CellEnv, differing_env
    from samrl_core.studies.episodes.differing_world import differing_cell, differing_settings

    offset = np.array([0.03, 0.0, 0.0])
    images, tips = [], []
    for env in (CellEnv("peg_insertion", differing_settings()), differing_env("peg_insertion", offset)):
        seen, _ = env.reset(seed=3)
        images.append(seen["image"])
        tips.append(seen["tip"])
        env.close()
    assert np.allclose(tips[0], tips[1], atol=1e-3)
    # The camera stands 3 cm farther along x than the calibration has it, so that all seems that much nearer.
    moved = [np.median(images[1][k] - images[0][k]) for k in (3, 4, 5)]
    np.testing.assert_allclose(moved, -offset / XYZ_UNIT, atol=0.03)
    plain = CellEnv("peg_insertion", real_cell=differing_cell(cell_named(), offset), max_actions=2)
    plain.reset(seed=3)
    still = np.zeros(3, dtype=np.float32)
    assert not plain.step(still)[3] and plain.step(still)[3]
    plain.close()
    with pytest.raises(InputError, match="max_actions is -1"):
        CellEnv("peg_insertion", max_actions=-1)
    for bad in ((0.005,), (0.0, 0.0, np.nan)):
        with pytest.raises(InputError, match="three finite numbers"):
            differing_env("peg_insertion", bad)


@pytest.mark.slow
def test_an_expert_succeeds_and_is_paid_for_it() -> None:
    """Told the hole, it ends the episode with success; doing nothing uses all actions up."""
    from samrl_core.studies.baselines.gym_env import CellEnv

    env, task = CellEnv("peg_insertion"), TASKS["peg_insertion"]
    observed, _ = env.reset(seed=0)
    hole = env._world.truth().body_position[BODY][:2]
    rewards, terminated = [], False
    while not terminated and len(rewards) < 60:
        goal = task.sub_goals(hole, observed["tip"].astype(np.float64))[0]
        way = goal.tip_position - observed["tip"]
        step = way * min(1.0, goal.max_step / max(float(np.linalg.norm(way)), 1e-9))
        observed, reward, terminated, _, info = env.step(step.astype(np.float32))
        rewards.append(reward)
    assert terminated and info["success"] and rewards[-1] > -0.003 > -0.05 > rewards[0]
    env.reset(seed=0)
    for k in range(task.max_actions):
        _, _, terminated, truncated, _ = env.step(np.zeros(3, dtype=np.float32))
        assert not terminated and truncated == (k == task.max_actions - 1)
    env.close()


def test_an_unknown_task_is_refused() -> None:
    from samrl_core.studies.baselines.gym_env import CellEnv

    with pytest.raises(InputError, match="juggling"):
        CellEnv("juggling")
    with pytest.raises(InputError, match="render_mode"):
        CellEnv("peg_insertion", render_mode="hologram")
