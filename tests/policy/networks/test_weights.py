"""Weight files: round trip, and every wrong one is refused by name."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import get_args

import pytest
import safetensors.torch
import torch
from torch import nn

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.common.errors import InputError
from samrl_core.policy.networks.networks import ResidualActor, SensingQ, SimActor, TwinCritic
from samrl_core.policy.networks.weights import (
    Kind,
    WeightsInfo,
    load_weights,
    save_weights,
    sha256_of,
    shipped,
)

CELL = cell_named()
TRAINING = Path(__file__).resolve().parents[3] / "msgs_docs" / "training"
PUBLISHED = sorted(TRAINING.glob("*/*.safetensors"))  # some are links to the package's own
INFO = WeightsInfo("sim_actor", "peg_insertion", CELL.intrinsics, 0.01, 4, {"error_mm": 0.5}, "abc")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "deep" / "actor.safetensors"
    save_weights(path, SimActor(0.01), INFO)
    return path


@pytest.mark.parametrize(
    ("kind", "network"),
    [
        ("sim_actor", SimActor(0.01)),
        ("sensing_q", SensingQ()),
        ("residual_actor", ResidualActor(0.01)),
        ("twin_critic", TwinCritic(0.01)),
    ],
)
def test_round_trip_in_half_precision(tmp_path: Path, kind, network: nn.Module) -> None:
    path = tmp_path / "w.safetensors"
    info = replace(INFO, kind=kind)
    save_weights(path, network, info)
    loaded, found = load_weights(path, kind, "peg_insertion", CELL)
    assert found == info and type(loaded) is type(network) and not loaded.training
    for (name, a), b in zip(network.state_dict().items(), loaded.state_dict().values(), strict=True):
        assert b.dtype == torch.float32
        assert torch.equal(a.half().float(), b), name
    again = tmp_path / "again.safetensors"
    save_weights(again, loaded, found)
    assert sha256_of(again) == sha256_of(path)  # nothing is lost a second time
    assert list(tmp_path.glob("*.half")) == []


def test_half_precision_moves_an_action_by_micrometres(file: Path) -> None:
    loaded, _ = load_weights(file, "sim_actor", "peg_insertion", CELL)
    image = torch.randn((4, 6, 64, 64), generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        assert float((loaded(image) - SimActor(0.01)(image)).abs().max()) < 2e-5


@pytest.mark.parametrize(
    ("kind", "task", "message"),
    [("sensing_q", "peg_insertion", "sim_actor"), ("sim_actor", "needle_threading", "peg_insertion")],
)
def test_another_kind_or_task_is_refused(file: Path, kind, task: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_weights(file, kind, task, CELL)


@pytest.mark.parametrize(
    "camera",
    [
        Intrinsics.from_fov(64, 64, 0.7),
        replace(CELL.intrinsics, fx=1.001 * CELL.intrinsics.fx),
        replace(CELL.intrinsics, cy=CELL.intrinsics.cy + 0.5),
    ],
)
def test_another_camera_is_refused(file: Path, camera: Intrinsics) -> None:
    with pytest.raises(InputError, match="trained with .*train for this camera"):
        load_weights(file, "sim_actor", "peg_insertion", replace(CELL, intrinsics=camera))


def test_a_truncated_file_is_refused_at_any_length(file: Path) -> None:
    content = file.read_bytes()
    for length in (0, 4, 8, 100, len(content) // 2, len(content) - 1):
        file.write_bytes(content[:length])
        with pytest.raises(InputError, match="no whole safetensors file"):
            load_weights(file, "sim_actor", "peg_insertion", CELL)


def test_foreign_files_are_refused(file: Path) -> None:
    with pytest.raises(InputError, match="cannot read"):
        load_weights(file.with_name("missing"), "sim_actor", "peg_insertion", CELL)
    with pytest.raises(InputError, match="cannot read"):
        load_weights(file.parent, "sim_actor", "peg_insertion", CELL)
    torch.save(SimActor(0.01).state_dict(), file)  # a pickle
    with pytest.raises(InputError, match="no whole safetensors"):
        load_weights(file, "sim_actor", "peg_insertion", CELL)
    safetensors.torch.save_file({"a": torch.zeros(3)}, file)
    with pytest.raises(InputError, match="not one of samrl's"):
        load_weights(file, "sim_actor", "peg_insertion", CELL)


def _rewritten(file: Path, change) -> None:
    """By someone who means it: without the digest, as files of before have none."""
    with safetensors.safe_open(file, framework="pt") as opened:
        info = json.loads(opened.metadata()["samrl"])
        tensors = {name: opened.get_tensor(name) for name in opened.keys()}
    del info["sha256"]
    info, tensors = change(info, tensors)
    file.write_bytes(safetensors.torch.save(tensors, {"samrl": json.dumps(info)}))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda i, t: ({**i, "format": 99}, t), "format"),
        (lambda i, t: ({k: v for k, v in i.items() if k != "limit"}, t), "damaged"),
        (lambda i, t: ({**i, "extra": 1}, t), "damaged"),
        (lambda i, t: ({**i, "limit": -1.0}, t), "limit"),
        (lambda i, t: ({**i, "kind": "policy"}, t), "kind"),
        (lambda i, t: ({**i, "intrinsics": {**i["intrinsics"], "width": "x"}}, t), "damaged"),
        (lambda i, t: ([], t), "damaged"),
        (lambda i, t: (i, {k: v for k, v in t.items() if k != "head.0.bias"}), "head.0.bias"),
        (lambda i, t: (i, {**t, "head.0.bias": t["head.0.bias"][:-1]}), "head.0.bias"),
        (lambda i, t: (i, {**t, "head.0.bias": t["head.0.bias"] * torch.nan}), "head.0.bias is not finite"),
        (lambda i, t: (i, {**t, "more": torch.zeros(2).half()}), "1 tensors differ, first more"),
        (lambda i, t: (i, {**t, "head.0.bias": t["head.0.bias"].float()}), "torch.float32.* wanted"),
        (lambda i, t: (i, {**t, "head.0.bias": t["head.0.bias"].to(torch.float8_e4m3fn)}), "float8"),
        (lambda i, t: (i, {**t, "head.0.bias": t["head.0.bias"].to(torch.int64)}), "int64"),
        (lambda i, t: ({**i, "task": 3}, t), "task 3"),
        (lambda i, t: ({**i, "seed": "4"}, t), "seed '4'"),
        (lambda i, t: ({**i, "limit": float("nan")}, t), "limit is nan"),
        (lambda i, t: ({**i, "figures": {"error": 10**400}}, t), "damaged"),
        (lambda i, t: ({**i, "figures": [1.0]}, t), "damaged"),
        (lambda i, t: ({**i, "intrinsics": {**i["intrinsics"], "fx": 10**400}}, t), "damaged"),
        (lambda i, t: ({**i, "intrinsics": {**i["intrinsics"], "cx": float("nan")}}, t), "principal point"),
    ],
)
def test_a_changed_file_is_refused(file: Path, change, message: str) -> None:
    _rewritten(file, change)
    with pytest.raises(InputError, match=message):
        load_weights(file, "sim_actor", "peg_insertion", CELL)


def test_what_must_not_be_saved_is_refused_and_leaves_the_old_file(file: Path) -> None:
    before = sha256_of(file)
    network = SimActor(0.01)
    with pytest.raises(InputError, match="is no sensing_q"):
        save_weights(file, network, replace(INFO, kind="sensing_q"))
    with pytest.raises(InputError, match="network's limit"):
        save_weights(file, network, replace(INFO, limit=0.02))
    for bad in (torch.nan, 1e6):
        with torch.no_grad():
            network.state_dict()["head.0.bias"][3] = bad
        with pytest.raises(InputError, match="not finite in half"):
            save_weights(file, network, INFO)
    assert sha256_of(file) == before and list(file.parent.iterdir()) == [file]


def test_shipped_files_are_named_by_task_and_kind() -> None:
    assert shipped("peg_insertion", "sim_actor").name == "peg_insertion_sim_actor.safetensors"
    assert shipped("peg_insertion", "sim_actor").parent.name == "trained"


def test_a_residual_of_an_earlier_version_is_read(tmp_path: Path) -> None:
    """Its `keep_prob` was called `seen`."""
    path = tmp_path / "residual.safetensors"
    network = ResidualActor(0.003)
    network.keep_prob.fill_(0.25)
    save_weights(path, network, WeightsInfo("residual_actor", "peg_insertion", CELL.intrinsics, 0.003, 0))

    _rewritten(path, lambda i, t: (i, {name.replace("keep_prob", "seen"): one for name, one in t.items()}))
    found, _ = load_weights(path, "residual_actor", "peg_insertion", CELL)
    assert isinstance(found, ResidualActor) and float(found.keep_prob) == 0.25


@pytest.mark.parametrize("file", PUBLISHED, ids=lambda file: str(file.relative_to(TRAINING)))
def test_networks_behind_published_tables_are_there(file: Path) -> None:
    kind = next(k for k in get_args(Kind) if file.stem.endswith(k))
    load_weights(file, kind, file.stem.removesuffix(f"_{kind}"), CELL)
