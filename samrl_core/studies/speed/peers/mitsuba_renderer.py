"""Mitsuba 3's `prb_projective` on the thread scene: gradients of colour and position images by vertices.

Mitsuba renders one triple of channels at a time, so that colour and position are two renderings. Both are
vertex attributes: emitted where nothing is lit, as the reflectance of a diffuse surface where it is.
"""
# The library's stubs lack or misstate these.

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from samrl_core.cell.types.camera import Intrinsics

mi.set_variant("llvm_ad_rgb")
mi.set_log_level(mi.LogLevel.Error)

_ATTRIBUTE = "vertex_value"


@dataclass(frozen=True, eq=False)
class VertexGradient:
    """Of one weighted sum over the image."""

    by_position: np.ndarray  # (V, 3) by the vertices' positions
    by_value: np.ndarray  # (V, 3) by the rendered attribute


class MitsubaThread:
    """The scene with one attribute per vertex, seen by one camera.

    Args:
        vertices: (V, 3) in world [m].
        faces: (F, 3).
        values: (V, 3) that are rendered: colours, or positions.
        rotation: (3, 3) world to camera, optical axes.
        translation: (3,) world to camera [m].
        lens: square pixels, principal point in the middle.
        towards_light: direction in world of a directional light, or None for plain emission.
    """

    def __init__(
        self,
        vertices: np.ndarray,
        faces: np.ndarray,
        values: np.ndarray,
        rotation: np.ndarray,
        translation: np.ndarray,
        lens: Intrinsics,
        towards_light: tuple[float, float, float] | None = None,
    ) -> None:
        mesh = mi.Mesh("thread", len(vertices), len(faces))
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = np.ascontiguousarray(vertices, np.float32).ravel()
        parameters["faces"] = np.ascontiguousarray(faces, np.uint32).ravel()
        parameters.update()
        mesh.add_attribute(_ATTRIBUTE, 3, np.ascontiguousarray(values, np.float32).ravel())
        shape: dict[str, Any] = {"type": "ply", "face_normals": True}
        texture = {"type": "mesh_attribute", "name": _ATTRIBUTE}
        whole: dict[str, Any] = {"type": "scene"}
        if towards_light is None:
            shape["emitter"] = {"type": "area", "radiance": texture}
            depth = 1
        else:
            shape["bsdf"] = {"type": "twosided", "nested": {"type": "diffuse", "reflectance": texture}}
            away = [-float(x) for x in towards_light]
            whole["light"] = {"type": "directional", "direction": away, "irradiance": np.pi}
            depth = 2
        axes = np.eye(4)
        axes[:3, :3] = rotation.T @ np.diag([-1.0, -1.0, 1.0])  # Mitsuba's x points left and its y up
        axes[:3, 3] = -rotation.T @ translation
        whole["sensor"] = {
            "type": "perspective",
            "fov": float(np.rad2deg(2 * np.arctan(0.5 * lens.width / lens.fx))),
            "to_world": mi.ScalarTransform4f(axes.tolist()),
            "film": {
                "type": "hdrfilm",
                "width": lens.width,
                "height": lens.height,
                "pixel_format": "rgb",
                "component_format": "float32",
                "rfilter": {"type": "box"},
                "sample_border": True,
            },
        }
        whole["integrator"] = {"type": "prb_projective", "sppi": 0, "max_depth": depth}
        with TemporaryDirectory() as folder:
            path = Path(folder) / "thread.ply"
            mesh.write_ply(str(path))
            self._scene = mi.load_dict(whole | {"thread": shape | {"filename": str(path)}})
        self._parameters = mi.traverse(self._scene)
        keys = [str(key) for key in self._parameters.keys()]
        self._position = next(key for key in keys if key.endswith("vertex_positions"))
        self._value = next(key for key in keys if key.endswith(_ATTRIBUTE))

    def image(self, samples: int, seed: int = 0) -> np.ndarray:
        """(H, W, 3)."""
        return np.array(mi.render(self._scene, spp=samples, seed=seed))

    def gradient(self, weights: np.ndarray, samples: int, seed: int = 0) -> VertexGradient:
        """Of sum(weights x image), weights (H, W, 3), by all vertices' positions and values."""
        p = self._parameters
        for key in (self._position, self._value):
            dr.enable_grad(p[key])
        p.update()
        image = mi.render(self._scene, p, spp=samples, seed=seed)
        dr.backward(dr.sum(image * mi.TensorXf(np.ascontiguousarray(weights, np.float32)), axis=None))
        position, value = (np.array(dr.grad(p[key])).reshape(-1, 3) for key in (self._position, self._value))
        for key in (self._position, self._value):
            dr.disable_grad(p[key])
        return VertexGradient(position, value)
