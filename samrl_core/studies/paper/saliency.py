"""Which pixels actor and Q depend on: gradients of their outputs, and the effect of covering a part."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from scipy.ndimage import binary_dilation, gaussian_filter
from torch.nn import functional

from samrl_core.learning.images.batch_render import BatchRenderer
from samrl_core.policy.networks.network_image import XYZ
from samrl_core.policy.view.sensing_value import Networks
from samrl_core.policy.view.views import cameras_of
from samrl_core.studies.paper.expert_states import ExpertState
from samrl_core.studies.paper.view_maps import NOISE

NETWORKS = ("actor", "q")
Output = Callable[[torch.Tensor], torch.Tensor]  # images (B, 6, H, W) to (B,)


@dataclass(frozen=True)
class SaliencySettings:
    """Of gradients and patches."""

    noise_samples: int = 16  # of the camera's noise, over which the gradients are averaged
    smoothing: float = 1.5  # Gaussian filter of a gradient's map, standard deviation [px]
    beside: int = 2  # an object's mask holds its outline, and so many pixels around it
    patch: int = 16  # side of what is covered [px]
    stride: int = 8  # between patches [px]


@dataclass(frozen=True, eq=False)
class Examined:
    """One state from V views."""

    images: np.ndarray  # (V, 6, H, W) clean network images
    target: np.ndarray  # (V, H, W) bool, what the task's parameters move
    objects: np.ndarray  # (V, H, W) bool, that, the tool and the task's other bodies
    gradients: dict[str, np.ndarray]  # per network (V, H, W), see `gradient_maps`
    covered: dict[str, np.ndarray]  # per network (V, h, w), see `cover_maps`


def examine(
    renderer: BatchRenderer,
    networks: Networks,
    state: ExpertState,
    views: np.ndarray,
    seed: int,
    settings: SaliencySettings | None = None,
) -> Examined:
    """Gradients and covered patches of a state from every view (V, 6), as `sample_views` gives them.

    The actor's gradient is that of its squared error against the expert (the paper's eq. 26), Q's is that of
    Q with the actor's action as given (eq. 17). Covering is measured by how far the action goes from that on
    the whole image, and by how much Q of that action changes.

    Args:
        renderer: of the networks' task and on their device.
        networks: asked.
        state: with the expert's action.
        views: where from.
        seed: of the noise.
        settings: of gradients and patches.
    """
    s = settings or SaliencySettings()
    count = len(views)
    frames, tips = np.tile(state.frames, (count, 1, 1)), np.tile(state.tip_in_base, (count, 1))
    generator = torch.Generator(renderer.device).manual_seed(seed)
    images = renderer.images(frames, tips, views)
    wanted = torch.as_tensor(state.action, device=renderer.device).float()
    noisy = [renderer.images(frames, tips, views, None, NOISE, generator) for _ in range(s.noise_samples)]
    with torch.no_grad():
        given = [networks.actor(one) for one in noisy]
        own = networks.actor(images)
        own_q = networks.q(images, own)

    def error(image: torch.Tensor) -> torch.Tensor:
        return (networks.actor(image) - wanted).square().sum(dim=1)

    values = [lambda image, a=action: networks.q(image, a) for action in given]
    gradients = {
        "actor": gradient_maps(noisy, [error] * s.noise_samples, s.smoothing),
        "q": gradient_maps(noisy, values, s.smoothing),  # ty: ignore[invalid-argument-type]
    }
    covered: dict[str, list[np.ndarray]] = {name: [] for name in NETWORKS}
    for k in range(count):
        action, value = own[k : k + 1], own_q[k : k + 1]

        def moved(image: torch.Tensor, action: torch.Tensor = action) -> torch.Tensor:
            return (networks.actor(image) - action).norm(dim=1)

        def changed(
            image: torch.Tensor, action: torch.Tensor = action, value: torch.Tensor = value
        ) -> torch.Tensor:
            return (networks.q(image, action.expand(len(image), 3)) - value).abs()

        for name, output in (("actor", moved), ("q", changed)):
            covered[name].append(cover_map(images[k], output, s, renderer.chunk))
    target, objects = _masks(renderer, frames, views, s.beside)
    maps = {name: np.array(some) for name, some in covered.items()}
    return Examined(images.cpu().numpy(), target, objects, gradients, maps)


def gradient_maps(images: list[torch.Tensor], outputs: list[Output], smoothing: float) -> np.ndarray:
    """Size of an output's gradient by each pixel, (B, H, W), its mean over noise samples (Smilkov et al.
    2017).

    Args:
        images: (B, 6, H, W) of each noise sample.
        outputs: what is asked of each.
        smoothing: of the map, standard deviation [px]; 0: none.
    """
    total = torch.zeros_like(images[0][:, 0])
    for image, output in zip(images, outputs, strict=True):
        leaf = image.detach().requires_grad_()
        (gradient,) = torch.autograd.grad(output(leaf).sum(), leaf)
        total += gradient.abs().sum(dim=1)
    maps = (total / len(images)).double().cpu().numpy()
    return gaussian_filter(maps, (0.0, smoothing, smoothing)) if smoothing else maps


def cover_map(image: torch.Tensor, output: Output, settings: SaliencySettings, chunk: int) -> np.ndarray:
    """What an output (0 for the image itself) is with a grey, unmeasured patch laid on, (h, w).

    Args:
        image: (6, H, W).
        output: asked of the covered images.
        settings: of the patches.
        chunk: images at a time.
    """
    rows, columns = (_corners(size, settings) for size in image.shape[1:])
    patches = [(r, c) for r in rows for c in columns]
    found = []
    for start in range(0, len(patches), chunk):
        few = patches[start : start + chunk]
        batch = image.repeat(len(few), 1, 1, 1)
        for one, (r, c) in zip(batch, few, strict=True):
            part = one[:, r : r + settings.patch, c : c + settings.patch]
            part[: XYZ.start] = 0.0  # mid grey
            part[XYZ] = 0.0  # as where nothing is visible
        with torch.no_grad():
            found.append(output(batch))
    return torch.cat(found).double().cpu().numpy().reshape(len(rows), len(columns))


def within_patches(maps: np.ndarray, settings: SaliencySettings) -> np.ndarray:
    """Means of maps (V, H, W) over the patches of `cover_map`, (V, h, w)."""
    return functional.avg_pool2d(torch.from_numpy(maps)[:, None], settings.patch, settings.stride)[
        :, 0
    ].numpy()


def _corners(size: int, settings: SaliencySettings) -> range:
    return range(0, size - settings.patch + 1, settings.stride)


def _masks(
    renderer: BatchRenderer, frames: np.ndarray, views: np.ndarray, beside: int
) -> tuple[np.ndarray, np.ndarray]:
    """Target and all objects of the task, (V, H, W) each, with what is just beside them."""
    model, found = renderer.model, []
    scene = model.task.scene(model.cell)
    labels = [model.target_label, scene.tool.label, *(body.label for body in scene.bodies)]
    with torch.no_grad():
        rendered = renderer.render(frames, cameras_of(torch.as_tensor(views, device=renderer.device)))
    label, target = rendered.label.cpu().numpy(), rendered.target.cpu().numpy() > 0.0
    around = np.ones((1, 2 * beside + 1, 2 * beside + 1), dtype=bool)
    for mask in (target, target | np.isin(label, labels)):
        found.append(binary_dilation(mask, around))
    return found[0], found[1]
