"""The one regression loop, for actor and Q: Adam, cosine, checkpoints, and the same result after a kill.

Everything that decides the result lies in the checkpoint or follows from the settings: the order of the
samples follows from (seed, epoch), so a step's number is all that is needed to go on. On a CPU with the same
number of threads a resumed training gives the same weights bit by bit; on CUDA up to the order of sums.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from torch import nn

from samrl_core.common.devices import checked_device
from samrl_core.common.errors import InputError, SolveError
from samrl_core.common.files import write_whole
from samrl_core.learning.data.checkpoint import (
    adam_tensors,
    load_adam,
    load_checkpoint,
    save_checkpoint,
    with_prefix,
)


@dataclass(frozen=True)
class FitSettings:
    """One training.

    Raises:
        InputError: a value outside its limits, or a device that is not there.
    """

    epochs: int = 30
    batch_size: int = 128
    learning_rate: float = 1e-3  # highest, of Adam
    warm_up: float = 0.03  # share of all steps in which the learning rate rises from 0
    max_gradient: float = 1.0  # norm to which a longer gradient is cut
    seed: int = 0  # of the first weights and of the samples' order
    device: str = "cpu"  # torch's name
    bfloat16: bool = False  # autocast of the convolutions
    checkpoint_every: int = 500  # steps between two checkpoints; each epoch's end is one anyway

    def __post_init__(self) -> None:
        for name in ("epochs", "batch_size", "checkpoint_every"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} is {getattr(self, name)}, must be at least 1")
        for name in ("learning_rate", "max_gradient"):
            if not 0 < getattr(self, name) < math.inf:
                raise InputError(f"{name} is {getattr(self, name)}, must be positive and finite")
        if not 0 <= self.warm_up < 1:
            raise InputError(f"warm_up is {self.warm_up}, must be a share of the steps, 0 to below 1")
        checked_device(self.device)

    def learning_rate_at(self, step: int, steps: int) -> float:
        """Learning rate of a step: up to the highest, then half a cosine down to 0."""
        rising = max(1, round(self.warm_up * steps))
        if step < rising:
            return self.learning_rate * (step + 1) / rising
        return 0.5 * self.learning_rate * (1 + math.cos(math.pi * (step - rising) / max(1, steps - rising)))


@dataclass(frozen=True)
class FitResult:
    """What a finished training gave."""

    steps: int
    figures: dict[str, float]  # means over the validation samples, at the end
    rows: tuple[dict[str, float], ...]  # of the log, one per epoch


IMAGE = "image"  # (B, 6, H, W), see `network_image`
ACTION = "action"  # (B, 3) [m]
RETURN = "return_"  # (B,) 0..1


class RegressionSamples(Protocol):
    """Read-only samples; the same indices give the same batch, so that a resumed training sees the same."""

    def __len__(self) -> int:
        """How many there are."""
        ...

    def batch(self, indices: np.ndarray, device: torch.device) -> dict[str, torch.Tensor]:
        """Samples (B,) int on a device, by names as above, any float type; samples lie in the first axis."""
        ...


Batch = dict[str, torch.Tensor]
# Per-sample values (B,) of a batch, among them `loss`, whose mean is made small. The others are reported
# only; NaN where the metric does not apply to the sample.
Objective = Callable[[nn.Module, Batch], dict[str, torch.Tensor]]
Progress = Callable[[dict[str, float]], None]

LOSS = "loss"
CHECKPOINT, STOPPED, LOG = "checkpoint.safetensors", "stopped.safetensors", "log.csv"
_KIND = "regression"
_NETWORK, _ADAM = "network.", "adam."


def fit(
    network: nn.Module,
    train: RegressionSamples,
    validation: RegressionSamples,
    objective: Objective,
    settings: FitSettings,
    folder: Path,
    progress: Progress | None = None,
) -> FitResult:
    """Train a network in place; goes on from the checkpoint in `folder` if there is one.

    The folder gets `checkpoint.safetensors`, `log.csv` (a row per epoch: training loss, validation metrics)
    and, after a loss or gradient that is not finite, `stopped.safetensors` with the state and the samples.

    Args:
        network: with its first weights; ends on the settings' device in evaluation mode.
        train: at least one batch.
        validation: at least one sample, of other episodes than the training's.
        objective: loss and metrics per sample.
        settings: of the training.
        folder: of this training alone.
        progress: gets each row of the log.

    Raises:
        InputError: too few samples, or a checkpoint of another training or that cannot be read.
        SolveError: a loss or gradient is not finite; the message names the file with the state.
    """
    if len(train) < settings.batch_size or len(validation) < 1:
        raise InputError(
            f"{len(train)} samples to train and {len(validation)} to validate; at least one batch of "
            f"{settings.batch_size} and one sample are needed: use more samples, or a smaller batch"
        )
    return _Fit(network, train, validation, objective, settings, folder, progress or (lambda row: None)).run()


class _Fit:
    def __init__(self, network, train, validation, objective, settings, folder, progress) -> None:
        self.settings: FitSettings = settings
        self.device = torch.device(settings.device)
        self.network: nn.Module = network.to(self.device)
        self.train: RegressionSamples = train
        self.validation: RegressionSamples = validation
        self.objective: Objective = objective
        self.folder: Path = folder
        self.progress: Progress = progress
        self.adam = torch.optim.Adam(self.network.parameters(), lr=settings.learning_rate)
        self.per_epoch = len(train) // settings.batch_size  # the remainder comes in another epoch
        self.steps = self.per_epoch * settings.epochs
        self.step = 0
        self.epoch_loss = 0.0  # sum over this epoch's steps so far
        self.rows: list[dict[str, float]] = []
        # What must be the same for going on; how often to write and where to compute may change.
        same = asdict(replace(settings, checkpoint_every=1, device="cpu", bfloat16=False))
        self.identity = {**same, "train": len(train), "validation": len(validation)}

    def run(self) -> FitResult:
        """All steps that are left."""
        self._resume()
        order = np.zeros(0, dtype=np.int64)
        while self.step < self.steps:
            epoch, k = divmod(self.step, self.per_epoch)
            if k == 0 or not len(order):
                order = np.random.default_rng([self.settings.seed, epoch]).permutation(len(self.train))
            size = self.settings.batch_size
            self.epoch_loss += self._update(order[k * size : (k + 1) * size])
            self.step += 1
            if self.step % self.per_epoch == 0:
                self._end_epoch(epoch)
            elif self.step % self.settings.checkpoint_every == 0:
                self._save(self.folder / CHECKPOINT)
        self.network.eval()
        figures = {name: value for name, value in self.rows[-1].items() if name not in _TRAINING}
        return FitResult(self.step, figures, tuple(self.rows))

    def _update(self, indices: np.ndarray) -> float:
        self.network.train()
        for group in self.adam.param_groups:
            group["lr"] = self.settings.learning_rate_at(self.step, self.steps)
        loss = self._evaluate(self.train, indices)[LOSS].mean()
        self.adam.zero_grad()
        loss.backward()
        length = nn.utils.clip_grad_norm_(self.network.parameters(), self.settings.max_gradient)
        value = loss.item()
        if not (math.isfinite(value) and math.isfinite(length.item())):
            path = self.folder / STOPPED
            self._save(
                path, {"indices": indices.tolist(), "loss": str(value), "gradient": str(length.item())}
            )
            raise SolveError(
                f"step {self.step}: loss {value} and gradient norm {length.item()} must be finite; stopped "
                f"before the update. Weights and batch are in {path}; check these samples, or lower the "
                f"learning rate ({self.settings.learning_rate})"
            )
        self.adam.step()
        return value

    def _evaluate(self, samples: RegressionSamples, indices: np.ndarray) -> dict[str, torch.Tensor]:
        batch = samples.batch(indices, self.device)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.settings.bfloat16):
            return self.objective(self.network, batch)

    def _end_epoch(self, epoch: int) -> None:
        row = {
            "epoch": float(epoch + 1),
            "step": float(self.step),
            "rate": self.settings.learning_rate_at(self.step - 1, self.steps),
            "training_loss": self.epoch_loss / self.per_epoch,
            **self._validate(),
        }
        self.rows.append(row)
        self.epoch_loss = 0.0
        self._save(self.folder / CHECKPOINT)
        self._write_log()
        self.progress(row)

    def _validate(self) -> dict[str, float]:
        self.network.eval()
        parts: dict[str, list[np.ndarray]] = {}
        with torch.no_grad():
            for first in range(0, len(self.validation), self.settings.batch_size):
                indices = np.arange(first, min(first + self.settings.batch_size, len(self.validation)))
                for name, values in self._evaluate(self.validation, indices).items():
                    parts.setdefault(name, []).append(values.float().cpu().numpy())
        joined = {name: np.concatenate(values) for name, values in parts.items()}
        wrong = np.flatnonzero(~np.isfinite(joined[LOSS]))  # else it would pass for a metric without meaning
        if len(wrong):
            path = self.folder / STOPPED
            self._save(path, {"validation": wrong.tolist()})
            raise SolveError(
                f"step {self.step}: losses of {len(wrong)} validation samples are not finite, first that of "
                f"sample {wrong[0]} ({joined[LOSS][wrong[0]]}); check it. Weights are in {path}"
            )
        return {name: float(v[~np.isnan(v)].mean()) for name, v in joined.items() if not np.isnan(v).all()}

    def _write_log(self) -> None:
        text = io.StringIO()
        figures = sorted({name for row in self.rows for name in row} - set(_TRAINING))
        writer = csv.DictWriter(text, [*_TRAINING, *figures], lineterminator="\n")
        writer.writeheader()
        writer.writerows(self.rows)
        write_whole(self.folder / LOG, text.getvalue().encode())

    def _save(self, path: Path, more: dict[str, Any] | None = None) -> None:
        tensors = {_NETWORK + name: value for name, value in self.network.state_dict().items()}
        tensors |= adam_tensors(self.adam, _ADAM)
        about = {"step": self.step, "epoch_loss": self.epoch_loss, "rows": self.rows, **(more or {})}
        save_checkpoint(path, _KIND, tensors, {"identity": self.identity, **about})

    def _resume(self) -> None:
        path = self.folder / CHECKPOINT
        if not path.exists():
            return
        tensors, about = load_checkpoint(path, _KIND)
        try:
            identity = dict(about["identity"])
            step, epoch_loss, rows = int(about["step"]), float(about["epoch_loss"]), list(about["rows"])
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(
                f"{path} has an incomplete description ({error}); remove it to begin anew"
            ) from error
        if identity != self.identity:
            other = sorted(
                k for k in identity.keys() | self.identity if identity.get(k) != self.identity.get(k)
            )
            raise InputError(
                f"{path} is of another training: {', '.join(other)} differ; give another folder or remove it"
            )
        try:
            self.network.load_state_dict(with_prefix(tensors, _NETWORK))
        except RuntimeError as error:
            raise InputError(f"{path} does not fit the network ({error}); give another folder") from error
        load_adam(self.adam, tensors, _ADAM)
        self.step, self.epoch_loss, self.rows = step, epoch_loss, rows
        if self.rows:
            self._write_log()  # the kill may have come between the checkpoint and the log


_TRAINING = ("epoch", "step", "rate", "training_loss")  # columns of the log besides the validation metrics
