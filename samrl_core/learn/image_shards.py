"""Images on disk: colour in 8 bit, depth in tenths of a millimetre, and the camera; XYZ is worked out anew.

For machines that draw more slowly than they learn. A sample is drawn once, from a view and with a look of
its own; noise is added anew for every batch. What was made is the same, byte by byte, whether the making was
interrupted or not.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch

from samrl_core.errors import InputError
from samrl_core.learn.batch_render import BatchRenderer
from samrl_core.learn.image_noise import ImageNoiseSettings, noisy
from samrl_core.learn.network_image import network_image
from samrl_core.learn.packed_images import DEPTH_UNIT
from samrl_core.learn.rendered_samples import DrawSettings, Scenes, rng_of
from samrl_core.learn.samples import IMAGE
from samrl_core.learn.shards import DataInfo, ShardFolder
from samrl_core.learn.surface import world_points
from samrl_core.learn.views import cameras_of, draw_views
from samrl_core.robots.robot import CellSpec

SHARD_SIZE = 1000
_TARGET = "target_"  # before the name of what an image is to teach


def make_images(
    scenes: Scenes,
    renderer: BatchRenderer,
    folder: Path,
    seed: int,
    views_per_state: int = 1,
    settings: DrawSettings | None = None,
    shard_size: int = SHARD_SIZE,
    progress: Callable[[int, int], None] = lambda done, wanted: None,
) -> ShardFolder:
    """Draws every scene from some views, or goes on where an earlier call was interrupted.

    Sample k shows scene k modulo their number, so that a part of the data set shows all of them.

    Args:
        scenes: of the renderer's model.
        renderer: on the device that draws.
        folder: of the data set.
        seed: of views and looks.
        views_per_state: images of each scene.
        settings: what varies; the noise is not stored.
        shard_size: images per file.
        progress: called after each shard with the images made and wanted.

    Raises:
        InputError: the folder holds another data set, or no view per state.
    """
    if views_per_state < 1:
        raise InputError(f"views_per_state is {views_per_state}, must be at least 1")
    model, s = renderer.model, settings or DrawSettings()
    digest = zlib.crc32(np.ascontiguousarray(scenes.frames).tobytes())
    for name in sorted(scenes.targets):
        digest = zlib.crc32(np.ascontiguousarray(scenes.targets[name]).tobytes(), digest)
    if scenes.view is not None:
        digest = zlib.crc32(np.ascontiguousarray(scenes.view).tobytes(), digest)
    settings_of = {
        "views": asdict(s.views),
        "looks": s.looks.record(),
        "scenes": len(scenes),
        "crc32": digest,
    }
    count = views_per_state * len(scenes)
    lens = model.cell.intrinsics
    data = ShardFolder(
        folder, DataInfo("images", model.task.name, lens, seed, count, shard_size, settings_of)
    )
    done = count - sum(data.info.size(k) for k in data.missing())
    progress(done, count)
    for shard in data.missing():
        data.write(shard, _shard(scenes, renderer, data.info, shard, s))
        done += data.info.size(shard)
        progress(done, count)
    return data


def _shard(
    scenes: Scenes, renderer: BatchRenderer, info: DataInfo, shard: int, settings: DrawSettings
) -> dict[str, np.ndarray]:
    first, size = shard * info.shard_size, info.size(shard)
    which = np.arange(first, first + size) % len(scenes)
    rng, region = info.rng(shard), renderer.model.task.view_region()
    views = draw_views(region, rng, size, settings.views) if scenes.view is None else scenes.view[which]
    looks = settings.looks.sample(renderer.model, rng, size)
    colors, depths = [], []
    for start in range(0, size, renderer.chunk):
        few = slice(start, start + renderer.chunk)
        with torch.no_grad():
            camera = cameras_of(torch.from_numpy(views[few]).to(renderer.device))
            r = renderer.render(scenes.frames[which[few]], camera, looks.rows(few))
            steps = torch.where(torch.isfinite(r.depth), r.depth / DEPTH_UNIT, torch.zeros_like(r.depth))
            depths.append(steps.round().clamp(0, 65535).to("cpu", torch.int32).numpy().astype(np.uint16))
            colors.append((255.0 * r.color.clamp(0.0, 1.0)).round().to("cpu", torch.uint8).numpy())
    arrays = {
        "color": np.concatenate(colors),
        "depth": np.concatenate(depths),
        "view": views,
        "tip_in_base": scenes.tip_in_base[which],
        "scene": which,
    }
    return {**arrays, **{_TARGET + name: array[which] for name, array in scenes.targets.items()}}


class ImageSamples:
    """`Samples` from a finished data set of images, kept in memory; noise follows from seed and indices."""

    def __init__(
        self,
        folder: Path,
        task: str,
        cell: CellSpec,
        seed: int = 0,
        noise: ImageNoiseSettings | None = None,
    ) -> None:
        """Reads all shards.

        Args:
            folder: of the data set.
            task: that it must be of.
            cell: whose camera it must be of.
            seed: of the noise.
            noise: of the camera; None leaves it out.

        Raises:
            InputError: it is unfinished, damaged, or of another task or camera.
        """
        data = ShardFolder.open(folder, "images", task)
        if data.info.intrinsics != cell.intrinsics:
            raise InputError(
                f"images in {folder} were taken with {data.info.intrinsics}, the cell has {cell.intrinsics}; "
                f"make them anew"
            )
        parts = list(data.read_all())
        self._arrays = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        self._cell, self._seed, self._noise = cell, seed, noise

    def __len__(self) -> int:
        return len(self._arrays["scene"])

    @property
    def scene(self) -> np.ndarray:
        """Which scene each image shows, (N,), e.g. to part training and validation by."""
        return self._arrays["scene"]

    def batch(self, indices: np.ndarray, device: torch.device) -> dict[str, torch.Tensor]:
        """See `Samples`."""
        which = np.asarray(indices, dtype=np.int64)
        few = {name: torch.from_numpy(array) for name, array in self._rows(which).items()}
        color = few["color"].to(device, torch.float32) / 255.0
        metres = DEPTH_UNIT * few["depth"].to(device, torch.float64)
        seen = metres > 0
        depth = torch.where(seen, metres, torch.inf)
        rotation, translation = cameras_of(few["view"].to(device))
        eye = -(rotation.mT @ translation[..., None])[..., 0]
        points = world_points(metres, rotation.mT, eye, self._cell.intrinsics)
        xyz = torch.where(seen[..., None], points, torch.zeros_like(points)).float()
        if self._noise is not None:
            seed = int(rng_of(self._seed, which).integers(2**62))
            generator = torch.Generator(device).manual_seed(seed)
            color, xyz, seen = noisy(color, xyz, depth, eye, generator, self._noise)
        base = self._cell.tool_base_in_world
        tips = torch.from_numpy(base.apply(self._arrays["tip_in_base"][which])).to(device)
        targets = {name[len(_TARGET) :]: few[name].to(device) for name in few if name.startswith(_TARGET)}
        return {IMAGE: network_image(color, xyz, seen, tips, base), **targets}

    def _rows(self, which: np.ndarray) -> dict[str, np.ndarray]:
        """What a batch takes from memory; torch has no 16 bit integers without sign."""
        names = [n for n in self._arrays if n in ("color", "view") or n.startswith(_TARGET)]
        depth = self._arrays["depth"][which].astype(np.int32)
        return {**{name: self._arrays[name][which] for name in names}, "depth": depth}
