"""A camera as it is: its lens, its exposure and its errors around the ideal picture of a PyBullet client."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.cell.instance.cell_instance import STREAM, CellInstance
from samrl_core.cell.types.camera import Camera, Intrinsics
from samrl_core.cell.types.pose import Pose, rotation_vector
from samrl_core.cell.world.bench_texture import paint_floor, paint_table
from samrl_core.cell.world.image_errors import ImageErrors
from samrl_core.cell.world.lens import Lens
from samrl_core.cell.world.pybullet.bench import Bench, Caster
from samrl_core.cell.world.pybullet.camera import Picture, TinyCamera
from samrl_core.common.streams import stream

_SMEAR = 0.5  # a motion of the image that is worth more than one rendering [px]
_DISTANCE = 0.35  # of what is looked at, roughly [m]


class RealCamera:
    """Takes pictures with an instance's optics, light, depth errors and segmentation.

    Args:
        client: physics client.
        instance: of the cell.
        intrinsics: nominal ones, for image size and pinhole.
        labels: see `TinyCamera`.
        light_direction: nominal, towards the light, in world.
        casters: shapes that cast shadows, see `Bench`.
        fixed: further ones, which stand still during an episode.
        table_height: of its top over the drawn one [m].
    """

    def __init__(
        self,
        client: int,
        instance: CellInstance,
        intrinsics: Intrinsics,
        labels: dict[tuple[int, int], int],
        light_direction: tuple[float, float, float],
        casters: Sequence[Caster],
        fixed: Sequence[Caster],
        table_height: float = 0.0,
    ) -> None:
        self._lens = Lens(instance.optics, intrinsics)
        light = true_light(light_direction, instance)
        self._tiny = TinyCamera(client, self._lens.ideal, labels, light, shadow=False)
        rng, look = look_stream(instance), instance.look
        table = paint_table(rng, min(look.texture, 1.5), look.bench_colour, round(0.5 * look.clutter))
        floor = paint_floor(rng)
        self._bench = Bench(
            client, self._lens.ideal, table, floor, casters, fixed, light, look.shadow, table_height
        )
        self._errors = ImageErrors(instance, intrinsics)
        self._nominal = intrinsics

    def begin(self) -> None:
        """An episode begins: bodies were laid anew."""
        self._bench.begin()

    def take(self, exposures: Sequence[Pose], rng: np.random.Generator) -> Picture:
        """A picture without the sensor's noise.

        Args:
            exposures: camera in world, in the middle of the exposure first; colours are their mean.
            rng: of the errors.
        """
        shadows = self._bench.shadows()
        pictures = [self._bench.paint(self._tiny.render(pose), pose, shadows) for pose in exposures]
        mean = np.asarray(np.mean([p.color for p in pictures], axis=0, dtype=np.float32))
        color = self._errors.expose(self._lens.color(mean))
        depth = self._errors.measure(rng, self._lens.depth(pictures[0].depth))
        return Picture(color, depth, self._errors.segment(rng, self._lens.nearest(pictures[0].mask)))

    def exposures(self, middle: Pose, before: Pose, after: Pose) -> tuple[Pose, ...]:
        """Poses to render: one of a camera that stands still, three of one that moves meanwhile."""
        ahead = middle.apply(np.array([0.0, 0.0, _DISTANCE]))
        ends = [Camera(self._nominal, pose).project(ahead)[:2] for pose in (before, after)]
        smear = float(np.linalg.norm(ends[1] - ends[0]))
        return (middle, before, after) if smear > _SMEAR else (middle,)


def look_stream(instance: CellInstance) -> np.random.Generator:
    """What the table is painted and littered from."""
    return stream(instance.name.seed, STREAM, instance.name.purpose, "look", "bench")


def true_light(nominal: tuple[float, float, float], instance: CellInstance) -> tuple[float, float, float]:
    """Towards the light in world: turned about the vertical, and lower or higher."""
    look = instance.look
    turned = rotation_vector(np.array([0.0, 0.0, look.light_turn])).apply(np.array(nominal))
    flat = float(np.hypot(turned[0], turned[1]))
    elevation = float(np.clip(np.arctan2(turned[2], flat) + look.light_drop, 0.35, 1.5))
    length = float(np.linalg.norm(turned))
    x, y = turned[:2] / flat * np.cos(elevation) * length
    return float(x), float(y), float(np.sin(elevation) * length)
