"""Torch's devices by name."""

from __future__ import annotations

import pytest
import torch

from samrl_core.common.devices import numbered_device


def test_a_name_without_a_number_is_the_current_device(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "current_device", lambda: 2)
    assert numbered_device("cuda") == torch.device("cuda", 2)
    assert numbered_device("cuda:1") == torch.device("cuda", 1)
    assert numbered_device("cpu") == torch.device("cpu")
