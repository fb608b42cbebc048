"""Images that are drawn once: which is which, and what does not fit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch

from samrl_core.common.errors import InputError
from samrl_core.learning.data.fit import ACTION, IMAGE
from samrl_core.learning.images import cached_samples as kept_samples
from samrl_core.learning.images.cached_samples import CachedSamples

CPU = torch.device("cpu")


class Numbers:
    """Stands in for drawn scenes: channels tell the scene and the drawing."""

    def __init__(self, drawing: int = -1) -> None:
        self.drawing = drawing
        self.batches = 0

    def again(self, number: int) -> Numbers:
        return Numbers(number)

    def __len__(self) -> int:
        return 700

    def batch(self, indices: np.ndarray, device: torch.device) -> dict[str, torch.Tensor]:
        self.batches += 1
        scene = torch.from_numpy(indices).float()
        channels = [scene // 32, scene % 32, torch.full_like(scene, self.drawing)]  # exact in half precision
        image = torch.stack(channels * 2, dim=1)[:, :, None, None].expand(-1, -1, 2, 2)
        return {IMAGE: image, ACTION: scene[:, None].expand(-1, 3)}


def kept(times: int) -> CachedSamples:
    samples: Any = Numbers()
    return CachedSamples(samples, times, CPU)


def test_a_sample_is_its_scene_drawn_for_the_kth_time() -> None:
    found = kept(3)
    assert len(found) == 2100
    which = np.array([0, 699, 700, 1399, 1405, 2099])
    batch = found.batch(which, CPU)
    assert batch[IMAGE].shape == (6, 6, 2, 2) and batch[IMAGE].dtype == torch.float32
    scene, drawing = which % 700, which // 700
    wanted = np.stack([scene // 32, scene % 32, drawing], axis=1)
    np.testing.assert_array_equal(batch[IMAGE][:, :3, 1, 1], wanted)
    np.testing.assert_array_equal(batch[ACTION][:, 1], scene)


def test_too_many_are_refused_before_they_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="0 images"):
        kept(0)
    monkeypatch.setattr(kept_samples.os, "sysconf", lambda name: 200)  # 200 pages of 200 bytes
    with pytest.raises(InputError, match=r"2100 images take 0.0 GB.*keep fewer"):
        kept(3)


def test_drawings_of_real_scenes_differ_and_repeat() -> None:
    from samrl_core.cell.robots.cells import cell_named
    from samrl_core.cell.tasks import task_named
    from samrl_core.learning.images.batch_render import BatchRenderer
    from samrl_core.learning.images.rendered_samples import RenderedSamples, Scenes
    from samrl_core.learning.states.frames import SceneFrames
    from samrl_core.model.model import Model

    model = Model(task_named("peg_insertion"), cell_named())
    frames = SceneFrames(model)
    tip = frames.start_tip
    values = np.array([p.nominal for p in model.task.parameters()])
    rows = frames.rows(values, frames.joints(tip))[None].repeat(2, axis=0).astype(np.float32)
    scenes = Scenes(rows, np.tile(tip, (2, 1)), {ACTION: np.zeros((2, 3))})
    samples = RenderedSamples(scenes, BatchRenderer(model), 5)
    one, two = (CachedSamples(samples, 2, CPU).batch(np.arange(4), CPU)[IMAGE] for _ in range(2))
    torch.testing.assert_close(one, two, rtol=0.0, atol=0.0)
    assert all(float((one[i] - one[j]).abs().mean()) > 0.01 for i in range(4) for j in range(i))
    direct = samples.again(0).batch(np.arange(2), CPU)[IMAGE]
    torch.testing.assert_close(one[:2], direct, rtol=1e-3, atol=1e-3)  # half precision
