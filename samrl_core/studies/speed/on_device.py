"""The model on a GPU: rates over the batch, beside the device's limits, and gradients beside the CPU's.

    python -m samrl_core.studies.speed.on_device --device cuda:0 --out DIR

Needs torch, warp-lang, numpy, scipy and matplotlib alone, no ROS, no PyBullet. `--gradients FILE` alone, on a
machine whose Warp has a CPU compiler, writes the CPU's gradients, which `--beside FILE` reads on one without.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import torch

from samrl_core.common.files import write_whole
from samrl_core.studies.speed import agreement, batches
from samrl_core.studies.speed.plots import rate_picture

BATCHES = (1, 64, 1024, 8192)
ROUNDS = 7


def main(arguments: list[str] | None = None) -> None:
    """Measure and write `on_device.json` and `on_device.png`."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--device", default="cpu", help="torch's name of the device")
    parser.add_argument("--out", type=Path, help="folder of the results")
    parser.add_argument("--batches", type=int, nargs="+", default=list(BATCHES))
    parser.add_argument("--gradients", type=Path, help="write the CPU's gradients to this file and stop")
    parser.add_argument("--beside", type=Path, help="the CPU's gradients, of another machine")
    given = parser.parse_args(arguments)
    if given.gradients is not None:
        torch.save(agreement.all_gradients("cpu"), given.gradients)
        return
    if given.out is None:
        parser.error("--out DIR is needed: the folder of the results")
    device = torch.device(given.device)
    if device.type == "cuda" and not torch.cuda.is_available():
        parser.error(f"no device {given.device} here; --device cpu runs everywhere")
    beside = torch.load(given.beside, weights_only=True) if given.beside else agreement.all_gradients("cpu")
    result = {
        "device": torch.cuda.get_device_name(device) if device.type == "cuda" else "cpu",
        "torch": torch.__version__,
        "copy_bytes_per_second": batches.copy_bandwidth(given.device),
        "launch_seconds": batches.launch_seconds(given.device),
        "gradient_differences": agreement.differences(agreement.all_gradients(given.device), beside),
        "images": batches.image_rates(given.device, given.batches, ROUNDS),
        "steps": {
            name: batches.step_rates(name, given.device, given.batches, ROUNDS) for name in batches.STEPPED
        },
    }
    given.out.mkdir(parents=True, exist_ok=True)
    write_whole(given.out / "on_device.json", json.dumps(result, indent=1))
    rate_picture(result, given.out / "on_device.png")
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
