"""Trained networks as files: safetensors, so that loading runs no code from the file.

A file knows its network, task and camera, and opens for these alone: what a network learnt at one image
size or lens is silently wrong at another. Weights lie there in half precision and are used in single.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Literal, get_args

import torch
from torch import nn

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks import plain_name
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.common.errors import InputError
from samrl_core.common.tensor_file import read_tensors, write_tensors
from samrl_core.policy.networks.networks import OLD_KEYS, ResidualActor, SensingQ, SimActor, TwinCritic

Kind = Literal["sim_actor", "sensing_q", "residual_actor", "twin_critic"]
FORMAT = 1
_ENTRY = "samrl"  # of the file's metadata
_MAKE: dict[str, tuple[type[nn.Module], Callable[[float], nn.Module]]] = {
    "sim_actor": (SimActor, SimActor),
    "sensing_q": (SensingQ, lambda _: SensingQ()),
    "residual_actor": (ResidualActor, ResidualActor),
    "twin_critic": (TwinCritic, TwinCritic),
}


@dataclass(frozen=True)
class WeightsInfo:
    """Metadata of a weight file.

    Raises:
        InputError: an unknown kind, or a limit that is none.
    """

    kind: Kind
    task: str
    intrinsics: Intrinsics  # of the cell's camera; image size included
    limit: float  # longest output of an actor, longest action that a Q or critic was trained on [m]
    seed: int
    figures: dict[str, float] = field(default_factory=dict)  # metrics of the training, e.g. validation errors
    source: str = ""  # commit that trained it, where known

    def __post_init__(self) -> None:
        if self.kind not in get_args(Kind):
            raise InputError(f"no network is of kind {self.kind!r}; there are {', '.join(get_args(Kind))}")
        if not 0.0 < self.limit < 1.0:
            raise InputError(f"action limit is {self.limit} m, must be above 0 and below 1 m")
        if not (isinstance(self.task, str) and isinstance(self.source, str) and type(self.seed) is int):
            raise InputError(
                f"task {self.task!r} and source {self.source!r} must be texts, seed {self.seed!r} an integer"
            )
        for name, value in self.figures.items():
            if not math.isfinite(value):
                raise InputError(f"training figure {name} is {value}, must be finite")


def weights_name(task: str, kind: Kind) -> str:
    """Of the file, in whatever folder it lies."""
    return f"{task}_{kind}.safetensors"


def shipped(task: str, kind: Kind) -> Path:
    """Where the package keeps the weights of a task; the file may not be there."""
    return Path(__file__).parent / "trained" / weights_name(task, kind)


def weights_file(task: str, kind: Kind, folder: Path | None = None) -> Path:
    """Where the weights of a task lie: `<task>_<kind>.safetensors` in a folder, or in the package.

    Those of the plain task for a variant that has none of its own there. The file need not be there.
    """
    folder = folder or shipped(task, kind).parent
    files = [folder / weights_name(name, kind) for name in (task, plain_name(task))]
    return next((file for file in files if file.is_file()), files[0])


def sha256_of(path: Path) -> str:
    """Hexadecimal SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def save_weights(path: Path, module: nn.Module, info: WeightsInfo) -> None:
    """Write a network; `path` holds the old file or the whole new one at any instant.

    Raises:
        InputError: the module is not of the stated kind, its limit differs from the stated one, or a weight
            is not finite or too large for half precision.
    """
    expected, _ = _MAKE[info.kind]
    if type(module) is not expected:
        raise InputError(f"{type(module).__name__} is no {info.kind}, which is a {expected.__name__}")
    own = getattr(module, "action_limit", getattr(module, "limit", info.limit))
    if own != info.limit:
        raise InputError(
            f"the network's limit is {own} m, the stated one {info.limit} m; state the network's"
        )
    tensors = {}
    for name, value in module.state_dict().items():
        half = value.detach().to("cpu", torch.float16).contiguous()
        if not bool(torch.isfinite(half).all()):
            raise InputError(f"weight {name} is not finite in half precision; the training has diverged")
        tensors[name] = half
    write_tensors(path, _ENTRY, {"format": FORMAT, **asdict(info)}, tensors)


def load_weights(path: Path, kind: Kind, task: str, cell: CellSpec) -> tuple[nn.Module, WeightsInfo]:
    """Read a network for one use; it comes on the CPU, in float32 and in evaluation mode.

    A variant of a task takes the networks of the plain task, too.

    Raises:
        InputError: no such file, no weight file of ours, truncated, damaged, of another kind or task, trained
            for another image size or lens, tensors that do not fit, or a weight that is not finite.
    """
    tensors, info = _read(path)
    if info.kind != kind or info.task not in (task, plain_name(task)):
        raise InputError(
            f"{path} holds {info.kind} of {info.task}, wanted is {kind} of {task}; name the file for that"
        )
    if info.intrinsics != cell.intrinsics:
        raise InputError(
            f"{path} was trained with {info.intrinsics}, the cell's camera has {cell.intrinsics}; train for "
            f"this camera (`samrl train {task}`), or set the camera to the trained size and lens"
        )
    module = _MAKE[kind][1](info.limit)
    wanted = {name: (torch.float16, tuple(value.shape)) for name, value in module.state_dict().items()}
    found = {name: (value.dtype, tuple(value.shape)) for name, value in tensors.items()}
    if wanted != found:
        different = sorted(n for n in wanted.keys() | found.keys() if wanted.get(n) != found.get(n))
        raise InputError(
            f"{path} does not fit the network {kind}: {len(different)} tensors differ, first "
            f"{different[0]} ({found.get(different[0])}, wanted {wanted.get(different[0])}); train anew"
        )
    for name, value in tensors.items():
        if not bool(torch.isfinite(value).all()):
            raise InputError(f"{path}: weight {name} is not finite; take another file or train anew")
    module.load_state_dict({name: value.to(torch.float32) for name, value in tensors.items()})
    return module.eval(), info


def _read(path: Path) -> tuple[dict[str, torch.Tensor], WeightsInfo]:
    tensors, stated = read_tensors(path, _ENTRY)
    try:
        if stated.pop("format") != FORMAT:
            raise InputError(f"{path} is not of weight format {FORMAT}; train anew")
        tensors = {OLD_KEYS.get(name, name): value for name, value in tensors.items()}
        return tensors, WeightsInfo(intrinsics=Intrinsics(**stated.pop("intrinsics")), **stated)
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
        raise InputError(f"{path} has a damaged description ({error}); fetch or train it again") from error
