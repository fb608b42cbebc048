"""A photograph of the whole bench by a bystander: for people, and for no node, learner or estimate.

The bench is built anew as its instance has it, with the arms' meshes in more detail than the cell's camera
needs. Behind and upon TinyRenderer's picture come what a photograph has beside its subject: furniture, a
pool of light, dark corners where surfaces meet (differences of blurred depth: Luft et al. 2006, "Image
enhancement by unsharp masking the depth buffer"), depth of field, and grain.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pybullet

from samrl_core.cell.instance.cell_instance import CellInstance
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.pose import Pose, look_at
from samrl_core.cell.world.bench_texture import paint_floor, paint_table
from samrl_core.cell.world.drive import Drive
from samrl_core.cell.world.pybullet.arm import PyBulletArm
from samrl_core.cell.world.pybullet.bench import FLOOR_Z, Bench
from samrl_core.cell.world.pybullet.bodies import PyBulletBodies
from samrl_core.cell.world.pybullet.body_files import Mounted, camera_housing
from samrl_core.cell.world.pybullet.camera import TinyCamera
from samrl_core.cell.world.pybullet.chain import PyBulletChain
from samrl_core.cell.world.pybullet.looks import arm_meshes, build_clutter, casters_of
from samrl_core.cell.world.pybullet.real_camera import look_stream, true_light
from samrl_core.cell.world.settings import WorldSettings
from samrl_core.cell.world.table import TABLE_IN_WORLD, TABLE_SIZE
from samrl_core.cell.world.true_cell import true_cell, true_scene


@dataclass(frozen=True)
class PhotographSettings:
    """Where the bystander stands, and the camera in their hand."""

    size: tuple[int, int] = (1080, 720)  # [px]
    focal: float = 1150.0  # [px]
    eye: tuple[float, float, float] = (1.40, -1.25, 0.80)  # in world [m]
    target: tuple[float, float, float] = (0.50, 0.0, 0.10)  # what is in focus, in world [m]
    finer: int = 2  # times the pixels are rendered each way
    link_faces: int = 4000  # of an arm's mesh at most
    hand_faces: int = 6000
    pool: float = 0.75  # radius of the pool of light about the target [m]
    blur: float = 6.0  # standard deviation far behind the focus [px]
    grain: float = 2.2  # standard deviation, of 255


@dataclass(frozen=True, eq=False)
class BenchState:
    """How the bench stands."""

    encoders: Mapping[str, np.ndarray]  # joints by role as they are read (J,) [rad]
    body_in_world: Mapping[str, Pose]  # of all bodies of the task
    chain_angles: np.ndarray  # (2 K,) of what hangs from the tool [rad]


def photograph_bench(
    task: Task,
    cell: CellSpec,
    instance: CellInstance,
    state: BenchState,
    settings: PhotographSettings | None = None,
) -> np.ndarray:
    """The photograph, (H, W, 3) uint8.

    Args:
        task: whose bodies and tool are there.
        cell: the nominal one.
        instance: the true cell.
        state: of the bench.
        settings: of the photograph.
    """
    s = settings or PhotographSettings()
    client = pybullet.connect(pybullet.DIRECT)
    try:
        with tempfile.TemporaryDirectory(prefix="samrl_photo_") as folder:
            return _Studio(client, task, cell, instance, state, s, Path(folder)).expose()
    finally:
        pybullet.disconnect(physicsClientId=client)


class _Studio:
    """The bench in a client of its own, as it stands."""

    def __init__(
        self,
        client: int,
        task: Task,
        cell: CellSpec,
        instance: CellInstance,
        state: BenchState,
        settings: PhotographSettings,
        folder: Path,
    ) -> None:
        self._settings, self._rng = settings, look_stream(instance)
        true, made, world = true_cell(cell, instance), true_scene(task, cell, instance), WorldSettings()
        tool, period = made.scene.tool, cell.tool_arm.controller.period_s
        arms = {}
        for role in ROLES:
            held = role == "tool_arm"
            faces = settings.link_faces, settings.hand_faces
            meshes = arm_meshes(cell, role, tool, folder, *faces)
            load = Mounted.of_tool(tool) if held else camera_housing(cell)
            chain, tip = (tool.chain, tool.tip_in_flange) if held else ((), Pose.identity())
            arm = PyBulletArm(
                client, cell.arm(role), true.base_in_world(role), load, folder, chain, tip, 0.0, meshes
            )
            arm.place(
                Drive(cell.arm(role), role, instance, round(1e9 * period)).true_position(state.encoders[role])
            )
            arms[role] = arm
            _pedestal(client, true.base_in_world(role).position)
        bodies = PyBulletBodies(client, made.scene.bodies, folder, world)
        bodies.place(dict(state.body_in_world))
        arm = arms["tool_arm"]
        hanging = PyBulletChain(client, arm.body, arm.link_index, tool.chain, period, np.array(world.gravity))
        hanging.place(state.chain_angles, arm.flange_in_world() @ tool.tip_in_flange)
        height = made.task.surface_height
        _table_frame(client, height)
        look = instance.look
        table = paint_table(self._rng, min(look.texture, 1.5), look.bench_colour, round(0.5 * look.clutter))
        casters, fixed = casters_of(cell, arms, made.scene, bodies.index)
        fixed += build_clutter(client, instance, height)
        columns, rows = (settings.finer * n for n in settings.size)
        focal = settings.finer * settings.focal
        intrinsics = Intrinsics(columns, rows, focal, focal, 0.5 * columns, 0.5 * rows)
        light = true_light(world.light_direction, instance)
        self._camera = TinyCamera(client, intrinsics, {}, light, shadow=False)
        floor = paint_floor(self._rng)
        self._bench = Bench(client, intrinsics, table, floor, casters, fixed, light, look.shadow, height)
        self._pose = look_at(np.array(settings.eye), np.array(settings.target))
        warmth = np.array([1.0 + look.light_warmth, 1.0, 1.0 - look.light_warmth])
        self._gain = np.clip((1.0 + look.light_strength) * warmth, 0.2, 3.0)

    def expose(self) -> np.ndarray:
        """(H, W, 3) uint8."""
        s = self._settings
        picture = self._bench.paint(self._camera.render(self._pose), self._pose, self._bench.shadows())
        color = cv2.resize(picture.color.astype(np.float32), s.size, interpolation=cv2.INTER_AREA)
        depth = cv2.resize(picture.depth.astype(np.float32), s.size, interpolation=cv2.INTER_NEAREST)
        light = self._pool(depth) * _corners_of_surfaces(depth)
        color = self._focused(color * light[..., None] * self._gain.astype(np.float32), depth)
        color = 255.0 * (1.0 - np.exp(-1.6 * color / 255.0)) / (1.0 - math.exp(-1.6))  # film's shoulder
        color += s.grain * cv2.GaussianBlur(
            self._rng.standard_normal(color.shape).astype(np.float32), (0, 0), 0.7
        )
        return np.clip(np.rint(color * _vignette(s.size)), 0, 255).astype(np.uint8)

    def _pool(self, depth: np.ndarray) -> np.ndarray:
        """Share of the light (H, W) that reaches each pixel's surface: less away from the target."""
        s = self._settings
        height, width = depth.shape
        u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        rays = np.stack([u - 0.5 * width, v - 0.5 * height, np.full_like(u, s.focal)], axis=-1) / s.focal
        place = self._pose.apply((rays * depth[..., None]).reshape(-1, 3)).reshape(*depth.shape, 3)
        far = np.linalg.norm(place - np.array(s.target), axis=-1)
        return (0.55 + 0.55 * np.exp(-0.5 * (far / s.pool) ** 2)).astype(np.float32)

    def _focused(self, color: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """Blurred by how far behind the focus a surface lies."""
        s = self._settings
        focus = float(np.linalg.norm(np.array(s.eye) - np.array(s.target)))
        behind = np.clip(1.0 - focus / depth - 0.15, 0.0, 0.35) / 0.35
        far = (behind > 0.0).astype(np.float32)
        layers = [color]
        for share in (0.35, 1.0):  # of what is far alone: a sharp edge before it must not bleed into it
            weight = cv2.GaussianBlur(far, (0, 0), share * s.blur)[..., None]
            blurred = cv2.GaussianBlur(color * far[..., None], (0, 0), share * s.blur)
            layers.append(np.where(far[..., None] > 0.0, blurred / np.maximum(weight, 1e-3), color))
        sharp, half, full = layers
        amount = behind[..., None]
        return np.where(
            amount < 0.5,
            sharp + 2.0 * amount * (half - sharp),
            half + (2.0 * amount - 1.0) * (full - half),
        )


def _corners_of_surfaces(depth: np.ndarray) -> np.ndarray:
    """Share of the light (H, W) that is left beside and behind what stands nearer."""
    near = np.minimum(depth, 4.0).astype(np.float32)
    spread = 0.008 * near.shape[1]
    behind = near - cv2.GaussianBlur(near, (0, 0), spread)
    # Full from 2 cm to 10 cm behind; what lies far behind is in nobody's corner.
    dark = np.clip(behind / 0.02, 0.0, 1.0) * np.clip((0.20 - behind) / 0.10, 0.0, 1.0)
    return 1.0 - 0.35 * cv2.GaussianBlur(dark, (0, 0), 0.3 * spread)


def _vignette(size: tuple[int, int]) -> np.ndarray:
    width, height = size
    u, v = np.meshgrid(np.linspace(-1.0, 1.0, width), np.linspace(-1.0, 1.0, height))
    return (1.0 - 0.22 * np.clip(u * u + v * v, 0.0, 2.0) ** 1.5 / 2.0**0.5).astype(np.float32)[..., None]


def _block(
    client: int, half: tuple[float, float, float], place: np.ndarray, color: tuple[float, ...]
) -> None:
    visual = pybullet.createVisualShape(
        pybullet.GEOM_BOX, halfExtents=half, rgbaColor=[*color, 1.0], physicsClientId=client
    )
    pybullet.createMultiBody(0.0, -1, visual, place.tolist(), physicsClientId=client)


def _table_frame(client: int, height: float) -> None:
    """A board below the top, which is painted at a height over the drawn one [m], rails and legs."""
    x, y, thick = TABLE_SIZE
    middle = TABLE_IN_WORLD.position + [0.0, 0.0, height]
    below = 0.002  # where the top is painted
    _block(
        client, (0.5 * x, 0.5 * y, 0.5 * (thick - below)), middle - [0, 0, 0.5 * below], (0.62, 0.55, 0.45)
    )
    leg = 0.5 * (height - FLOOR_Z - thick)
    for side in (-1.0, 1.0):
        for end in (-1.0, 1.0):
            place = middle + [side * (0.5 * x - 0.04), end * (0.5 * y - 0.04), -0.5 * thick - leg]
            _block(client, (0.02, 0.02, leg), place, (0.55, 0.56, 0.58))


def _pedestal(client: int, base: np.ndarray) -> None:
    """A profile column with a plate, below an arm's base."""
    height = 0.5 * (base[2] - 0.02 - FLOOR_Z)
    _block(client, (0.055, 0.055, height), base - [0, 0, 0.02 + height], (0.40, 0.41, 0.43))
    _block(client, (0.12, 0.12, 0.01), base - [0, 0, 0.01], (0.50, 0.51, 0.53))
    _block(client, (0.17, 0.17, 0.01), np.array([base[0], base[1], FLOOR_Z + 0.01]), (0.40, 0.41, 0.43))
