"""Q and the actor's action error of one state over a grid of views, clean and under the camera's noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy.stats import spearmanr

from samrl_core.cell.tasks.task import ViewRegion
from samrl_core.learning.images.batch_render import BatchRenderer
from samrl_core.learning.images.image_noise import ImageNoiseSettings
from samrl_core.model.model import Model
from samrl_core.policy.view.sensing_value import Networks
from samrl_core.policy.view.view_reach import ReachSettings, ViewReach, grid
from samrl_core.studies.paper.expert_states import ExpertState

AZIMUTHS, ELEVATIONS = 24, 9
DRAWS = 8  # of the noise
NOISE = replace(ImageNoiseSettings(), clean_share=0.0, least=1.0, most=1.0)  # a camera as it is sold


@dataclass(frozen=True, eq=False)
class ViewGrid:
    """V views at one distance, elevation by elevation from low to high."""

    azimuth: np.ndarray  # (A,) [rad]
    elevation: np.ndarray  # (E,) [rad]
    views: np.ndarray  # (E A, 6) as `sample_views` gives them

    @property
    def shape(self) -> tuple[int, int]:
        """E and A."""
        return len(self.elevation), len(self.azimuth)


@dataclass(frozen=True, eq=False)
class ViewMaps:
    """What the networks make of every view (V,)."""

    q: np.ndarray  # of the clean image and the actor's action there
    error: np.ndarray  # of that action, its distance from the expert's [m]
    noisy_q: np.ndarray  # the same as means over samples of the noise
    noisy_error: np.ndarray  # [m]


def view_grid(region: ViewRegion, azimuths: int = AZIMUTHS, elevations: int = ELEVATIONS) -> ViewGrid:
    """A grid over a region at the middle of its distances."""
    low, high = region.azimuth
    closed = high - low > 2 * np.pi - 1e-6  # a full circle must not meet itself
    azimuth = np.linspace(low, high, azimuths, endpoint=not closed)
    elevation = np.linspace(*region.elevation, elevations)
    e, a = (part.ravel() for part in np.meshgrid(elevation, azimuth, indexing="ij"))
    middle = np.full(len(a), np.mean(region.distance))
    return ViewGrid(azimuth, elevation, np.column_stack([a, e, middle, np.tile(region.target, (len(a), 1))]))


def reachable(model: Model, of: ViewGrid) -> np.ndarray:
    """Which views (V,) bool the camera arm takes, clear of table and bodies at their nominal poses."""
    task, cell = model.task, model.cell
    reach = ViewReach(cell, task)
    start = task.start_joints(cell)["camera_arm"]
    obstacles = reach.body_capsules(np.array([p.nominal for p in task.parameters()]))
    distance = float(of.views[0, 2])
    region = replace(task.view_region(), distance=(distance, distance))
    settings = ReachSettings(len(of.azimuth), len(of.elevation), 1)
    poses = grid(region, settings)  # highest elevation first
    found = [
        reach.solve_view(rolls, obstacles, start, [cell.camera_arm.home, start]) is not None
        for rolls in poses
    ]
    return np.array(found).reshape(of.shape)[::-1].ravel()


def view_maps(
    renderer: BatchRenderer,
    networks: Networks,
    state: ExpertState,
    views: np.ndarray,
    seed: int,
    noise_samples: int = DRAWS,
) -> ViewMaps:
    """Render a state from every view (V, 6), and ask actor and Q.

    Args:
        renderer: of the networks' task and on their device.
        networks: asked.
        state: with the expert's action.
        views: as `sample_views` gives them.
        seed: of the noise.
        noise_samples: over which Q is averaged.
    """
    count = len(views)
    frames, tips = np.tile(state.frames, (count, 1, 1)), np.tile(state.tip_in_base, (count, 1))
    generator = torch.Generator(renderer.device).manual_seed(seed)
    wanted = torch.as_tensor(state.action, device=renderer.device)

    def asked(noise: ImageNoiseSettings | None) -> tuple[np.ndarray, np.ndarray]:
        images = renderer.images(frames, tips, views, None, noise, generator)
        with torch.no_grad():
            parts = [networks.actor(few) for few in images.split(renderer.chunk)]
            pairs = zip(images.split(renderer.chunk), parts, strict=True)
            values = torch.cat([networks.q(few, action) for few, action in pairs])
        error = (torch.cat(parts).double() - wanted).norm(dim=1)
        return values.double().cpu().numpy(), error.cpu().numpy()

    q, error = asked(None)
    noisy = [
        np.mean(part, axis=0) for part in zip(*(asked(NOISE) for _ in range(noise_samples)), strict=True)
    ]
    return ViewMaps(q, error, *noisy)


def rank_correlation(first: np.ndarray, second: np.ndarray) -> float:
    """Spearman's; 0 where one of them is the same everywhere, as there is no correlation then."""
    if np.ptp(first) == 0.0 or np.ptp(second) == 0.0:
        return 0.0
    found = spearmanr(first, second)
    return float(found.statistic)


def regret(q: np.ndarray, error: np.ndarray) -> tuple[float, float]:
    """How much worse than the best view is the one of highest Q, and one at random on average.

    Both as share of what lies between the best and the worst view's error.
    """
    span = float(np.ptp(error))
    if span == 0.0:
        return 0.0, 0.0
    least = float(error.min())
    return (float(error[int(q.argmax())]) - least) / span, (float(error.mean()) - least) / span
