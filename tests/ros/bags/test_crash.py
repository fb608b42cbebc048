"""Killed and disk-full writers leave a bag that opens and can be repaired."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from samrl_core.common.errors import InputError
from samrl_ros.bags.reader import open_bag
from samrl_ros.bags.repair import repair

FOR_EVER = """
import sys, time
from samrl_ros.bags.writer import BagWriter
w = BagWriter(sys.argv[1], custom_data={"task": "peg_insertion"})
w.add_topic("/a", "std_msgs/msg/String")
i = 0
while True:
    i += 1
    w.write("/a", i, b"\\0\\1\\0\\0\\2\\0\\0\\0a\\0")
    print(i, time.monotonic(), flush=True)
    time.sleep(0.004)
"""
DISK_FULL = """
import resource, sys
from samrl_core.common.errors import InputError
from samrl_ros.bags.writer import BagWriter
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
w = BagWriter(sys.argv[1], compression="none", chunk_bytes=30_000)
w.add_topic("/a", "std_msgs/msg/String")
try:
    for i in range(100_000):
        w.write("/a", i, b"\\0\\1\\0\\0\\2\\0\\0\\0a\\0")
except InputError as error:
    print(i, error)
try:
    w.write("/a", i, b"\\0\\1\\0\\0\\2\\0\\0\\0a\\0")
except InputError as error:
    print("again", error)
w.close()
w.close()
"""


@pytest.mark.parametrize("seconds", [0.3, 1.7])
def test_sigkill_loses_at_most_a_second(tmp_path: Path, child_environment, seconds: float) -> None:
    folder = tmp_path / "killed"
    child = subprocess.Popen(
        [sys.executable, "-c", FOR_EVER, str(folder)],
        stdout=subprocess.PIPE,
        env=child_environment,
        text=True,
    )
    assert child.stdout is not None
    lines = [child.stdout.readline()]
    time.sleep(seconds)
    child.kill()
    lines += child.stdout.readlines()
    child.wait()
    child.stdout.close()
    written = [(int(a), float(b)) for a, b in (line.split() for line in lines if line.endswith("\n"))]
    bag = open_bag(folder)
    kept = [m.log_time_ns for m in bag.messages()]
    assert bag.truncated and not bag.has_metadata
    assert bag.custom_data == {"task": "peg_insertion"}
    assert kept == list(range(1, len(kept) + 1))
    due = [number for number, at in written if at < written[-1][1] - 1.0]
    assert len(kept) >= len(due)
    if seconds < 1:
        return
    assert due and kept
    report = repair(folder, tmp_path / "whole")
    whole = open_bag(tmp_path / "whole")
    assert report.messages == len(kept) == whole.message_count
    assert not whole.truncated and whole.has_metadata


def test_disk_full_is_said_and_nothing_claims_to_be_complete(tmp_path: Path, child_environment) -> None:
    folder = tmp_path / "full"
    done = subprocess.run(
        [sys.executable, "-c", DISK_FULL, str(folder)],
        capture_output=True,
        env=child_environment,
        text=True,
        check=True,
    )
    first, again = done.stdout.splitlines()
    assert "samrl bag repair" in first and "recording stopped" in first
    assert again.startswith("again cannot write")
    assert not (folder / "metadata.yaml").exists()
    bag = open_bag(folder)
    assert bag.truncated and 1000 < bag.message_count <= 1 + int(first.split()[0])
    assert repair(folder, tmp_path / "whole").messages == bag.message_count


def test_a_write_error_inside_close_leaves_no_metadata(tmp_path: Path, monkeypatch) -> None:
    from samrl_ros.bags import writer as module

    writer = module.BagWriter(tmp_path / "bag")
    writer.add_topic("/a", "std_msgs/msg/String")
    writer.write("/a", 1, b"\0\1\0\0\2\0\0\0a\0")

    def full(self: object, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module._Sink, "write", full)
    with pytest.raises(InputError, match="No space left"):
        writer.close()
    writer.close()
    assert writer.closed
    assert [p.name for p in (tmp_path / "bag").iterdir()] == ["bag_0.mcap"]
