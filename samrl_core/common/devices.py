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


def numbered_device(name: str) -> torch.device:
    """A device by torch's name, with its number: torch takes "cuda" for the current one, Warp takes no name
    without a number.
    """
    device = torch.device(name)
    if device.type == "cuda" and device.index is None:
        return torch.device("cuda", torch.cuda.current_device())
    return device
