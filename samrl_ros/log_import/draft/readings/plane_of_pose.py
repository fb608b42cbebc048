"""Depth of the plane of a board along a pixel's ray, as formulas over the columns of the board's pose."""

from __future__ import annotations

from samrl_ros.log_import.draft.tracks.found_track import FoundTrack


def plane_formulas(track: FoundTrack) -> tuple[dict[str, str], dict[str, str]] | None:
    """Columns and values of a mapping, of which `plane` is n . t / n . ray; None of poses of another kind.

    n is the board's z axis by its quaternion or, as OpenCV's solvePnP gives it, by its rotation vector
    (Rodrigues' formula); the ray is (x, y, 1) of pixel (u, v) and the intrinsics of the images.
    """
    kind = track.rotation
    if kind not in ("quaternion", "rotation_vector") or (kind == "quaternion" and not track.order):
        return None
    columns: dict[str, str] = {}
    values: dict[str, str] = {}
    for letter, part in (("t", "position"), ("r", kind)):
        for k, component in enumerate(track.columns[part]):
            name = f"{letter}{k}"
            if component.index is None:
                columns[name] = component.column
            else:
                columns.setdefault(f"{letter}_", component.column)
                values[name] = f"{letter}_[{component.index}]"
    if kind == "quaternion":
        x, y, z, w = ("r1", "r2", "r3", "r0") if track.order == "wxyz" else ("r0", "r1", "r2", "r3")
        normal = (f"2*({x}*{z} + {w}*{y})", f"2*({y}*{z} - {w}*{x})", f"1 - 2*({x}*{x} + {y}*{y})")
    else:
        values["angle"] = "sqrt(r0*r0 + r1*r1 + r2*r2) + 1e-12"
        values["s"], values["c"] = "sin(angle) / angle", "(1 - cos(angle)) / angle**2"
        normal = ("s*r1 + c*r0*r2", "c*r1*r2 - s*r0", "cos(angle) + c*r2*r2")
    values |= {f"n{k}": formula for k, formula in enumerate(normal)}
    values["plane"] = "(n0*t0 + n1*t1 + n2*t2) / (n0*ray_x + n1*ray_y + n2)"
    return columns | {"ray_x": "ray_x", "ray_y": "ray_y"}, values
