"""Tensors that PyTorch saved (.pt, .pth); nothing but tensors is read, so no code of the file runs."""

from __future__ import annotations

import io
import pickle
import warnings
from pathlib import Path
from typing import Any

from samrl_core.common.errors import InputError
from samrl_core.common.files import read_whole
from samrl_ros.log_import.table import Table, as_column

_MAX_BYTES = 2**30


def read_torch_table(path: Path, where: str) -> Table:
    """A tensor (N, K) as `data`, others by their key in a dictionary or list; leading axes of 1 are left out.

    Raises:
        InputError: too large, no file of PyTorch's, or one that holds more than tensors, lists and numbers.
    """
    import torch  # takes a second, and few logs need it

    content = read_whole(path, _MAX_BYTES)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of files that older releases wrote
            loaded = torch.load(io.BytesIO(content), map_location="cpu", weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, EOFError, AttributeError, AssertionError) as error:
        raise InputError(
            f"{where}: {path.name} is damaged, or holds more than tensors, lists and numbers; objects are not"
            " unpickled, since that runs code of the file: save the tensors alone, or as .npz"
        ) from error
    table = Table(path)
    for name, value in _tensors(loaded):
        array = value.detach()
        while array.ndim > 2 and array.shape[0] == 1:  # a batch of one
            array = array[0]
        if array.numel() and not array.is_complex():
            table.columns[name] = as_column(array.double().numpy())
    if not table.columns:
        raise InputError(f"{where}: {path.name} holds no tensor")
    return table


def _tensors(value: Any, name: str = "") -> list[tuple[str, Any]]:
    import torch

    if isinstance(value, torch.Tensor):
        return [] if value.is_sparse or value.is_quantized else [(name or "data", value)]
    if isinstance(value, dict):
        inside = [(str(key), each) for key, each in value.items()]
    elif isinstance(value, list | tuple):
        inside = [(str(k), each) for k, each in enumerate(value)]
    else:
        return []
    return [found for key, each in inside for found in _tensors(each, f"{name}.{key}" if name else key)]
