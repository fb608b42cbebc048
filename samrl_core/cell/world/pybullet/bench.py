"""Table, floor and shadows behind what TinyRenderer draws.

A table takes most of an image, and TinyRenderer's time with it. So it is left out there and painted from its
texture: where a pixel's ray meets the table's plane follows from one division, which gives depth and texture
alike. Shadows are the outlines of simple shapes along the light, filled on the table and blurred: soft, as
under a ceiling light, in a tenth of the time of a shadow map. Bodies cast none on each other.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import pybullet

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Box, Part
from samrl_core.cell.world.bench_texture import PIXEL
from samrl_core.cell.world.pybullet.camera import Picture
from samrl_core.cell.world.table import TABLE_IN_WORLD, TABLE_SIZE

FLOOR_Z = -0.75  # [m]
_COARSE = 2  # edge of a pixel of the shadows [px of the texture]
_PENUMBRA = 2.0  # standard deviation of a shadow's edge [px of the shadows]
_SIDES = 8  # corners of a cylinder's ends
_FLATTEST = np.float32(0.03)  # rays that fall less steeply meet the floor where one of this slope does
_MOST_ROWS = 32_000  # OpenCV remaps fewer than 32,768 at once
_DIM = np.float32(0.6)  # light on the floor

Caster = tuple[int, int, Part]


class Bench:
    """Paints behind pictures of one client's world.

    Args:
        client: physics client.
        intrinsics: of the pictures.
        table: texture of the table, see `paint_table`.
        floor: texture of the floor, see `paint_floor`.
        casters: shapes that cast shadows: body, link (-1 for the base), and part in the link's frame.
        fixed: those of them that stand still from one `begin` to the next.
        towards_light: in world.
        darkness: of the shadows, 0 none to 1 black.
        height: of the table's top over the drawn one [m].
    """

    def __init__(
        self,
        client: int,
        intrinsics: Intrinsics,
        table: np.ndarray,
        floor: np.ndarray,
        casters: Sequence[Caster],
        fixed: Sequence[Caster],
        towards_light: tuple[float, float, float],
        darkness: float,
        height: float = 0.0,
    ) -> None:
        k = intrinsics
        u, v = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
        rays = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones_like(u)], axis=-1)
        self._rays = np.ascontiguousarray(rays.reshape(-1, 3).T, dtype=np.float32)
        self._shape = (k.height, k.width)
        self._client, self._table, self._floor = client, table, floor
        self._corner = (TABLE_IN_WORLD.position - 0.5 * np.array(TABLE_SIZE))[:2].astype(np.float32)
        light = np.array(towards_light)
        self._slope = light[:2] / light[2]
        self._brightness = np.float32(0.55 + 0.45 * light[2] / np.linalg.norm(light))
        self._height = height
        self._darkness = np.float32(min(darkness, 1.0))
        self._casters, self._fixed = _Outlines(client, casters), _Outlines(client, fixed)
        self._fixed_shade = np.zeros((0, 0), dtype=np.uint8)

    def begin(self) -> None:
        """Bodies were laid anew: what fixed ones cast is not known any more."""
        self._fixed_shade = np.zeros((0, 0), dtype=np.uint8)

    def paint(self, picture: Picture, camera_in_world: Pose, shadows: np.ndarray) -> Picture:
        """The picture with table, in its shadows (see `shadows`), and floor where nothing else is nearer."""
        eye = camera_in_world.position.astype(np.float32)
        down = camera_in_world.rotation.astype(np.float32) @ self._rays  # (3, N) in world, 1 m of depth long
        depth, column, row = self._hit(eye, down, self._height)
        rows, columns = self._table.shape[:2]
        on_table = (down[2] < -_FLATTEST) & (column > 0) & (column < columns) & (row > 0) & (row < rows)
        off = np.flatnonzero(~on_table)
        depth[off], floor_column, floor_row = self._hit(eye, down[:, off], FLOOR_Z)
        depth = depth.reshape(self._shape)
        x, y = column.reshape(self._shape), row.reshape(self._shape)
        painted = cv2.remap(self._table, x, y, cv2.INTER_LINEAR).astype(np.float32)
        shade = cv2.remap(shadows, x / _COARSE, y / _COARSE, cv2.INTER_LINEAR)
        painted *= (self._brightness - self._brightness * self._darkness * shade)[..., None]
        if len(off):
            painted.reshape(-1, 3)[off] = _DIM * _repeated(self._floor, floor_column, floor_row)
        nearer = picture.depth < depth
        painted[nearer] = picture.color[nearer]
        depth = np.where(nearer, picture.depth, depth)
        return Picture(painted, depth, np.where(nearer, picture.mask, 0).astype(np.uint8))

    def _hit(
        self, eye: np.ndarray, down: np.ndarray, height: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Depth (N,) [m] of rays (3, N) on a plane, and column and row of the table's texture there."""
        depth = (eye[2] - np.float32(height)) / np.maximum(-down[2], _FLATTEST)
        scale, corner = np.float32(1.0 / PIXEL), (eye[:2] - self._corner) / PIXEL - 0.5
        step = depth * scale
        return depth, np.float32(corner[1]) + step * down[1], np.float32(corner[0]) + step * down[0]

    def shadows(self) -> np.ndarray:
        """How much of the light each `_COARSE` pixels of the table's texture lack (X, Y), 0 to 1."""
        if not self._fixed_shade.size:
            rows, columns = self._table.shape[:2]
            self._fixed_shade = np.zeros((rows // _COARSE, columns // _COARSE), dtype=np.uint8)
            self._fill(self._fixed_shade, self._fixed)
        shade = self._fixed_shade.copy()
        self._fill(shade, self._casters)
        return cv2.GaussianBlur(shade, (0, 0), _PENUMBRA).astype(np.float32) / np.float32(255.0)

    def _fill(self, shade: np.ndarray, outlines: _Outlines) -> None:
        corners = outlines.in_world()
        fall = corners[..., :2] - np.maximum(corners[..., 2:] - self._height, 0.0) * self._slope
        fall = np.rint((fall - self._corner) / (_COARSE * PIXEL))[..., ::-1].astype(np.int32)
        for outline in fall:
            cv2.fillConvexPoly(shade, cv2.convexHull(outline), 255)


class _Outlines:
    """Corners of shapes, wherever their links are."""

    def __init__(self, client: int, casters: Sequence[Caster]) -> None:
        self._client = client
        self._links = [(body, link) for body, link, _ in casters]
        self._corners = np.array([_corners(part) for _, _, part in casters]).reshape(-1, 2 * _SIDES, 3)

    def in_world(self) -> np.ndarray:
        """(S, 2 * sides, 3) [m]."""
        poses: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}
        for body in dict.fromkeys(body for body, _ in self._links):
            links = sorted({link for b, link in self._links if b == body and link >= 0})
            position, quat = pybullet.getBasePositionAndOrientation(body, physicsClientId=self._client)
            poses[body, -1] = (np.array(position), _rotation(quat))
            if links:
                states = pybullet.getLinkStates(body, links, physicsClientId=self._client)
                for link, state in zip(links, states, strict=True):
                    poses[body, link] = (np.array(state[4]), _rotation(state[5]))
        turn = np.array([poses[one][1] for one in self._links]).reshape(-1, 3, 3)
        shift = np.array([poses[one][0] for one in self._links]).reshape(-1, 3)
        return np.einsum("sij,skj->ski", turn, self._corners) + shift[:, None]


def _repeated(texture: np.ndarray, column: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Colours (N, 3) of a texture without end at columns and rows (N,)."""
    found = []
    for start in range(0, len(column), _MOST_ROWS):
        x, y = (one[start : start + _MOST_ROWS].reshape(-1, 1) for one in (column, row))
        part = cv2.remap(texture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        found.append(part.reshape(-1, 3))
    return np.concatenate(found)


def _rotation(quat: Sequence[float]) -> np.ndarray:
    return np.array(pybullet.getMatrixFromQuaternion(quat)).reshape(3, 3)


def _corners(part: Part) -> np.ndarray:
    """Points (2 * sides, 3) about a part's outline, in the frame that its pose is given in."""
    if isinstance(part, Box):
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        return part.part_in_body.apply(np.tile(signs * part.half_extents, (2, 1)))
    angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
    circle = part.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ends = [np.column_stack([circle, np.full(_SIDES, side * 0.5 * part.length)]) for side in (-1.0, 1.0)]
    return part.part_in_body.apply(np.concatenate(ends))
