"""A ball in analytic pictures: every pixel's ray against the sphere, and a table below it."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.cell.types.camera import Camera, Intrinsics
from samrl_core.cell.types.pose import look_at
from samrl_core.model.fusion.masked_view import MaskedView

K = Intrinsics.from_fov(96, 96, math.radians(30.0))
RADIUS = 0.04  # [m]
CENTER = np.array([0.5, 0.1, RADIUS])  # it lies on the table


def cameras(count: int, distance: float = 0.4) -> list[Camera]:
    """Around the ball, low and high in turn."""
    turn = 2 * math.pi * np.arange(count) / count
    rise = np.where(np.arange(count) % 2 == 0, math.radians(20.0), math.radians(60.0))
    towards = np.stack([np.cos(turn) * np.cos(rise), np.sin(turn) * np.cos(rise), np.sin(rise)], axis=1)
    return [Camera(K, look_at(CENTER + distance * way, CENTER)) for way in towards]


def photo(camera: Camera, table: bool = True) -> MaskedView:
    """Without noise. Colour says where on the ball a pixel is: its unit direction, moved into 0..1."""
    one = camera.unproject(np.ones((K.height, K.width)))
    eye = camera.camera_in_world.position
    ray = one - eye  # one metre deep along the optical axis
    a = (ray**2).sum(axis=-1)
    b = ray @ (eye - CENTER)
    root = b**2 - a * (((eye - CENTER) ** 2).sum() - RADIUS**2)
    hit = root > 0
    side = -1.0 if np.linalg.norm(eye - CENTER) > RADIUS else 1.0  # from inside, the far wall
    ball = np.where(hit, (-b + side * np.sqrt(np.maximum(root, 0.0))) / a, np.nan)
    floor = np.where(ray[..., 2] < 0, -eye[2] / np.minimum(ray[..., 2], -1e-9), np.nan) if table else np.nan
    depth = np.where(hit, ball, floor)
    color = np.where(hit[..., None], 0.5 + 0.5 * (eye + ray * ball[..., None] - CENTER) / RADIUS, 0.3)
    return MaskedView(np.nan_to_num(color), depth, hit, camera)


def photos(count: int = 12, table: bool = True) -> list[MaskedView]:
    return [photo(camera, table) for camera in cameras(count)]
