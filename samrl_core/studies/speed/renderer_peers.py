"""The renderer beside Mitsuba (gradients) and TinyRenderer (images), on the thread scene, on a CPU."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from samrl_core.model.rendering.light import Light
from samrl_core.model.rendering.renderer import Renderer
from samrl_core.studies.speed.thread_scene import (
    LENS,
    PoseReference,
    ThreadScene,
    pose_gradients,
    rgb_xyz,
    thread_scene,
)
from samrl_core.studies.speed.timing import TimedCall, in_turn

SCENES = {"2k": (14, 4), "20k": (44, 11)}  # segments and rings of each capsule
TOWARDS_LIGHT = (0.4, -0.5, 1.0)
MITSUBA_SAMPLES = 16  # per pixel: about our error at 2 x 2
_TIMED = ("residual rgb", "residual xyz")


def vertex_to_pose(scene: ThreadScene, by_position: np.ndarray, by_value: np.ndarray | None) -> torch.Tensor:
    """Chain rule from vertices to the scene's 12 pose parameters.

    Args:
        scene: at p = 0.
        by_position: (V, 3) gradient by positions.
        by_value: (V, 3) gradient by rendered positions, which the camera's motion leaves as they are; None
            where colours are rendered.
    """
    x = scene.vertices.numpy()
    rotation = scene.rotation.numpy()
    in_camera = x @ rotation.T + scene.translation.numpy()
    position_gradient = by_position.astype(np.float64)
    of_camera = position_gradient @ rotation.T
    is_moved = scene.target.numpy() > 0
    arm = x[is_moved] - x[is_moved].mean(axis=0)
    of_object = position_gradient[is_moved] + (
        0.0 if by_value is None else by_value.astype(np.float64)[is_moved]
    )
    parts = [
        np.cross(in_camera, of_camera).sum(axis=0),
        of_camera.sum(axis=0),
        np.cross(arm, of_object).sum(axis=0),
        of_object.sum(axis=0),
    ]
    return torch.from_numpy(np.concatenate(parts))


def both_ways(
    renderer: Renderer, scene: ThreadScene, weights: torch.Tensor, light: Light | None
) -> Callable[[], None]:
    """Image, and the gradient of a weighted sum by vertices, colours and camera."""
    inputs = [
        t.clone().requires_grad_(True)
        for t in (scene.vertices, scene.color, scene.rotation, scene.translation)
    ]

    def run() -> None:
        vertices, color, rotation, translation = inputs
        image = renderer(vertices, color, scene.target, rotation, translation, light)
        torch.autograd.grad((rgb_xyz(image) * weights).sum(), inputs)

    return run


def against_mitsuba(size: str, lit: bool, rounds: int) -> dict[str, Any]:
    """Time of colour and position, forward and backward, beside Mitsuba's, and both errors.

    The errors are against differences of our own image of 16 x 16 samples. Lit, Mitsuba casts shadows and we
    do not, so that its error there is left out; its time includes them.
    """
    from samrl_core.studies.speed.peers.mitsuba_renderer import MitsubaThread

    scene = thread_scene(*SCENES[size])
    light = Light.of(TOWARDS_LIGHT, 1.0, 0.0) if lit else None
    reference = PoseReference.of(scene, light)
    faces = np.asarray(scene.topology.faces)
    shared = (scene.rotation.numpy(), scene.translation.numpy(), LENS)
    x, color = scene.vertices.numpy(), scene.color.numpy()
    peers = {
        "rgb": MitsubaThread(x, faces, color, *shared, TOWARDS_LIGHT if lit else None),
        "xyz": MitsubaThread(x, faces, x, *shared),
    }

    def of_peer(name: str) -> torch.Tensor:
        kind = name.split()[-1]
        channels = slice(0, 3) if kind == "rgb" else slice(3, 6)
        g = peers[kind].gradient(reference.weights[name].numpy()[..., channels], MITSUBA_SAMPLES)
        return vertex_to_pose(scene, g.by_position, g.by_value if kind == "xyz" else None)

    weights = torch.stack([reference.weights[name] for name in _TIMED]).sum(dim=0)
    renderer = Renderer(scene.topology, LENS, supersample=2)
    jobs = [
        TimedCall("samrl", both_ways(renderer, scene, weights, light)),
        TimedCall("mitsuba", lambda: [of_peer(name) for name in _TIMED]),
    ]
    ours, theirs = in_turn(jobs, rounds).values()
    errors = reference.errors(pose_gradients(scene, reference, light))
    result: dict[str, Any] = {
        "triangles": len(faces),
        "lit": lit,
        "samrl_ms": 1e3 * ours.seconds,
        "mitsuba_ms": 1e3 * theirs.seconds,
        "ratio": ours.times_faster(theirs),
        "samrl_error": float(np.mean(list(errors.values()))),
        "mitsuba_samples": MITSUBA_SAMPLES,
    }
    if not lit:
        peer_errors = reference.errors({name: of_peer(name) for name in reference.weights})
        result["mitsuba_error"] = float(np.mean(list(peer_errors.values())))
    return result


def against_tiny_renderer(size: str, rounds: int) -> dict[str, Any]:
    """One image of 128 x 128, one sample a pixel; ours has colour, position, mask and depth."""
    from samrl_core.studies.speed.peers.tiny_renderer import tiny_renderer

    scene = thread_scene(*SCENES[size])
    renderer = Renderer(scene.topology, LENS, supersample=1)

    def ours() -> None:
        with torch.no_grad():
            renderer(scene.vertices, scene.color, scene.target, scene.rotation, scene.translation)

    render = tiny_renderer(
        scene.vertices.numpy(),
        np.asarray(scene.topology.faces),
        scene.rotation.numpy(),
        scene.translation.numpy(),
        LENS,
    )
    mine, theirs = in_turn([TimedCall("samrl", ours), TimedCall("tiny", render)], 3 * rounds).values()
    return {
        "triangles": len(scene.topology.faces),
        "samrl_ms": 1e3 * mine.seconds,
        "tiny_renderer_ms": 1e3 * theirs.seconds,
        "ratio": mine.times_faster(theirs),
    }


def with_threads(size: str, batch: int, rounds: int) -> dict[str, Any]:
    """Forward and backward of a batch, with one thread and with two."""
    scene = thread_scene(*SCENES[size])
    jobs = []
    for threads in (1, 2):
        renderer = Renderer(scene.topology, LENS, supersample=2, threads=threads)
        jobs.append(TimedCall(f"{threads} threads", batched(renderer, scene, batch, True), batch))
    one, two = in_turn(jobs, rounds).values()
    return {
        "batch": batch,
        "one_ms": 1e3 * one.seconds,
        "two_ms": 1e3 * two.seconds,
        "ratio": two.times_faster(one),
    }


def batched(
    renderer: Renderer, scene: ThreadScene, batch: int, backward: bool, device: str = "cpu"
) -> Callable[[], None]:
    """A batch of cameras, each a little to the side of the one before, with the object moved as well."""
    offset = (
        torch.linspace(-0.05, 0.05, batch, dtype=torch.float64)[:, None] if batch > 1 else torch.zeros(1, 1)
    )
    shift = offset * torch.tensor([1.0, 0.5, 0.2], dtype=torch.float64)
    translation = (scene.translation + shift).to(device)
    vertices = (scene.vertices + 0.1 * shift[:, None] * scene.target[:, None]).to(device)
    color, target, rotation = (t.to(device) for t in (scene.color, scene.target, scene.rotation))
    if not backward:

        def forward() -> None:
            with torch.no_grad():
                renderer(vertices, color, target, rotation, translation)

        return forward
    inputs = [t.requires_grad_(True) for t in (vertices, translation)]

    def both() -> None:
        image = renderer(inputs[0], color, target, rotation, inputs[1])
        torch.autograd.grad(image.color.sum() + image.xyz.sum(), inputs)

    return both
