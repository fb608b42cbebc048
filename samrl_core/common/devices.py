"""Where tensors are computed, by torch's name."""

from __future__ import annotations

import torch

from samrl_core.common.errors import InputError


def checked_device(name: str) -> torch.device:
    """The device.

    Raises:
        InputError: torch knows no such name, or finds no such device.
    """
    try:
        device = torch.device(name)
    except RuntimeError as error:
        raise InputError(f"device is {name!r}, must be cpu or cuda:0 ({error})") from error
    if device.type == "cuda" and (device.index or 0) >= torch.cuda.device_count():
        found = torch.cuda.device_count() or "no"
        raise InputError(f"device is {name}, but torch finds {found} CUDA devices; use cpu")
    return device
