"""What a cell instance looks like: textures, clutter, meshes, shadows, and depth that fits the picture."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.instance.cell_instance import CellInstance, instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.pose import look_at
from samrl_core.cell.types.scene import Box
from samrl_core.cell.world.bench_texture import PIXEL, paint_floor, paint_table
from samrl_core.cell.world.clutter import HIGHEST, WAY, WORK, lay_clutter
from samrl_core.cell.world.pybullet.arm_meshes import mesh_visual
from samrl_core.cell.world.pybullet.camera import Picture
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.settings import NOISELESS
from samrl_core.cell.world.table import TABLE_IN_WORLD, TABLE_SIZE

CELL = cell_named()
HAND = "package://franka_panda/meshes/visual/hand.obj"


@contextmanager
def world_of(instance: CellInstance, task: str = "peg_insertion") -> Generator[PyBulletWorld]:
    world = PyBulletWorld(task_named(task), CELL, NOISELESS, instance=instance)
    try:
        world.reset(1)
        yield world
    finally:
        world.close()


def painted(world: PyBulletWorld, eye: list[float], target: list[float], shadows: bool = True) -> Picture:
    """The bench alone, from anywhere, without lens and noise."""
    camera = world._real_camera
    assert camera is not None
    k = camera._lens.ideal
    nothing = Picture(
        np.zeros((k.height, k.width, 3), np.uint8),
        np.full((k.height, k.width), np.nan),
        np.ones((k.height, k.width), np.uint8),
    )
    shade = camera._bench.shadows()
    pose = look_at(np.array(eye), np.array(target))
    return camera._bench.paint(nothing, pose, shade if shadows else np.zeros_like(shade))


def test_textures_follow_from_their_generator() -> None:
    one, again, other = (paint_table(np.random.default_rng(s), 0.8, np.zeros(3), 8) for s in (1, 1, 2))
    assert one.shape == (round(TABLE_SIZE[0] / PIXEL), round(TABLE_SIZE[1] / PIXEL), 3)
    np.testing.assert_array_equal(one, again)
    assert (one != other).mean() > 0.5
    assert paint_floor(np.random.default_rng(1)).std() > 3.0


def test_a_table_without_contrast_and_prints_is_plain() -> None:
    plain = paint_table(np.random.default_rng(1), 0.0, np.zeros(3), 0)
    assert plain.std(axis=(0, 1)).max() < 1.0


def test_clutter_keeps_out_of_the_way() -> None:
    for seed in range(20):
        things = lay_clutter(np.random.default_rng(seed), 18)
        assert len(things) > 8
        for thing in things:
            place = thing.part.part_in_body.position
            x, y = place[:2] - TABLE_IN_WORLD.position[:2]
            assert np.hypot(x, y) > WORK and not (x < 0 and abs(y) < WAY)
            part = thing.part
            top = part.half_extents[2] if isinstance(part, Box) else min(part.radius, 0.5 * part.length)
            assert 0.0 < place[2] + top <= HIGHEST + 0.04


def test_the_tables_plane_is_where_the_table_is() -> None:
    """Depth from straight above and at a slant; a camera beside the table measures the floor."""
    with world_of(instance_named("typical:1", CELL)) as world:
        eye, target = [0.5, 0.0, 0.5], [0.5, 1e-3, 0.0]
        k: Intrinsics = world._real_camera._lens.ideal
        middle = painted(world, eye, target).depth[k.height // 2, k.width // 2]
        assert middle == pytest.approx(0.5, abs=2e-3)
        slanted = painted(world, [0.8, 0.2, 0.4], [0.5, 0.0, 0.0]).depth[k.height // 2, k.width // 2]
        assert slanted == pytest.approx(float(np.linalg.norm([0.3, 0.2, 0.4])), rel=0.02)
        beside = painted(world, [0.5, 1.5, 0.5], [0.5, 1.501, 0.0])
        assert beside.depth[k.height // 2, k.width // 2] == pytest.approx(1.25, abs=5e-3)
        assert not beside.mask.any(), "what is painted has no label"


def test_a_table_as_high_as_made_is_seen_there_and_carries_what_lies_on_it() -> None:
    """Depth from above, and a pancake at rest: the hard one is 3.7 mm higher, the plain one as drawn."""
    instance = instance_named("typical:1", CELL)
    height = instance.parts.surface
    assert height > 0.003
    for task, top in (("spatula_flipping_hard", height), ("spatula_flipping", 0.0)):
        with world_of(instance, task) as world:
            k: Intrinsics = world._real_camera._lens.ideal
            depth = painted(world, [0.5, 0.0, 0.5], [0.5, 1e-3, 0.0]).depth[k.height // 2, k.width // 2]
            for _ in range(200):
                world.advance()
            lies = world.truth().body_position["pancake"][2]
        thickness = 0.012 * (1.0 + instance.parts.size[1])
        assert depth == pytest.approx(0.5 - top, abs=1e-3)
        assert lies == pytest.approx(top + 0.5 * thickness, abs=3e-4)


def test_bodies_throw_shadows_away_from_the_light() -> None:
    """The peg's block darkens the table on the side that the light does not come from."""
    with world_of(instance_named("typical:1", CELL)) as world:
        from samrl_core.cell.world.pybullet.real_camera import true_light

        light = np.array(true_light(world._settings.light_direction, world._instance))
        block = world.truth().body_position["hole_board"]
        away = -light[:2] / np.linalg.norm(light[:2])
        shade = world._real_camera._bench.shadows()
        corner = (TABLE_IN_WORLD.position - 0.5 * np.array(TABLE_SIZE))[:2]

        def darkness(place: np.ndarray) -> float:
            row, column = ((place - corner) / (2 * PIXEL)).astype(int)
            return float(shade[row, column])

        assert darkness(block[:2] + 0.066 * away) > 0.5
        assert darkness(block[:2] - 0.075 * away) < darkness(block[:2] + 0.066 * away)
        with_them = painted(world, [0.7, 0.3, 0.5], [0.5, 0.0, 0.0]).color.mean()
        assert with_them < painted(world, [0.7, 0.3, 0.5], [0.5, 0.0, 0.0], shadows=False).color.mean()


def test_the_hand_is_a_mesh_and_physics_keeps_its_boxes(tmp_path) -> None:
    import pybullet

    assert mesh_visual("package://nowhere/hand.obj", CELL.camera_in_flange, (1, 1, 1), tmp_path, 700) is None
    visual = mesh_visual(HAND, CELL.camera_in_flange, (1, 1, 1), tmp_path, 700)
    assert visual is not None
    faces = sum(line.startswith("f ") for line in visual.file.read_text().splitlines())
    assert 200 < faces <= 700
    kinds = {}
    for name in ("nominal", "typical:1"):
        with world_of(instance_named(name, CELL)) as world:
            arm, client = world._arms["tool_arm"], world._client
            shown = pybullet.getVisualShapeData(arm.body, physicsClientId=client)
            touched = pybullet.getCollisionShapeData(arm.body, arm.payload_link, physicsClientId=client)
            meshes = sum(s[2] == pybullet.GEOM_MESH for s in shown)
            kinds[name] = (meshes, [shape[2] for shape in touched])
    assert kinds["nominal"][0] == 0 and kinds["typical:1"][0] >= 10
    assert kinds["nominal"][1] == kinds["typical:1"][1]


def test_a_camera_that_moves_smears_its_picture() -> None:
    instance = instance_named("typical:1", CELL)
    slow = replace(instance, optics=replace(instance.optics, exposure_time=0.03))
    with world_of(slow) as world:
        still = world.read_camera().color.astype(int)
        arm = world._arms["camera_arm"]
        position, _ = arm.state()
        import pybullet

        for joint, value in zip(arm._joints, position.tolist(), strict=True):
            pybullet.resetJointState(arm.body, joint, value, 0.8, physicsClientId=world._client)
        moving = world.read_camera().color.astype(int)
    # Edges are softer: neighbours differ less.
    assert np.abs(np.diff(moving, axis=1)).mean() < 0.8 * np.abs(np.diff(still, axis=1)).mean()
