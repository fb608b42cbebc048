"""What every simulated world promises, over both of them."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pybullet
import pytest

from samrl_core.cell.instance.cell_instance import instance_named
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.tasks import TASKS, task_named
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.observation import ArmCommand, Observation
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world import WORLDS, make_world
from samrl_core.cell.world.world import SimulatedWorld
from samrl_core.common.errors import InputError

CELL = cell_named()
TASK = task_named("peg_insertion")


@pytest.fixture(params=WORLDS)
def world(request: pytest.FixtureRequest) -> Iterator[SimulatedWorld]:
    """One of the worlds, closed afterwards."""
    made = make_world(request.param, TASK, CELL)
    yield made
    made.close()


def still(position: np.ndarray, stamp_ns: int) -> ArmCommand:
    """Stay there."""
    zero = np.zeros_like(position)
    return ArmCommand(stamp_ns, position, zero, zero, zero)


def test_reads_before_the_first_command(world: SimulatedWorld) -> None:
    """At the task's start, at rest, held against gravity."""
    start = TASK.start_joints(CELL)
    for role in ROLES:
        reading = world.read_arm(role)
        assert reading.stamp_ns == world.time_ns == 0
        np.testing.assert_allclose(reading.position, start[role], atol=1e-4)
        np.testing.assert_allclose(reading.velocity, 0.0, atol=0.01)
        assert np.abs(reading.effort).max() > 1.0


def test_camera_keeps_its_promises(world: SimulatedWorld) -> None:
    """Shape and type as `Observation` asks, stamped now."""
    world.advance()
    frame = world.read_camera()
    assert frame.stamp_ns == world.time_ns
    reading = {role: world.read_arm(role) for role in ROLES}
    Observation(frame, Camera(CELL.intrinsics, Pose.identity()), reading["tool_arm"], reading["camera_arm"])


def test_time_goes_on_by_one_period_and_never_back(world: SimulatedWorld) -> None:
    """Also over a reset."""
    stamps = []
    for _ in range(5):
        world.advance()
        stamps.append(world.time_ns)
    np.testing.assert_array_equal(np.diff(stamps), 1_000_000)
    world.reset(1)
    assert world.time_ns == stamps[-1]
    assert world.read_arm("tool_arm").stamp_ns == stamps[-1]
    world.advance()
    assert world.time_ns == stamps[-1] + 1_000_000


def test_a_command_is_followed(world: SimulatedWorld) -> None:
    """A slow ramp of every joint, read back."""
    for role in ROLES:
        start = world.read_arm(role).position
        sign = np.where(np.arange(start.size) % 2, 1.0, -1.0)
        for i in range(1, 1201):  # without feed-forward, so it takes the springs some time to settle
            goal = start + 0.03 * sign * min(i / 200, 1.0)
            world.command(role, still(goal, world.time_ns))
            world.advance()
        np.testing.assert_allclose(world.read_arm(role).position, start + 0.03 * sign, atol=2e-3)
        assert world.commanded_effort(role).shape == start.shape


def test_reset_repeats_exactly_with_a_seed(world: SimulatedWorld) -> None:
    """Joint readings, images and bodies are bit for bit those of the first time."""

    def episode(seed: int) -> tuple[np.ndarray, ...]:
        world.reset(seed)
        start = world.read_arm("tool_arm").position
        world.command("tool_arm", still(start + 0.02, world.time_ns))
        for _ in range(50):
            world.advance()
        reading, frame = world.read_arm("tool_arm"), world.read_camera()
        body = world.truth().body_position["hole_board"]
        return reading.position, reading.velocity, reading.effort, frame.color, frame.depth, frame.mask, body

    first, other, again = episode(3), episode(4), episode(3)
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a, b)
    assert np.abs(first[-1] - other[-1]).max() > 1e-3


def test_bodies_lie_where_they_were_drawn(world: SimulatedWorld) -> None:
    """Within the task's range, and the same in every world."""
    world.reset(5)
    other = make_world("mock", TASK, CELL)
    other.reset(5)
    np.testing.assert_array_equal(
        world.truth().body_position["hole_board"], other.truth().body_position["hole_board"]
    )


def test_truth_starts_untouched(world: SimulatedWorld) -> None:
    """Tip where forward kinematics has it, no contact."""
    truth = world.truth()
    np.testing.assert_allclose(truth.tip_position, [0.5, 0.0, 0.14], atol=1e-4)
    assert truth.first_contact_ns == -1 and truth.peak_contact_force == 0.0


@pytest.mark.parametrize("value", [np.zeros(6), np.full(7, np.nan), np.array([0, 0, 0, np.inf, 0, 0, 0.0])])
def test_bad_commands_are_refused(world: SimulatedWorld, value: np.ndarray) -> None:
    """Wrong length or not finite, in any field."""
    zero = np.zeros(7)
    with pytest.raises(InputError, match="position"):
        world.command("tool_arm", ArmCommand(0, value, zero, zero, zero))
    with pytest.raises(InputError, match="effort"):
        world.command("tool_arm", ArmCommand(0, zero, zero, zero, value))


def test_unknown_roles_are_refused(world: SimulatedWorld) -> None:
    """The message lists the roles."""
    for call in (world.read_arm, world.commanded_effort):
        with pytest.raises(InputError, match="camera_arm"):
            call("third_arm")
    with pytest.raises(InputError, match="camera_arm"):
        world.command("third_arm", still(np.zeros(7), 0))


def test_closing_twice_is_harmless(world: SimulatedWorld) -> None:
    """And closes only this world."""
    other = make_world("pybullet", TASK, CELL)
    world.close()
    world.close()
    other.advance()
    other.read_camera()
    other.close()


def test_a_closed_world_says_so() -> None:
    """Instead of an error of the simulator's."""
    made = make_world("pybullet", TASK, CELL)
    made.close()
    for call in (made.read_camera, made.advance, made.truth):
        with pytest.raises(InputError, match="closed"):
            call()
    with pytest.raises(InputError, match="closed"):
        made.reset(0)


def test_unknown_kind_lists_the_worlds() -> None:
    """The message helps."""
    with pytest.raises(InputError, match="pybullet, mock"):
        make_world("gazebo", TASK, CELL)


def test_missing_pybullet_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    """Names the package and the way out."""
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(InputError, match=r"3\.12"):
        make_world("pybullet", TASK, CELL)


@pytest.mark.parametrize("name", sorted(TASKS))
def test_every_task_starts_free_of_contact_and_in_view(name: str) -> None:
    """Start joints within limits; nothing touches; the camera sees every labelled body and the tool."""
    task = TASKS[name]
    made = make_world("pybullet", task, CELL)
    for role, q in task.start_joints(CELL).items():
        limits = CELL.arm(role).limits
        assert (q > limits.lower).all() and (q < limits.upper).all()
    for seed in range(5):
        made.reset(seed)
        made.advance()
        assert made.truth().first_contact_ns == -1
        scene, mask = task.scene(CELL), made.read_camera().mask
        labels = {body.label for body in scene.bodies} | {link.label for link in scene.tool.chain}
        for label in labels | {scene.tool.label}:
            assert (mask == label).sum() > 50
    made.close()


@pytest.mark.parametrize("name", sorted(TASKS))
def test_every_task_repeats_exactly_with_a_seed(name: str) -> None:
    """Truth after 30 ms is bit for bit that of the first time, and differs from another seed's."""
    made = make_world("pybullet", TASKS[name], CELL)

    def episode(seed: int) -> np.ndarray:
        made.reset(seed)
        for _ in range(30):
            made.advance()
        truth = made.truth()
        bodies = [np.concatenate([p, truth.body_quat_xyzw[k]]) for k, p in truth.body_position.items()]
        return np.concatenate([*bodies, truth.tip_position, truth.chain_points.ravel()])

    first, other, again = episode(3), episode(4), episode(3)
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 1e-4
    made.close()


@pytest.mark.parametrize("name", sorted(TASKS))
def test_both_worlds_lay_the_same_scene(name: str) -> None:
    """Bodies and chain of one seed, before anything moves."""
    made = [make_world(kind, TASKS[name], CELL) for kind in WORLDS]
    for world in made:
        world.reset(7)
    one, two = (world.truth() for world in made)
    for body in one.body_position:
        np.testing.assert_allclose(one.body_position[body], two.body_position[body], atol=1e-12)
        np.testing.assert_allclose(one.body_quat_xyzw[body], two.body_quat_xyzw[body], atol=1e-12)
    np.testing.assert_allclose(one.chain_points, two.chain_points, atol=1e-6)
    assert one.body_speed == two.body_speed and one.body_peak_height == two.body_peak_height
    for world in made:
        world.close()


def test_a_failed_build_leaves_no_client_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    """A body that cannot be built is refused, and the half-built world is closed."""
    scene = TASK.scene(CELL)
    heavy = replace(scene, bodies=(replace(scene.bodies[0], mass=1.0),))
    monkeypatch.setattr(type(TASK), "scene", lambda self, cell: heavy)
    closed = []
    disconnect = pybullet.disconnect

    def counted(**client: int) -> None:
        closed.append(client)
        disconnect(**client)

    monkeypatch.setattr(pybullet, "disconnect", counted)
    with pytest.raises(InputError, match="moments of inertia"):
        make_world("pybullet", TASK, CELL)
    assert len(closed) == 1


def test_a_world_leaves_no_files_however_it_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody removes what a killed process had; so all is gone once the world stands."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    task, cell = task_named("peg_insertion"), cell_named()
    world = make_world("pybullet", task, cell, instance=instance_named("typical:1", cell))
    try:
        assert not list(tmp_path.iterdir())
        world.reset(1)
        assert world.read_camera().color.any()
    finally:
        world.close()
