"""Worlds of cell instances: nominal ones are bit for bit as without, others differ as drawn."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace

import cv2
import numpy as np
import pytest

from samrl_core.cell.instance.cell_instance import GROUPS, InstanceName, draw_instance, instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import TASKS, task_named
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.observation import ArmCommand, Observation
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world import make_world
from samrl_core.cell.world.drive import Drive
from samrl_core.cell.world.image_errors import ImageErrors
from samrl_core.cell.world.lens import Lens
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.true_cell import true_cell, true_scene
from samrl_core.common.errors import InputError

CELL = cell_named()
EVERY_TASK = pytest.mark.parametrize("name", sorted(TASKS))


@contextmanager
def world_of(task: str, instance: str) -> Generator[PyBulletWorld]:
    world = PyBulletWorld(task_named(task), CELL, instance=instance_named(instance, CELL))
    try:
        yield world
    finally:
        world.close()


def readings(world: PyBulletWorld, seed: int = 3) -> list[np.ndarray]:
    world.reset(seed)
    start = world.read_arm("tool_arm").position
    zero = np.zeros_like(start)
    world.command("tool_arm", ArmCommand(world.time_ns, start + 0.01, zero, zero, zero))
    for _ in range(60):
        world.advance()
    arm, frame, truth = world.read_arm("tool_arm"), world.read_camera(), world.truth()
    arrays = [arm.position, arm.velocity, arm.effort, frame.color, frame.depth, frame.mask]
    return [*arrays, truth.tip_position, *truth.body_position.values()]


def test_a_nominal_instance_changes_no_bit() -> None:
    with world_of("peg_insertion", "nominal") as one:
        world = make_world("pybullet", task_named("peg_insertion"), CELL)
        assert isinstance(world, PyBulletWorld)
        try:
            for a, b in zip(readings(one), readings(world), strict=True):
                np.testing.assert_array_equal(a, b)
        finally:
            world.close()


@EVERY_TASK
def test_a_typical_cell_believes_to_be_nominal(name: str) -> None:
    """Its arms read the start joints, its images fit `Observation`; tip and pictures are off, not far."""
    with world_of(name, "nominal") as nominal, world_of(name, "typical:1") as world:
        plain, found = readings(nominal), readings(world)
        world.reset(3)
        for role, start in task_named(name).start_joints(CELL).items():
            np.testing.assert_allclose(world.read_arm(role).position, start, atol=1e-4)
        frame = world.read_camera()
        arms = (world.read_arm("tool_arm"), world.read_arm("camera_arm"))
        Observation(frame, Camera(CELL.intrinsics, Pose.identity()), *arms)
    off = float(np.linalg.norm(found[6] - plain[6]))
    assert 1e-4 < off < 0.01, f"tip off by {off} m"
    difference = np.abs(found[3].astype(int) - plain[3].astype(int)).mean()
    assert difference > 3.0, f"colours differ by {difference} of 255"


@EVERY_TASK
def test_a_world_repeats_exactly(name: str) -> None:
    with world_of(name, "careless:2") as world:
        for a, b in zip(readings(world), readings(world), strict=True):
            np.testing.assert_array_equal(a, b)


@EVERY_TASK
@pytest.mark.parametrize("group", sorted(GROUPS))
def test_every_group_can_be_four_times_typical(name: str, group: str) -> None:
    """As the study of sensitivity asks for."""
    for seed in range(3):
        draws = draw_instance(InstanceName("typical", seed, scales=((group, 4.0),)), CELL)
        true_scene(task_named(name), CELL, draws)
        Lens(draws.optics, CELL.intrinsics)


@EVERY_TASK
def test_world_and_model_share_no_array_of_the_scene(name: str) -> None:
    task = task_named(name)
    model = task.scene(CELL)
    for text in ("nominal", "typical:1"):
        made = true_scene(task, CELL, instance_named(text, CELL)).scene
        theirs = [model.tool.inertia, *(b.mesh.vertices for b in model.bodies)]
        ours = [made.tool.inertia, *(b.mesh.vertices for b in made.bodies)]
        assert made is not model
        assert not any(np.shares_memory(a, b) for a in ours for b in theirs)


@EVERY_TASK
def test_parts_as_made_differ_from_the_drawing(name: str) -> None:
    task = task_named(name)
    assert task.as_made(instance_named("nominal", CELL).parts) == task
    assert task.as_made(instance_named("typical:1", CELL).parts) != task


def test_the_hand_stays_where_it_is_when_the_peg_slips() -> None:
    task = task_named("peg_insertion")
    plain, made = (
        true_scene(task, CELL, instance_named(n, CELL)).scene.tool for n in ("nominal", "careless:2")
    )
    for k, (a, b) in enumerate(zip(plain.parts, made.parts, strict=True)):
        # The fingers are as far apart as the peg is thick, which differs by a third of a millimetre at most.
        away = float(np.linalg.norm(a.part_in_body.position - b.part_in_body.position))
        assert (away > 5e-4) if k == 0 else (away < 4e-4), (k, away)
    assert plain.tip_in_flange.angle_to(made.tip_in_flange) > 1e-3


def test_the_true_calibration_is_off_as_drawn() -> None:
    instance = instance_named("typical:1", CELL)
    true, c = true_cell(CELL, instance), instance.calibration
    np.testing.assert_allclose(
        true.camera_in_flange.position - CELL.camera_in_flange.position, c.hand_eye_position, atol=1e-12
    )
    turn = true.camera_base_in_world.angle_to(CELL.camera_base_in_world)
    assert turn == pytest.approx(float(np.linalg.norm(c.camera_base_rotation)), rel=1e-6)
    assert true.tool_base_in_world is CELL.tool_base_in_world  # world's origin by definition


def command(position: float) -> ArmCommand:
    return ArmCommand(0, np.full(7, position), np.zeros(7), np.zeros(7), np.zeros(7))


def test_commands_arrive_after_their_delay_and_the_newest_counts() -> None:
    instance = instance_named("typical:1", CELL)
    drive = Drive(CELL.tool_arm, "tool_arm", instance, 1_000_000)
    delay = round(instance.timing.command_delay * 1e3)
    assert delay >= 1
    assert drive.send(command(0.1), 0) is None and drive.send(command(0.2), 0) is None
    assert drive.arrived(delay * 1_000_000 - 1) is None
    newest = drive.arrived(delay * 1_000_000)
    assert newest is not None and newest.position[0] == 0.2
    drive.send(command(0.3), 5_000_000)
    drive.restart()
    assert drive.arrived(10**12) is None


def test_encoders_read_what_the_arm_was_told_to_be() -> None:
    drive = Drive(CELL.tool_arm, "tool_arm", instance_named("typical:1", CELL), 1_000_000)
    wanted = np.linspace(-1.0, 1.0, 7)
    np.testing.assert_allclose(drive.read_position(drive.true_position(wanted)), wanted, atol=1e-15)
    assert np.abs(drive.true_position(wanted) - wanted).max() > 1e-5


def test_the_lens_moves_pixels_by_browns_formula() -> None:
    """A point far from the axis, projected by the formula, is found in the remapped image of its ray."""
    instance = instance_named("careless:2", CELL)
    k, lens = CELL.intrinsics, Lens(instance.optics, CELL.intrinsics)
    ideal = lens.ideal
    u, v = np.meshgrid(np.arange(ideal.width) + 0.5, np.arange(ideal.height) + 0.5)
    rays = np.stack([(u - ideal.cx) / ideal.fx, (v - ideal.cy) / ideal.fy, np.ones_like(u)], axis=-1)
    seen = lens.color(rays.astype(np.float32))  # a picture whose colours are its rays
    x, y = 0.30, -0.25
    (k1, k2), (p1, p2) = instance.optics.radial, instance.optics.tangential
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2 * r2
    place = np.array([x, y]) * radial + [
        2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
    ]
    focal = np.array([k.fx, k.fy]) * (1 + instance.optics.focal)
    centre = np.array([k.cx, k.cy]) + instance.optics.centre * [k.width, k.height]
    column, row = focal * place + centre
    near = seen[int(row), int(column)]
    np.testing.assert_allclose(near[:2], [x, y], atol=1.0 / k.fx)


@pytest.mark.parametrize("growth", [-2.5, 0.4, 3.0])
def test_masks_grow_by_as_many_pixels_as_drawn(growth: float) -> None:
    plain = instance_named("nominal", CELL)
    instance = replace(plain, segmentation=replace(plain.segmentation, growth=growth))
    mask = np.zeros((128, 128), dtype=np.uint8)
    mask[30:70, 30:70], mask[90:110, 30:70] = 1, 2
    found = ImageErrors(instance, CELL.intrinsics).segment(np.random.default_rng(0), mask)
    for label, rows in ((1, slice(40, 60)), (2, slice(97, 103))):
        widths = (found[rows] == label).sum(axis=1)
        assert np.mean(0.5 * (widths - 40.0)) == pytest.approx(growth, abs=0.25)


@pytest.mark.parametrize("error", [0.3, 0.7])
def test_a_lens_that_is_off_by_less_than_a_pixel_moves_depth_by_as_much(error: float) -> None:
    """Depth and labels are those of where the true lens looks, not of the nearest nominal pixel."""
    plain = instance_named("nominal", CELL).optics
    k = CELL.intrinsics
    lens = Lens(replace(plain, centre=np.array([error / k.width, 0.0]), focal=np.array([0.01, 0.0])), k)
    ideal = lens.ideal
    u = np.arange(ideal.width) + 0.5
    ray = np.broadcast_to((u - ideal.cx) / ideal.fx, (ideal.height, ideal.width))
    seen = lens.nearest(ray)[0]
    wanted = (np.arange(k.width) + 0.5 - k.cx - error) / (1.01 * k.fx)
    np.testing.assert_allclose(seen, wanted, atol=1e-9)


def test_depth_is_that_of_the_pixels_own_ray() -> None:
    """A leaning plane through a strong lens: whole pixels would be off by half a millimetre."""
    plain, k = instance_named("nominal", CELL).optics, CELL.intrinsics
    lens = Lens(replace(plain, radial=np.array([-0.2, 0.0])), k)

    def plane(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 0.35 / (1.0 - 0.5 * x - 0.3 * y)

    ideal = lens.ideal
    u, v = np.meshgrid(np.arange(ideal.width) + 0.5, np.arange(ideal.height) + 0.5)
    picture = plane((u - ideal.cx) / ideal.fx, (v - ideal.cy) / ideal.fy)
    u, v = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
    seen = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy], axis=-1)
    rays = cv2.undistortPoints(seen.reshape(-1, 1, 2), np.eye(3), np.array([-0.2, 0, 0, 0])).reshape(
        seen.shape
    )
    wanted = plane(rays[..., 0], rays[..., 1])
    assert np.abs(lens.nearest(picture) - wanted).max() > 5e-4, "no slope: the test shows nothing"
    np.testing.assert_allclose(lens.depth(picture), wanted, atol=1e-5)


def test_depth_at_an_edge_is_of_one_surface_or_the_other() -> None:
    k = CELL.intrinsics
    lens = Lens(replace(instance_named("nominal", CELL).optics, radial=np.array([-0.2, 0.0])), k)
    step = np.where(np.arange(lens.ideal.width) < lens.ideal.width // 2, 0.3, 0.5)
    picture = np.broadcast_to(step, (lens.ideal.height, lens.ideal.width)).copy()
    picture[:8] = np.nan
    found = lens.depth(picture)
    assert np.isclose(found[np.isfinite(found)][:, None], [0.3, 0.5]).any(axis=1).all()
    assert np.isnan(found[0]).all() and np.isfinite(found[20:]).all()


def test_masks_miss_merge_and_invent_as_often_as_drawn() -> None:
    instance = instance_named("careless:2 segmentation=2", CELL)
    errors = ImageErrors(instance, CELL.intrinsics)
    mask = np.zeros((128, 128), dtype=np.uint8)
    mask[40:80, 40:80], mask[80:110, 40:80] = 1, 2
    rng, missed, foreign, count = np.random.default_rng(0), 0, 0, 600
    for _ in range(count):
        found = errors.segment(rng, mask)
        missed += int(not (found == 1).any())
        foreign += int((found[:, 100:] > 0).any())
    s = instance.segmentation
    assert missed / count == pytest.approx(s.miss, abs=4 * np.sqrt(s.miss / count))
    assert 0 < foreign / count < 2 * s.foreign


def test_depth_is_scaled_and_offset_where_it_is_flat() -> None:
    instance = instance_named("typical:1", CELL)
    found = ImageErrors(instance, CELL.intrinsics).measure(np.random.default_rng(0), np.full((128, 128), 0.4))
    np.testing.assert_allclose(found, 0.4 * (1 + instance.depth.scale) + instance.depth.bias, rtol=1e-12)


def test_stamps_are_the_drivers_and_not_the_exposures() -> None:
    with world_of("peg_insertion", "typical:1") as world:
        timing = instance_named("typical:1", CELL).timing
        world.reset(0)
        for _ in range(20):
            world.advance()
        late = world.read_camera().stamp_ns - world.time_ns
        assert late == pytest.approx(1e9 * (timing.clock_offset + timing.stamp_late), abs=1.0)
        assert world.camera_latency_ns == pytest.approx(1e9 * timing.camera_latency, abs=5e5)


def test_what_has_no_instances_refuses_one() -> None:
    instance = instance_named("typical:1", CELL)
    task = task_named("peg_insertion")
    with pytest.raises(InputError, match="pybullet"):
        make_world("mock", task, CELL, instance=instance)
    with pytest.raises(InputError, match="exclude"):
        PyBulletWorld(task, CELL, scene=task.scene(CELL), instance=instance)
