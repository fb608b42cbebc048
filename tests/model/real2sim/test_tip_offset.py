"""Where the camera sees the held peg: against SciPy, and in images of another renderer."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.observation import Observation
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.common.errors import InputError
from samrl_core.model.real2sim.held_peg import HeldPeg, compared_pixels
from samrl_core.model.real2sim.information import view_information
from samrl_core.model.real2sim.tip_offset import TipOffset, TipOffsetFit, TipOffsetSettings
from samrl_core.policy.agent.settings import AgentSettings
from samrl_core.studies.episodes.world_plant import WorldPlant

CELL = cell_named()
TASK = task_named("peg_insertion_hard")
TOOL = TASK.scene(CELL).tool
SETTINGS = TipOffsetSettings()


@pytest.fixture(scope="module")
def sights() -> Iterator[list[tuple[Observation, np.ndarray]]]:
    """Images of the nominal cell with noise of masks and depth, and the tip by encoders that are right."""
    world = PyBulletWorld(TASK, CELL)
    plant = WorldPlant(world, TASK, CELL)
    plant.begin(5)
    found = []
    for step in (
        [0.0, 0.0, -0.01],
        [0.01, 0.0, -0.01],
        [0.0, 0.01, -0.01],
        [-0.01, 0.0, -0.01],
        [0.0, -0.01, 0.0],
    ):
        found.append((plant.observe(), plant.tip()))
        plant.displace_tool(np.array(step))
    world.close()
    yield found


@pytest.mark.parametrize("off", [(0.0, 0.0), (0.004, -0.003), (-0.005, 0.005)])
def test_another_renderers_images_show_where_the_tip_is(sights, off: tuple[float, float]) -> None:
    """Encoders are made to err by `off`; five images find it within 1 mm and within 2.5 deviations."""
    fit = TipOffsetFit(TOOL, CELL)
    belief, error = fit.begin(), np.array([*off, 0.0])
    for observation, tip in sights:
        belief = fit.update(belief, observation, tip + error)
    wrong = (belief.offset + error)[:2]
    deviation = np.sqrt(np.diag(belief.covariance))[:2]
    assert belief.images == len(sights)
    assert np.linalg.norm(wrong) < 0.001
    assert (np.abs(wrong) < 2.5 * deviation).all() and (deviation < 0.001).all()


def test_one_update_is_scipys_maximum_of_the_posterior(sights) -> None:
    """A peg drawn by the same renderer with noise; SciPy minimises the whitened residuals and the prior."""
    observation, tip = sights[0]
    camera, peg, rng = observation.camera, HeldPeg(TOOL, CELL), np.random.default_rng(0)
    shown = compared_pixels(camera, tip)
    truth = np.array([*(tip + [0.0012, -0.0008, 0.0002]), 0.0003])

    class Drawn(HeldPeg):
        def read(self, observation: Observation, shown: np.ndarray):
            image = self.images(truth[None], camera, shown)[0]
            return replace(image, color=image.color + (noise * image.mask)[..., None])

    noise = 0.05 * rng.standard_normal((camera.intrinsics.height, camera.intrinsics.width))
    fit = TipOffsetFit(TOOL, CELL)
    fit._peg = Drawn(TOOL, CELL)
    found = fit.update(fit.begin(), observation, tip)
    real, encoders = fit._peg.read(observation, shown), np.array([*tip, 0.0])
    at = encoders + found.mean
    view = view_information(
        lambda v: peg.images(v[None], camera, shown)[0], at, np.full(4, SETTINGS.half_span), SETTINGS.noise
    )
    inside = (view.inside & real.mask)[view.near]

    def residuals(v: np.ndarray) -> np.ndarray:
        image = peg.images((encoders + v)[None], camera, shown)[0]
        color = (image.color - real.color)[view.near] / view.unit[:, :3]
        depth = np.where(inside, np.nan_to_num(image.depth - real.depth)[view.near] / view.unit[:, 3], 0.0)
        pixels = np.concatenate([color, depth[:, None]], axis=1) * np.sqrt(view.weight)[:, None]
        return np.concatenate([pixels.ravel(), v / np.array([*SETTINGS.prior, SETTINGS.growth])])

    best = least_squares(residuals, found.mean, diff_step=0.3, x_scale=1e-3)
    deviation = np.sqrt(np.diag(found.covariance))
    np.testing.assert_array_less(np.abs(best.x - found.mean), 0.5 * deviation)
    np.testing.assert_array_less(np.abs(encoders + found.mean - truth), 2.0 * deviation)


def test_a_camera_that_moved_makes_it_uncertain_again() -> None:
    fit, here = TipOffsetFit(TOOL, CELL), Pose.from_rpy(np.array([0.5, 0.3, 0.4]), (0.0, 0.0, 0.0))
    there = Pose.from_rpy(np.array([0.5, 0.0, 0.4]), (0.0, 0.0, 1.0))
    first = fit.carried(fit.begin(), here)
    np.testing.assert_array_equal(first.covariance, fit.begin().covariance)
    known = TipOffset(np.array([0.004, -0.003, 0.001, 0.0002]), 1e-8 * np.eye(4), here, 9)
    moved = fit.carried(known, there)
    spread = (0.3 * SETTINGS.per_metre) ** 2 + SETTINGS.per_radian**2
    prior = np.square([*SETTINGS.prior, SETTINGS.growth])
    grown = np.diag(moved.covariance) - 1e-8
    np.testing.assert_allclose(grown[:3], (prior - 1e-8)[:3] * spread / (prior[:3] + spread), rtol=1e-9)
    assert grown[3] == 0.0 and moved.mean[3] == known.mean[3]
    assert (np.abs(moved.mean[:3]) < np.abs(known.mean[:3])).all(), "it goes back towards the prior"
    assert moved.images == known.images


def test_it_never_knows_less_than_before_the_first_image() -> None:
    """However often the camera moves: a height that strays by millimetres would end an insertion too high."""
    fit = TipOffsetFit(TOOL, CELL)
    belief = fit.begin()
    for turn in range(20):
        belief = fit.carried(belief, Pose.from_rpy(np.array([0.5, 0.0, 0.4]), (0.0, 0.0, float(turn % 2))))
    np.testing.assert_allclose(belief.covariance, fit.begin().covariance)


def test_the_next_episode_begins_where_the_last_one_ended() -> None:
    fit, here = TipOffsetFit(TOOL, CELL), Pose.from_rpy(np.array([0.5, 0.3, 0.4]), (0.0, 0.0, 0.0))
    last = TipOffset(np.array([0.002, -0.001, 0.0, 0.0002]), 9e-8 * np.eye(4), here, 20)
    begun = fit.begin(last)
    np.testing.assert_allclose(begun.mean[:2], last.mean[:2], rtol=0.02)
    np.testing.assert_allclose(np.diag(begun.covariance)[:2], 9e-8 + SETTINGS.per_episode**2, rtol=0.03)
    assert begun.images == 0 and begun.camera is here


def test_an_image_without_the_peg_says_nothing(sights) -> None:
    observation, tip = sights[0]
    blank = replace(observation.frame, mask=np.zeros_like(observation.frame.mask))
    fit = TipOffsetFit(TOOL, CELL)
    belief = fit.update(fit.begin(), replace(observation, frame=blank), tip)
    assert belief.images == 0 and not belief.mean.any()


def test_what_it_cannot_see_is_refused() -> None:
    with pytest.raises(InputError, match="hand_with_spatula has no cylinder"):
        TipOffsetFit(task_named("spatula_flipping").scene(CELL).tool, CELL)
    with pytest.raises(InputError, match="take policy 'optimised'"):
        AgentSettings(tip_offset=True)
