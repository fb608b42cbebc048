"""How points move in the camera's axes per unit of whatever may be off: one formula for vertices and pixels.

A wrong transform, joint zero, clock or lens moves what the camera sees. A point p in the camera's axes then
moves by dp = (v + w x p) for a twist (v, w), or along the image for a lens. Outlines follow by the renderer's
adjoint, depth by the chain rule at the pixel.
"""

from __future__ import annotations

import numpy as np

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.diagnosis.residuals.images.scene import OBJECT, TOOL, FrameGeometry, ImageScene

Flows = dict[str, np.ndarray]  # name -> (p, N, 3) [m per unit]


def flows(
    scene: ImageScene, view: FrameGeometry, points: np.ndarray, group: np.ndarray, object_at: np.ndarray
) -> Flows:
    """Of points (N, 3) in the camera's axes that belong to `group` (N,); the object stands at `object_at`."""
    turn, place = view.camera[:3, :3], view.camera[:3, 3]
    ones = np.ones(len(points))
    on_object, on_tool = (group == OBJECT).astype(float), (group == TOOL).astype(float)
    eye = np.eye(6)
    base = scene.cell.tool_base_in_world.matrix()
    origin = (object_at - place) @ turn
    flange = view.flange
    return {
        "hand_eye": -moved(eye, points, ones),
        "base": moved(in_camera(eye, base, view.camera), points, ones),
        "camera_zeros": moved(view.camera_jacobian.T, points, ones),
        "camera_late": moved(view.camera_rate[None], points, ones),
        "tool_zeros": moved(-_world_twists(view.tool_jacobian.T, view), points, on_tool),
        "tool_late": moved(-_world_twists(view.tool_rate[None], view), points, on_tool),
        "held": moved(in_camera(eye, flange, view.camera), points, on_tool),
        "object": moved(in_camera(eye, _at(object_at), view.camera), points, on_object),
        "object_scale": ((points - origin) * on_object[:, None])[None],
        **lens_flows(scene.intrinsics, points),
    }


def lens_flows(k: Intrinsics, points: np.ndarray) -> Flows:
    """Of the lens: displacements across the axis that move the image as the true lens does."""
    x, y, z = points.T
    safe = np.where(np.abs(z) < 1e-6, 1e-6, z)
    a, b, none = x / safe, y / safe, np.zeros_like(x)
    a, b = np.clip(a, -1.5, 1.5), np.clip(b, -1.5, 1.5)
    r2 = a * a + b * b

    def across(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.stack([u * z, v * z, none], axis=-1)

    return {
        "focal": np.stack([across(a, none), across(none, b)]),
        "centre": np.stack([across(none + k.width / k.fx, none), across(none, none + k.height / k.fy)]),
        "radial": np.stack([across(a * r2, b * r2), across(a * r2 * r2, b * r2 * r2)]),
        "tangential": np.stack(
            [across(2 * a * b, r2 + 2 * b * b), across(r2 + 2 * a * a, 2 * a * b)]
        ),
    }  # fmt: skip


def moved(twists: np.ndarray, points: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Displacements (p, N, 3) of points by twists (p, 6) about the camera's origin."""
    out = twists[:, None, :3] + np.cross(twists[:, None, 3:], points[None])
    return out * share[:, None]


def in_camera(twists: np.ndarray, frame: np.ndarray, camera: np.ndarray) -> np.ndarray:
    """Twists (p, 6) in a frame (4, 4) of the world, as twists about the camera's origin in its axes."""
    linear, angular = twists[:, :3] @ frame[:3, :3].T, twists[:, 3:] @ frame[:3, :3].T
    linear = linear + np.cross(angular, camera[:3, 3] - frame[:3, 3])
    return np.concatenate([linear @ camera[:3, :3], angular @ camera[:3, :3]], axis=1)


def _world_twists(twists: np.ndarray, view: FrameGeometry) -> np.ndarray:
    """Twists (p, 6) in world about its origin."""
    return in_camera(twists, np.eye(4), view.camera)


def _at(position: np.ndarray) -> np.ndarray:
    out = np.eye(4)
    out[:3, 3] = position
    return out
