"""What images tell of a lamp: information on its strength and direction, colours of the cell free or known.

The model's own renderings of the motion that worlds of a camera are recorded with, no simulated world:
`python -m samrl_core.studies.light_information`. A brightness is light times paint, so that strength shows
against colours that are known alone; direction shows in how differently faces of one paint are lit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.image_recording import ImageTolerances
from samrl_core.diagnosis.residuals.images.expected import NOISE, expected_scene
from samrl_core.diagnosis.residuals.images.image_trial import DEPTH_NOISE_PER_Z2
from samrl_core.diagnosis.residuals.images.noise import AS_ONE
from samrl_core.diagnosis.residuals.images.rows import ComparedFrame, Rows, frame_rows, joined
from samrl_core.diagnosis.residuals.images.scene import ImageScene
from samrl_core.diagnosis.residuals.images.spreads import stated_spreads
from samrl_core.model.scene.settings import ModelSettings
from samrl_core.studies.camera_angles import FRAMES, MOTIONS, SECONDS, TASK

FREE = 1e3  # standard deviation of a logarithm, or of radians, that nobody knows
CARD = 0.05  # half width of a reference card's grey
STEP = 0.05  # of the light's angles [rad] and of the lamp's logarithm, for differences
PAINTS = ("tint", "shading", "paint_object", "paint_static")
LAMP = ("strength", "azimuth", "elevation", "one lamp of several")
KNOWN: dict[str, dict[str, float]] = {  # what is known, as half widths of tolerances
    "colours free": dict.fromkeys((*PAINTS, "light"), FREE),
    "as tolerances are stated, light free": {"light": FREE},
    "and the table a card of known grey": {"light": FREE, "paint_static": CARD},
}


def light_columns(scene: ImageScene, frames: Sequence[ComparedFrame]) -> Rows:
    """Rows of colour with columns of `LAMP` (1, n) beside those of tolerances.

    Strength is of all light. One lamp of several adds to what has a direction and leaves what comes from all
    sides; azimuth and elevation are those of the light. The last three by differences of renderings.
    """
    settings = ModelSettings(threads=1)
    x, y, z = settings.towards_light
    azimuth, elevation = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
    stronger = 1.0 + (1.0 - settings.ambient) * np.expm1(STEP)
    changed = {
        "azimuth": (replace(settings, towards_light=_towards(azimuth + STEP, elevation)), 1.0),
        "elevation": (replace(settings, towards_light=_towards(azimuth, elevation + STEP)), 1.0),
        "one lamp of several": (replace(settings, ambient=settings.ambient / stronger), stronger),
    }
    lit = {name: (scene.lit_by(other), factor) for name, (other, factor) in changed.items()}
    made = []
    for frame in frames:
        plain = _color_rows(scene, scene, frame, 1.0)
        columns = {"strength": plain.columns["light"]}
        for name, (other, factor) in lit.items():
            columns[name] = (_color_rows(scene, other, frame, factor).value - plain.value)[None] / STEP
        made.append(replace(plain, columns=plain.columns | columns))
    return joined(made)


def deviations(rows: Rows, known: Mapping[str, float]) -> dict[str, float]:
    """Least standard deviations of each of `LAMP`, strength and both angles open beside it.

    `known` holds half widths by name of a tolerance, others are as stated; `light` is the strength's own.
    """
    by = ImageTolerances().deviation
    spreads = {**stated_spreads(ImageTolerances()), **{n: np.array([by * w]) for n, w in known.items()}}
    noise = NOISE["color"] * rows.shape * np.sqrt(AS_ONE["color"])
    out = {}
    for wanted in LAMP:
        names = [*(n for n in LAMP[:3] if n != wanted), *PAINTS]
        open_ = [FREE if n in LAMP[1:] else spreads["light" if n == "strength" else n] for n in names]
        parts = [rows.columns[wanted] * FREE]
        parts += [np.broadcast_to(s, len(rows.columns[n]))[:, None] * rows.columns[n]
                  for n, s in zip(names, open_, strict=True)]  # fmt: skip
        design = np.concatenate(parts).T / noise[:, None]
        covariance = np.linalg.inv(design.T @ design + np.eye(design.shape[1]))
        out[wanted] = FREE * float(np.sqrt(covariance[0, 0]))
    return out


def expected_frames(scene: ImageScene, count: int = FRAMES) -> list[ComparedFrame]:
    """So many views of the motion, as the model sees them, without colours."""
    recording = MOTIONS["rolled views"](task_named(TASK), cell_named(DEFAULT_CELL))
    frames = []
    for time in np.linspace(0.3, SECONDS - 0.3, count):
        view = scene.view(recording, float(time))
        rendered = scene.render(scene.vertices(view, np.eye(4)))
        depth = rendered.xyz.numpy()[..., 2].astype(float)
        depth[~np.isfinite(rendered.depth.numpy())] = np.nan
        color = np.zeros((*depth.shape, 3), np.float32)
        frames.append(ComparedFrame(color, depth, rendered.label.numpy(), view))
    return frames


def _towards(azimuth: float, elevation: float) -> tuple[float, float, float]:
    flat = np.cos(elevation)
    return float(flat * np.cos(azimuth)), float(flat * np.sin(azimuth)), float(np.sin(elevation))


def _color_rows(scene: ImageScene, lit: ImageScene, frame: ComparedFrame, factor: float) -> Rows:
    """Rows of a frame that is seen in another light, so many times as bright."""
    color = lit.render(scene.vertices(frame.view, np.eye(4)), shaded=True).color.numpy()
    seen = replace(frame, color=(factor * color).astype(np.float32))
    return frame_rows(scene, seen, np.eye(4), DEPTH_NOISE_PER_Z2)["color"]


def main() -> None:
    """Print a table: least standard deviations by what is known."""
    recording = MOTIONS["rolled views"](task_named(TASK), cell_named(DEFAULT_CELL))
    scene = expected_scene(recording)
    rows = light_columns(scene, expected_frames(scene))
    print("| known | " + " | ".join(LAMP) + " |")
    for words, known in KNOWN.items():
        found = deviations(rows, known)
        print(f"| {words} | " + " | ".join(f"{found[n]:.3g}" for n in LAMP) + " |", flush=True)


if __name__ == "__main__":
    main()
