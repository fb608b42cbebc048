"""Hole and peg's end by their colours, in images of a simulated cell that is as drawn."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.peg_insertion.board import TOP_COLOR
from samrl_core.cell.tasks.peg_insertion.tool import PEG_COLOR
from samrl_core.cell.types.observation import Observation
from samrl_core.cell.world.evaluation import true_values
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.model.real2sim.hole_sight import HoleSight, PegColours, on_plane, sight_of
from samrl_core.policy.contact.seen_hole import SeenHole
from samrl_core.policy.contact.touch_insertion import require_peg
from samrl_core.studies.episodes.world_plant import WorldPlant

CELL, TASK = cell_named(), require_peg(task_named("peg_insertion_hard"))
LABELS = (TASK.tool_label, TASK.board_label)
WRONG = np.array([0.006, -0.005, 0.0])  # of what is believed before the image [m]


@pytest.fixture(scope="module")
def seen() -> tuple[Observation, np.ndarray, np.ndarray]:
    """An image, mouth (3,) and tip (3,) as they are [m]; truth for the test alone."""
    world = PyBulletWorld(TASK, CELL)
    plant = WorldPlant(world, TASK, CELL)
    plant.begin(3)
    for _ in range(4):
        plant.displace_tool(np.array([0.0, 0.0, -0.01]))
    observation, truth = plant.observe(), world.truth()
    mouth = np.array([*true_values(TASK, truth)[:2], TASK.height])
    world.close()
    return observation, mouth, truth.tip_position


def sighted(observation: Observation, mouth: np.ndarray, tip: np.ndarray) -> HoleSight:
    radii = (TASK.peg_radius, TASK.hole_radius)
    return sight_of(observation, LABELS, PegColours(PEG_COLOR, TOP_COLOR), mouth + WRONG, tip - WRONG, radii)


def beside(sight: HoleSight, tip: np.ndarray) -> np.ndarray:
    return on_plane(sight.camera, sight.hole, TASK.height) - on_plane(sight.camera, sight.end, float(tip[2]))


def test_the_hole_lies_beside_the_end_as_it_does(seen: tuple[Observation, np.ndarray, np.ndarray]) -> None:
    observation, mouth, tip = seen
    found = beside(sighted(observation, mouth, tip), tip)
    assert np.linalg.norm(found - (mouth - tip)[:2]) < 0.001


def test_wide_masks_wrong_depth_and_a_cold_lamp_change_it_little(
    seen: tuple[Observation, np.ndarray, np.ndarray],
) -> None:
    observation, mouth, tip = seen
    plain = beside(sighted(observation, mouth, tip), tip)
    frame = observation.frame
    wide = frame.mask.copy()
    for label in LABELS:
        grown = cv2.dilate((frame.mask == label).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        wide[grown & (wide == 0)] = label
    cold = np.clip(frame.color * np.array([0.8, 0.95, 1.15]), 0, 255).astype(np.uint8)
    other = replace(observation, frame=replace(frame, mask=wide, color=cold, depth=frame.depth + 0.02))
    assert np.linalg.norm(beside(sighted(other, mouth, tip), tip) - plain) < 0.002


def test_a_hidden_hole_and_a_missing_tool_are_not_seen(
    seen: tuple[Observation, np.ndarray, np.ndarray],
) -> None:
    observation, mouth, tip = seen
    frame = observation.frame
    without = replace(frame, mask=np.where(frame.mask == TASK.tool_label, 0, frame.mask).astype(np.uint8))
    sight = sighted(replace(observation, frame=without), mouth, tip)
    assert np.isnan(sight.end).all() and np.isfinite(sight.hole).all()
    color = frame.color.copy()
    column, row = sight.hole.astype(int)
    color[row - 8 : row + 9, column - 8 : column + 9] = color[frame.mask == TASK.board_label].max(axis=0)
    assert np.isnan(sighted(replace(observation, frame=replace(frame, color=color)), mouth, tip).hole).all()


def test_a_tip_that_is_higher_than_believed_is_shown_aside_along_the_view(
    seen: tuple[Observation, np.ndarray, np.ndarray],
) -> None:
    """Which `covariance` counts, and a touch takes away."""
    observation, mouth, tip = seen
    sight = sighted(observation, mouth, tip)
    sight = replace(sight, end=sight.hole)  # where it is about to go in
    moved = beside(sight, mouth + [0.0, 0.0, 0.004]) - beside(sight, mouth)
    spread = sight.covariance(TASK.height, 1e-6, 0.004)
    np.testing.assert_allclose(spread, np.outer(moved, moved), rtol=0.05, atol=1e-8)
    camera = observation.camera
    pixel = camera.project(mouth[None])[0, :2]
    np.testing.assert_allclose(on_plane(camera, pixel, TASK.height), mouth[:2], atol=1e-9)


def test_the_middle_of_several_images_counts(seen: tuple[Observation, np.ndarray, np.ndarray]) -> None:
    observation, mouth, tip = seen
    found = SeenHole()
    assert not found.clear
    for _ in range(3):
        found = found.with_image(TASK, observation, mouth + WRONG, tip - WRONG, tip)
    assert found.clear and found.enough
    once = beside(found.sights[0], tip)
    np.testing.assert_allclose(found.place(TASK.height, TASK.height), tip[:2] + once, atol=1e-9)
    few = replace(found, sights=found.sights[:2], tips=found.tips[:2])
    wide, narrow = (one.covariance(TASK.height, 0.5, 0.0) for one in (few, found))
    assert np.trace(narrow) < np.trace(wide)
