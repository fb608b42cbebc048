"""Gradients of one device beside the CPU's, on the renderer's and the physics' benchmark scenes."""

from __future__ import annotations

import torch

from samrl_core.model.physics.physics_model import PhysicsModel
from samrl_core.model.physics.scene import PhysicsScene
from samrl_core.model.physics.state import PhysicsParameters, PhysicsState
from samrl_core.model.rendering.light import Light
from samrl_core.model.rendering.renderer import Renderer
from samrl_core.studies.speed.physics_scenes import disc_on_plane, free_chain, moving_start
from samrl_core.studies.speed.renderer_peers import SCENES, TOWARDS_LIGHT
from samrl_core.studies.speed.thread_scene import LENS, functionals, rgb_xyz, thread_scene

Gradients = dict[str, torch.Tensor]


def image_gradients(device: str, lit: bool) -> Gradients:
    """Of a weighted sum over colour and position, 2 x 2 samples, float64 on the CPU."""
    scene = thread_scene(*SCENES["2k"])
    light = Light.of(TOWARDS_LIGHT, 0.7, 0.3) if lit else None
    weights = functionals(scene, light)
    renderer = Renderer(scene.topology, LENS, supersample=2, device=device)
    names = ("vertices", "color", "rotation", "translation")
    inputs = [getattr(scene, name).to(device).requires_grad_(True) for name in names]
    image = rgb_xyz(renderer(inputs[0], inputs[1], scene.target.to(device), inputs[2], inputs[3], light))
    loss = (image * (weights["smooth rgb"] + weights["smooth xyz"]).to(device)).sum()
    return dict(zip(names, (g.cpu().double() for g in torch.autograd.grad(loss, inputs)), strict=True))


def motion_gradients(device: str, scene: PhysicsScene, dtype: torch.dtype, steps: int = 30) -> Gradients:
    """Of fixed weights on the last state."""
    model = PhysicsModel(scene, dtype, device)
    values = vars(moving_start(model, 1)) | vars(model.parameters(1))
    values = {n: t.requires_grad_(True) for n, t in values.items() if t.numel()}
    others = {n: t for n, t in vars(model.parameters(1)).items() if n not in values}
    parameters = PhysicsParameters(**({n: t for n, t in values.items() if n not in ("q", "v")} | others))
    end = model.rollout(PhysicsState(values["q"], values["v"]), model.no_action(1, steps), parameters)
    generator = torch.Generator().manual_seed(1)
    weight = torch.randn(end.q.shape[-1], generator=generator).to(device, dtype)
    loss = (end.q[-1] * weight).sum() + 0.05 * (end.v[-1] * weight[: end.v.shape[-1]]).sum()
    gradients = torch.autograd.grad(loss, list(values.values()), allow_unused=True)
    return {
        n: g.cpu().double()
        for n, g in zip(values, gradients, strict=True)
        if g is not None and g.abs().max() > 0
    }


def all_gradients(device: str) -> dict[str, Gradients]:
    """Of every scene."""
    return {
        "image unlit": image_gradients(device, False),
        "image lit": image_gradients(device, True),
        "chain": motion_gradients(device, free_chain(), torch.float64),
        "chain, float32": motion_gradients(device, free_chain(), torch.float32),
        "disc": motion_gradients(device, disc_on_plane(), torch.float64),
        "disc, float32": motion_gradients(device, disc_on_plane(), torch.float32),
    }


def differences(here: dict[str, Gradients], there: dict[str, Gradients]) -> dict[str, dict[str, float]]:
    """Relative, by norm, of every input of every scene; infinite where one has an input less."""
    return {
        scene: {
            name: float((g - there[scene][name]).norm() / there[scene][name].norm())
            if name in there[scene]
            else float("inf")
            for name, g in gradients.items()
        }
        for scene, gradients in here.items()
    }
