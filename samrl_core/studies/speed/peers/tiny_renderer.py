"""PyBullet's TinyRenderer on a mesh: colour and depth, without shadow and mask."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pybullet
import trimesh

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.world.pybullet.camera import projection_matrix


def tiny_renderer(
    vertices: np.ndarray,
    faces: np.ndarray,
    rotation: np.ndarray,
    translation: np.ndarray,
    lens: Intrinsics,
) -> Callable[[], None]:
    """A function that renders one image.

    Args:
        vertices: (V, 3) in world [m].
        faces: (F, 3).
        rotation: (3, 3) world to camera.
        translation: (3,) world to camera [m].
        lens: and size of the image.
    """
    client = pybullet.connect(pybullet.DIRECT)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "scene.obj"
        trimesh.Trimesh(vertices, faces, process=False).export(path)
        shape = pybullet.createVisualShape(
            pybullet.GEOM_MESH, fileName=str(path), rgbaColor=[0.8, 0.5, 0.3, 1.0], physicsClientId=client
        )
    pybullet.createMultiBody(0.0, -1, shape, physicsClientId=client)
    view = np.eye(4)
    view[:3, :3], view[:3, 3] = rotation, translation
    view = np.diag([1.0, -1.0, -1.0, 1.0]) @ view
    options = {
        "width": lens.width,
        "height": lens.height,
        "viewMatrix": list(view.T.ravel()),
        "projectionMatrix": list(projection_matrix(lens)),
        "shadow": 0,
        "flags": pybullet.ER_NO_SEGMENTATION_MASK,
        "renderer": pybullet.ER_TINY_RENDERER,
        "physicsClientId": client,
    }

    def render() -> None:
        pybullet.getCameraImage(**options)

    color = np.asarray(pybullet.getCameraImage(**options)[2]).reshape(lens.height, lens.width, 4)
    if color[..., :3].std() < 1.0:
        raise RuntimeError("TinyRenderer drew an empty image of the benchmark's scene")
    return render
