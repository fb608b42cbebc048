"""What is sealed of a camera's world: its cause, and true sizes in the units of the effect's parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.blind_test.camera_worlds.forge_plan import CameraItem
from samrl_core.blind_test.camera_worlds.plan import UNKNOWN, instance_of
from samrl_core.cell.instance.cell_instance import CellInstance
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.true_cell import true_cell

SERIES = 4  # of disturbances: worlds of a camera
_SIX = (("x", "m"), ("y", "m"), ("z", "m"), ("rx", "rad"), ("ry", "rad"), ("rz", "rad"))


def label_of(item: CameraItem, cell: CellSpec) -> dict[str, Any]:
    """For JSON, in the shape of every other sealed label."""
    instance, truth = instance_of(item.world, cell)
    effects: list[dict[str, Any]] = []
    if item.set != "none":
        family, _, place = truth.answer.partition("@")
        unknown = truth.answer == UNKNOWN
        effects.append(
            {
                "family": item.world.cause if unknown else family,
                "place": "" if unknown else place,
                "form": "T2" if unknown else "T0",
                "severity": item.world.severity,
                "onset": None,
                "series": SERIES,
                "parameters": {} if unknown else _parameters(family, place, instance, cell),
            }
        )
    return {
        "schema": 1, "id": item.id, "set": item.set, "engine": "pybullet", "arm": "camera", "programme": 0,
        "cause": item.world.cause, "effects": effects,
        "background": {"scale": 1.0, "name": str(instance.name)}, "seed": item.world.seed,
    }  # fmt: skip


def _parameters(family: str, place: str, i: CellInstance, cell: CellSpec) -> dict[str, dict[str, Any]]:
    """True sizes, what the background has of the same quantity included."""
    true = true_cell(cell, i)
    if family == "hand_eye":
        return _small(cell.camera_in_flange, true.camera_in_flange)
    if family == "base_to_base":
        stated, is_at = (c.camera_base_in_world.inverse() @ c.tool_base_in_world for c in (cell, true))
        return _small(stated, is_at)
    if family == "encoder_offset":
        name = place.partition(":")[2]
        for role in ("camera_arm", "tool_arm"):
            if name in cell.arm(role).joint_names:
                zero = i.calibration.zeros(role)[cell.arm(role).joint_names.index(name)]
                return {"e": _of(zero, "rad")}
    values = {
        "depth_scale": {"a": _of(i.depth.scale, "1"), "b": _of(i.depth.bias, "m")},
        "intrinsics": {
            "fx": _of(i.optics.focal[0], "1"), "fy": _of(i.optics.focal[1], "1"),
            "cx": _of(i.optics.centre[0], "1"), "cy": _of(i.optics.centre[1], "1"),
        },
        "lens_distortion": {
            "k1": _of(i.optics.radial[0], "1"), "k2": _of(i.optics.radial[1], "1"),
            "p1": _of(i.optics.tangential[0], "1"), "p2": _of(i.optics.tangential[1], "1"),
        },
        "lighting": {"g": _of((1.0 + i.look.light_strength) * (1.0 + i.optics.exposure) - 1.0, "1")},
        "camera_latency": {"T": _of(i.timing.stamp_late + i.timing.clock_offset, "s")},
    }  # fmt: skip
    return values.get(family, {})


def _small(stated: Pose, true: Pose) -> dict[str, dict[str, Any]]:
    """Of stated . exp(x, y, z, rx, ry, rz) = true, to first order in the rotation for the translation."""
    between = stated.inverse() @ true
    vector = np.concatenate([between.position, Rotation.from_quat(between.quat_xyzw).as_rotvec()])
    return {name: _of(value, unit) for (name, unit), value in zip(_SIX, vector, strict=True)}


def _of(value: Any, unit: str) -> dict[str, Any]:
    return {"value": float(value), "unit": unit}
