"""Stamps of two clocks as labs log them, five minutes at 30 Hz, by NumPy alone.

python -m tests.recordings.logs.clock_logs DIR makes a file for each.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

EPOCH, COUNT, RATE = 1.7e9, 9000, 30.0


def make_clock_logs(folder: Path) -> Path:
    """Files by what is wrong with the clocks."""
    folder.mkdir(parents=True, exist_ok=True)
    rng, t = np.random.default_rng(11), np.arange(COUNT) / RATE

    def jitter(size: float) -> np.ndarray:
        return size * rng.standard_normal(COUNT)

    def way() -> np.ndarray:
        return 0.004 + 0.0008 * rng.gamma(2.0, 1.0, COUNT)

    def write(name: str, form: str, keep: np.ndarray | slice, **columns: np.ndarray) -> None:
        names = ",".join(columns).replace("percent_", "%").replace("__", ".")
        rows = np.stack(list(columns.values()), axis=1)[keep]
        np.savetxt(folder / f"{name}.csv", rows, delimiter=",", header=names, comments="", fmt=form)

    whole, host = slice(None), EPOCH + t
    write("drift", "%.6f", whole, host_stamp=host, camera_stamp=host + 35e-6 * t + 0.012 + jitter(2e-4))
    device = 1e6 * (83.2 + t * (1 - 18e-6))
    write("own_zero", "%.6f", whole, host_time_s=host + way(), device_time_us=device)
    write("set", "%.6f", whole, host_time=host, sensor_time=host + 0.25 * (t > 170) + jitter(2e-4))
    write("right", "%.6f", whole, host_time=host, sensor_time=host + jitter(3e-4))
    kept, number = rng.uniform(size=COUNT) > 0.07, np.arange(float(COUNT))
    lost = {"frame": number, "host_time": host, "sensor_time": host + 60e-6 * t + jitter(2e-4)}
    write("lost_frames", "%.6f", kept, **lost)
    write("counted", "%.6f", whole, frame=number, host_time=EPOCH + number / 29.97 + way())
    write("late", "%.6f", whole, event_host=host, stamp_camera=host + 0.045 + jitter(1e-3))
    write("exact", "%d", whole, host_ns=1e9 * host, sensor_ns=1e9 * (host + 35e-6 * t + 0.012))
    echoed = {"percent_time": 1e9 * (host + way()), "field__header__stamp": 1e9 * (host + 25e-6 * t)}
    write("echo", "%d", whole, **echoed, field__header__seq=number)
    return folder


if __name__ == "__main__":
    make_clock_logs(Path(sys.argv[1]))
