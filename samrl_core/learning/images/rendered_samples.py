"""Training images rendered on demand: every state from a new view in every epoch.

Where a GPU renders thousands of images a second that is cheaper than any disk, and no view is used twice.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, CellCorrection
from samrl_core.common.errors import InputError
from samrl_core.learning.data.fit import ACTION, IMAGE, RETURN
from samrl_core.learning.images.appearance import AppearanceSettings, AppearanceSource
from samrl_core.learning.images.batch_render import BatchRenderer
from samrl_core.learning.images.cell_errors import CellErrors
from samrl_core.learning.images.image_noise import ImageNoiseSettings
from samrl_core.learning.states.states import StateSamples
from samrl_core.policy.view.views import ViewSettings, sample_views


@dataclass(frozen=True)
class SampleSettings:
    """What varies between images of one state."""

    views: ViewSettings = ViewSettings()
    appearances: AppearanceSource = AppearanceSettings()
    noise: ImageNoiseSettings = ImageNoiseSettings()
    correction: CellCorrection = NO_CORRECTION  # whose posterior the cells of images are drawn from


@dataclass(frozen=True, eq=False)
class Scenes:
    """N states to render, and the targets of each one's image."""

    frames: np.ndarray  # (N, F, 12) of `SceneFrames`
    tip_in_base: np.ndarray  # (N, 3) [m]
    targets: Mapping[str, np.ndarray]  # (N, ...) by the names of `Samples.batch`
    view: np.ndarray | None = None  # (N, 6) to render each from; None samples one at random

    def __post_init__(self) -> None:
        arrays = {"tip_in_base": self.tip_in_base, **self.targets}
        if self.view is not None:
            arrays["view"] = self.view
        wrong = {name: np.shape(array) for name, array in arrays.items() if len(array) != len(self.frames)}
        if wrong or not len(self.frames):
            raise InputError(
                f"{len(self.frames)} frames to render; at least 1, and these must be as many: {wrong}"
            )

    def __len__(self) -> int:
        return len(self.frames)

    @staticmethod
    def of_states(states: StateSamples, view: np.ndarray | None = None) -> Scenes:
        """Labelled states for imitation (eq. 23); with a view (6,), all of them from there."""
        views = None if view is None else np.tile(view, (len(states), 1))
        return Scenes(states.frames, states.tip_in_base, {ACTION: states.action}, views)

    @staticmethod
    def of_returns(rows: Mapping[str, np.ndarray]) -> Scenes:
        """Actions with their returns (eq. 24), each from the view that it was taken from.

        `rows` are the fields of `Rollouts` that have one per action.
        """
        targets = {ACTION: rows["action"], RETURN: rows["returns"]}
        return Scenes(rows["frames"], rows["tip_in_base"], targets, rows["view"])


def rng_of(seed: int, indices: np.ndarray) -> np.random.Generator:
    """The source of everything random in a batch: another one in each epoch, whose order differs."""
    return np.random.default_rng([seed, zlib.crc32(np.ascontiguousarray(indices).tobytes())])


class RenderedSamples:
    """`Samples` rendered on demand; views, appearances and noise follow from seed and indices."""

    def __init__(
        self,
        scenes: Scenes,
        renderer: BatchRenderer,
        seed: int,
        settings: SampleSettings | None = None,
    ) -> None:
        """Args:

        Args:
            scenes: of the renderer's model.
            renderer: on the device that renders.
            seed: of all that is random.
            settings: what varies.
        """
        self._scenes, self._renderer, self._seed = scenes, renderer, seed
        self._settings = settings or SampleSettings()
        self._region = renderer.model.task.view_region()

    def again(self, number: int) -> RenderedSamples:
        """The same scenes with other views, appearances and noise; others for each number."""
        return RenderedSamples(self._scenes, self._renderer, 1000 * self._seed + number, self._settings)

    def __len__(self) -> int:
        return len(self._scenes)

    def batch(self, indices: np.ndarray, device: torch.device) -> dict[str, torch.Tensor]:
        """See `Samples`."""
        which = np.asarray(indices, dtype=np.int64)
        scenes, s = self._scenes, self._settings
        rng = rng_of(self._seed, which)
        if scenes.view is None:
            views = sample_views(self._region, rng, len(which), s.views)
        else:
            views = scenes.view[which]
        appearances = s.appearances.sample(self._renderer.model, rng, len(which))
        generator = torch.Generator(self._renderer.device).manual_seed(int(rng.integers(2**62)))
        errors = CellErrors.draw_cells(s.correction, rng, len(which))
        images = self._renderer.images(
            scenes.frames[which], scenes.tip_in_base[which], views, appearances, s.noise, generator, errors
        )
        targets = {name: torch.from_numpy(array[which]) for name, array in scenes.targets.items()}
        return {IMAGE: images.to(device), **{name: value.to(device) for name, value in targets.items()}}
