"""What a tensor file gives back is the same at every reading, its order as well."""

from __future__ import annotations

from pathlib import Path

import torch

from samrl_core.common.tensor_file import read_tensors, write_tensors


def test_tensors_come_in_the_order_of_their_names(tmp_path: Path) -> None:
    """The library has another order at every call: of 8 tensors it is this one once in 40,320 times."""
    written = {name: torch.arange(float(k + 1)) for k, name in enumerate("hcafbdge")}
    write_tensors(tmp_path / "some.safetensors", "entry", {"step": 3}, written)
    tensors, about = read_tensors(tmp_path / "some.safetensors", "entry")
    assert list(tensors) == sorted(written) and about == {"step": 3}
    for name, value in tensors.items():
        assert torch.equal(value, written[name]), name
