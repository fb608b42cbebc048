"""The image of the networks: values, what is unseen, frames, gradients, and the real against the model's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from samrl_core.cell.types.camera import Camera, Intrinsics
from samrl_core.cell.types.observation import ArmReading, Frame, Observation
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.model.model import Model, world_to_camera
from samrl_core.policy.networks.network_image import XYZ_CLIP, network_image, observed_image, rendered_image

TURNED = Pose.from_rpy(np.array([0.3, -0.2, 0.1]), (0.1, -0.4, 2.0))


def scene(shape: tuple[int, ...] = (4, 5)) -> tuple[torch.Tensor, ...]:
    g = torch.Generator().manual_seed(3)
    color = torch.rand((*shape, 3), generator=g, dtype=torch.float64)
    xyz = 0.2 * torch.randn((*shape, 3), generator=g, dtype=torch.float64)
    seen = torch.rand(shape, generator=g) > 0.3
    tip = 0.1 * torch.randn((*shape[:-2], 3), generator=g, dtype=torch.float64)
    return color, xyz, seen, tip


def test_xyz_is_the_point_in_the_base_less_the_tip_in_the_base() -> None:
    color, xyz, seen, tip = scene()
    image = network_image(color, xyz, seen, tip, TURNED)
    assert image.shape == (6, 4, 5) and image.dtype == torch.float32
    inverse = TURNED.inverse()
    expected = (inverse.apply(xyz.numpy()) - inverse.apply(tip.numpy())) / 0.1
    expected = np.where(seen.numpy()[..., None], np.clip(expected, -XYZ_CLIP, XYZ_CLIP), 0.0)
    np.testing.assert_allclose(image[3:].permute(1, 2, 0).numpy(), expected, atol=1e-6)
    np.testing.assert_allclose(image[:3].permute(1, 2, 0).numpy(), (color.numpy() - 0.5) / 0.25, atol=1e-6)


def test_moving_tip_and_points_together_changes_nothing() -> None:
    color, xyz, seen, tip = scene()
    shift = torch.tensor([0.7, -0.1, 0.2], dtype=torch.float64)
    torch.testing.assert_close(
        network_image(color, xyz, seen, tip, TURNED),
        network_image(color, xyz + shift, seen, tip + shift, TURNED),
    )


def test_a_batch_is_its_images() -> None:
    color, xyz, seen, tip = scene((3, 4, 5))
    batch = network_image(color, xyz, seen, tip, TURNED)
    for k in range(3):
        torch.testing.assert_close(batch[k], network_image(color[k], xyz[k], seen[k], tip[k], TURNED))


def test_unseen_points_may_be_nan_and_have_no_gradient() -> None:
    color, xyz, seen, tip = scene()
    xyz[~seen] = torch.nan
    xyz.requires_grad_()
    color.requires_grad_()
    image = network_image(color, xyz, seen, tip, TURNED)
    assert bool((image[3:, ~seen] == 0).all())
    image.square().sum().backward()
    assert bool(torch.isfinite(xyz.grad).all()) and bool((xyz.grad[~seen] == 0).all())
    assert bool((xyz.grad[seen] != 0).any()) and bool((color.grad != 0).all())


@pytest.mark.parametrize("what", ["color", "seen", "tip", "nan"])
def test_what_does_not_fit_is_refused(what: str) -> None:
    color, xyz, seen, tip = scene()
    if what == "color":
        color = color[..., :2]
    elif what == "seen":
        seen = seen[1:]
    elif what == "tip":
        tip = tip * torch.inf
    else:
        xyz[1, 1], seen[1, 1] = torch.nan, True
    with pytest.raises(InputError, match="fit|finite"):
        network_image(color, xyz, seen, tip, TURNED)


def observation_of(model: Model, joints: np.ndarray, values: np.ndarray) -> tuple[Observation, torch.Tensor]:
    """What a perfect sensor would read of the model, and the model's own network image."""
    camera = Camera(model.cell.intrinsics, model.task.start_camera())
    pose = world_to_camera(camera.camera_in_world)
    with torch.no_grad():
        rendered = model.render(
            torch.as_tensor(values), torch.as_tensor(model.initial_colors()), pose, joints
        )
    tip = model.tip_in_base(joints).position
    depth = np.where(np.isfinite(rendered.depth.numpy()), rendered.depth.numpy(), np.nan)
    frame = Frame(
        0,
        np.rint(255 * rendered.color.numpy()).clip(0, 255).astype(np.uint8),
        depth.astype(np.float32),
        rendered.label.numpy().astype(np.uint8),
    )
    reading = ArmReading(0, joints, np.zeros(7), np.zeros(7))
    return Observation(frame, camera, reading, reading), rendered_image(rendered, pose, tip, model.cell)


def test_a_real_image_and_the_models_agree(model: Model) -> None:
    joints = model.task.start_joints(model.cell)["tool_arm"]
    values = np.array([p.nominal for p in model.task.parameters()])
    observation, ours = observation_of(model, joints, values)
    theirs = observed_image(observation, model.tip_in_base(joints).position, model.cell)
    assert ours.shape == theirs.shape == (6, 128, 128)
    differ = (ours - theirs).abs()
    assert float(differ[:3].max()) < 0.5 / 255 / 0.25 + 1e-3
    assert float(differ[3:].max()) < 1e-4  # at silhouettes, too


def test_a_camera_of_another_lens_is_refused(model: Model) -> None:
    joints = model.task.start_joints(model.cell)["tool_arm"]
    observation, _ = observation_of(model, joints, np.array([0.5, 0.0]))
    k = observation.camera.intrinsics
    other = Camera(Intrinsics(k.width, k.height, 1.01 * k.fx, k.fy, k.cx, k.cy), Pose.identity())
    with pytest.raises(InputError, match="intrinsics|cell's"):
        observed_image(replace(observation, camera=other), np.zeros(3), model.cell)
