"""Images and steps per second over the size of the batch, on any device, beside that device's limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import torch
import warp as wp

from samrl_core.common.warp_runtime import start
from samrl_core.model.physics.physics_model import PhysicsModel
from samrl_core.model.physics.scene import PhysicsScene
from samrl_core.model.rendering.renderer import Renderer
from samrl_core.studies.speed.physics_scenes import disc_on_plane, free_chain, moving_start
from samrl_core.studies.speed.renderer_peers import SCENES, batched
from samrl_core.studies.speed.thread_scene import LENS, SIZE, ThreadScene, thread_scene
from samrl_core.studies.speed.timing import TimedCall, in_turn

STEPS = 24  # of a physics rollout: one action of 0.1 s
SUPERSAMPLE = 2
STEPPED = {"chain": free_chain, "disc": disc_on_plane}  # 20 DoF without contact, 6 DoF in contact


@wp.kernel(enable_backward=False)
def _nothing(numbers: wp.array(dtype=wp.float32)):
    i = wp.tid()
    numbers[i] = numbers[i] + 1.0


def wait(device: str) -> Callable[[], None]:
    """Until the device has done what it was given."""
    return torch.cuda.synchronize if torch.device(device).type == "cuda" else lambda: None


def copy_bandwidth(device: str) -> float:
    """Bytes per second, read and written, of one large copy."""
    count = (1 << 28) if torch.device(device).type == "cuda" else (1 << 24)
    source = torch.zeros(count, dtype=torch.float32, device=device)
    target = torch.empty_like(source)
    timing = in_turn([TimedCall("copy", lambda: target.copy_(source), 2.0 * 4 * count, wait(device))], 5)[
        "copy"
    ]
    return timing.per_second


def launch_seconds(device: str, count: int = 240) -> float:
    """Time of one of many launches of a kernel that does next to nothing, in a recorded graph [s]."""
    start()
    where = str(wp.device_from_torch(torch.device(device)))
    numbers = wp.zeros(32, dtype=wp.float32, device=where)

    def launches() -> None:
        for _ in range(count):
            wp.launch(_nothing, dim=32, inputs=[numbers], device=where)

    launches()
    with wp.ScopedCapture(device=where) as capture:
        launches()
    graph = capture.graph
    assert graph is not None  # the capture has ended
    job = TimedCall("launch", lambda: wp.capture_launch(graph), count, wait(device))
    return in_turn([job], 9)["launch"].seconds


def image_bytes(scene: ThreadScene, backward: bool) -> float:
    """Bytes of one image's arrays, each counted once per kernel that reads or writes it (by hand)."""
    faces, vertices = len(scene.topology.faces), scene.topology.n_vertices
    pixels, samples = SIZE * SIZE, SIZE * SIZE * SUPERSAMPLE**2
    keys = 8.0 * samples
    triangles = faces * (36 + 36 + 16) + faces * (36 + 16)  # set up: points in, plane and box out; raster: in
    forward = vertices * 40 + triangles + 3 * keys + pixels * (36 + 28 + 8)
    if not backward:
        return forward
    gradients = faces * 2 * (36 + 84) + vertices * 2 * 40  # zeroed, then added to
    return forward + gradients + 2 * keys + 2.0 * samples + pixels * (28 + 36 + 84)


def image_rates(device: str, batches: Sequence[int], rounds: int) -> list[dict[str, Any]]:
    """RGB, XYZ and mask at 128 x 128 with 2 x 2 samples; gradients to vertices and camera."""
    scene = thread_scene(*SCENES["2k"])
    renderer = Renderer(scene.topology, LENS, supersample=SUPERSAMPLE, device=device)
    bandwidth = copy_bandwidth(device)
    rows = []
    for batch in batches:
        jobs = [
            TimedCall(name, batched(renderer, scene, batch, name == "both", device), batch, wait(device))
            for name in ("forward", "both")
        ]
        row: dict[str, Any] = {"batch": batch}
        for name, timing in in_turn(jobs, rounds).items():
            moved = image_bytes(scene, name == "both") * timing.per_second
            row[f"{name}_per_second"] = timing.per_second
            row[f"{name}_bandwidth_share"] = moved / bandwidth
        rows.append(row)
    return rows


def rollout_jobs(scene: PhysicsScene, batch: int, device: str) -> list[TimedCall]:
    """Rollouts of `STEPS` steps through the public border, forward and with the backward pass."""
    model = PhysicsModel(scene, torch.float32, device)
    state, actions = moving_start(model, batch), model.no_action(batch, STEPS)
    parameters = model.parameters(batch)
    inputs = [state.q, state.v, parameters.mass, parameters.inertia, parameters.friction]

    def forward() -> None:
        with torch.no_grad():
            model.rollout(state, actions, parameters)

    def both() -> None:
        for tensor in inputs:
            tensor.requires_grad_(True)
        end = model.rollout(state, actions, parameters)
        torch.autograd.grad(end.q[-1].sum() + end.v[-1].sum(), inputs, allow_unused=True)
        for tensor in inputs:
            tensor.requires_grad_(False)

    return [TimedCall(n, w, batch * STEPS, wait(device)) for n, w in (("forward", forward), ("both", both))]


def step_rates(name: str, device: str, batches: Sequence[int], rounds: int) -> list[dict[str, Any]]:
    """Steps of 1/240 s per second of one of `STEPPED`."""
    launch = launch_seconds(device)
    rows = []
    for batch in batches:
        row: dict[str, Any] = {"batch": batch}
        for kind, timing in in_turn(rollout_jobs(STEPPED[name](), batch, device), rounds).items():
            row[f"{kind}_per_second"] = timing.per_second
            if kind == "forward":  # one launch a step
                row["launch_limit_share"] = launch / (timing.seconds * batch)
        rows.append(row)
    return rows
