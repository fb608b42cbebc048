"""Cached training images: every scene is rendered several times, each with its own view and appearance.

A network of this size learns from an image ten times faster than a GPU renders one. A cached image can be
used again and again; a thousand views of the same states teach more than new views in every epoch.
"""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
import torch

from samrl_core.common.errors import InputError
from samrl_core.learning.data.fit import IMAGE
from samrl_core.learning.images.rendered_samples import RenderedSamples

_CHUNK = 512  # images per rendering
_PRECISION = torch.float16  # 0.05 mm for points within 0.1 m of the tip


class CachedSamples:
    """`Samples` of N scenes, K images of each: sample k N + i shows scene i for the k-th time."""

    def __init__(
        self,
        samples: RenderedSamples,
        times: int,
        device: torch.device,
        progress: Callable[[int, int], None] = lambda done, wanted: None,
    ) -> None:
        """Renders one image, to know its size; all of them when the first batch is asked for.

        Args:
            samples: render the scenes.
            times: K.
            device: that holds the images; 0.2 MB each at 128 x 128.
            progress: called with the images rendered and wanted.

        Raises:
            InputError: less than one image of each, or they do not fit into the device's memory.
        """
        if times < 1:
            raise InputError(f"{times} images of each scene, must be at least 1")
        self._samples, self._times, self._device, self._progress = samples, times, device, progress
        image = samples.batch(np.arange(1), device)[IMAGE]
        self._shape = (times * len(samples), *image.shape[1:])
        _check_memory(self._shape, device)
        self._images: torch.Tensor | None = None
        self._targets: dict[str, torch.Tensor] = {}

    def __len__(self) -> int:
        return self._shape[0]

    def batch(self, indices: np.ndarray, device: torch.device) -> dict[str, torch.Tensor]:
        """See `Samples`."""
        if self._images is None:
            self._images = self._render_all()
        which = torch.from_numpy(np.asarray(indices, dtype=np.int64)).to(self._device)
        image = self._images[which].to(device, torch.float32)
        scene = which % len(self._samples)
        return {IMAGE: image, **{n: value[scene].to(device) for n, value in self._targets.items()}}

    def _render_all(self) -> torch.Tensor:
        images = torch.empty(self._shape, dtype=_PRECISION, device=self._device)
        targets: dict[str, list[torch.Tensor]] = {}
        size = len(self._samples)
        for k in range(self._times):
            again = self._samples.again(k)
            for begin in range(0, size, _CHUNK):
                rendered = again.batch(np.arange(begin, min(begin + _CHUNK, size)), self._device)
                image = rendered.pop(IMAGE)
                row = k * size + begin
                images[row : row + len(image)] = image.to(_PRECISION)
                if k == 0:
                    for name, value in rendered.items():
                        targets.setdefault(name, []).append(value)
            self._progress((k + 1) * size, len(self))
        self._targets = {name: torch.cat(parts) for name, parts in targets.items()}
        return images


def _check_memory(shape: tuple[int, ...], device: torch.device) -> None:
    needed = int(np.prod(shape)) * _PRECISION.itemsize
    if device.type == "cuda":
        # What this process has given back to torch, an earlier stage's images, torch still holds.
        held = torch.cuda.memory_reserved(device) - torch.cuda.memory_allocated(device)
        free = torch.cuda.mem_get_info(device)[0] + held
    else:
        free = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    if needed > 0.9 * free:
        raise InputError(
            f"{shape[0]} images take {needed / 1e9:.1f} GB, {device} has {free / 1e9:.1f} GB free; keep "
            f"fewer images of each state, or none"
        )
