"""What the benchmarks compare is the same thing, and a missing peer or a wrong device is said."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from samrl_core.common.errors import InputError
from samrl_core.model.rendering.renderer import Renderer
from samrl_core.studies.speed import physics_peers
from samrl_core.studies.speed.emd_peers import clouds, ours
from samrl_core.studies.speed.peers.mujoco_chain import MujocoChain
from samrl_core.studies.speed.renderer_peers import vertex_to_pose
from samrl_core.studies.speed.thread_scene import LENS, moved, rgb_xyz, thread_scene
from samrl_core.studies.speed.timing import TimedCall, in_turn
from samrl_ros.cell.bench.model_bench import measure
from samrl_ros.cli.bench import bench_app


def test_every_job_runs_in_turn_and_is_timed_per_unit() -> None:
    order: list[str] = []
    jobs = [TimedCall("a", lambda: order.append("a"), 10.0), TimedCall("b", lambda: order.append("b"))]
    timings = in_turn(jobs, 3)
    assert order == ["a", "b"] * 4
    assert timings["a"].per_second == pytest.approx(1.0 / timings["a"].seconds)
    assert timings["a"].times_faster(timings["b"]) == timings["b"].seconds / timings["a"].seconds


def test_mujoco_moves_the_same_chain() -> None:
    peer = MujocoChain(physics_peers.STEPS)
    peer.forward()
    assert np.abs(peer.last - physics_peers.chain_end()).max() < 1e-10


def test_vertex_gradients_become_pose_gradients() -> None:
    """By our own renderer, whose pose gradient comes through torch as well."""
    scene = thread_scene()
    renderer = Renderer(scene.topology, LENS, supersample=1)
    p = torch.zeros(12, dtype=torch.float64, requires_grad=True)
    (expected,) = torch.autograd.grad(rgb_xyz(moved(scene, renderer, p)).sum(), p)
    vertices = scene.vertices.clone().requires_grad_(True)
    image = renderer(vertices, scene.color, scene.target, scene.rotation, scene.translation)
    # Position is an attribute of the vertex too: one gradient holds both, and the camera moves only one.
    (by_color,) = torch.autograd.grad(image.color.double().sum(), vertices)
    got = vertex_to_pose(scene, by_color.numpy(), None)
    (expected_color,) = torch.autograd.grad(moved(scene, renderer, p).color.double().sum(), p)
    assert float((got - expected_color).norm() / expected_color.norm()) < 1e-4
    assert float((expected - expected_color).norm()) > 0.0


def test_the_distance_of_shifted_clouds() -> None:
    first, second = clouds(32)
    value, gradient = ours(first, first + torch.tensor([0.0, 0.0, 1e-4], dtype=torch.float64))
    assert value == pytest.approx(1e-4, rel=1e-9)
    assert gradient[:, 2].sum().item() == pytest.approx(-1.0, rel=1e-9)
    assert ours(first, second)[0] > 0.01


def test_a_missing_peer_is_named_and_the_rest_is_measured(tmp_path: Path) -> None:
    def absent() -> None:
        raise ModuleNotFoundError("No module named 'mitsuba'")

    assert measure("x", {"here": lambda: {"ratio": 2.0}, "gone": absent}, tmp_path) != 0
    report = json.loads((tmp_path / "bench_x.json").read_text())
    assert report["here"] == {"ratio": 2.0}
    assert "mitsuba" in report["missing"]["gone"] and "pip install" in report["missing"]["gone"]
    with pytest.raises(InputError, match="exists already"):
        measure("x", {}, tmp_path)


def test_an_unknown_device_is_refused(tmp_path: Path) -> None:
    result = CliRunner().invoke(bench_app, ["renderer", "--device", "cuda:7", "--out", str(tmp_path)])
    assert result.exit_code != 0 and not list(tmp_path.iterdir())
    assert isinstance(result.exception, InputError) and "cuda:7" in str(result.exception)
