"""A cell whose disk fills up stops, says so with the remedy, and leaves a summary and a bag that opens."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from samrl_core.blind_test.scores.diagnosis_run import can_hide

pytestmark = [pytest.mark.ros, pytest.mark.live, pytest.mark.timeout(1800)]
DISK_MB = 6  # the run's reserve has 4, so the bag is full within a second or two of joint states

# The disk exists in this name space alone, so it is looked at from within.
PROGRAM = """
mount -t tmpfs -o size={size}m none '{disk}' || exit 99
'{python}' -m samrl_ros.cli.main cell --layout threads --out '{disk}/run' > '{said}' 2>&1
echo $? > '{code}'
cp '{disk}/run/summary.json' '{kept}/'
cp -r '{disk}/run/bag' '{kept}/bag'
ls -A '{disk}/run' > '{kept}/files'
"""


@pytest.mark.skipif(not can_hide(), reason="this system gives no mount name space")
@pytest.mark.slow
def test_a_full_disk_ends_the_run_with_a_summary(tmp_path: Path) -> None:
    from samrl_ros.bags.reader import open_bag

    disk, kept, said, code = (tmp_path / name for name in ("disk", "kept", "said", "code"))
    disk.mkdir()
    kept.mkdir()
    names = {"disk": disk, "kept": kept, "said": said, "code": code, "python": sys.executable}
    script = PROGRAM.format(size=DISK_MB, **names)
    command = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", script]
    subprocess.run(command, env=dict(os.environ), check=False)
    text = said.read_text()
    assert code.read_text() == "1\n", text
    assert "Traceback" not in text
    assert "the cell stopped: " in text and f"cannot write the bag {disk}/run/bag" not in text
    assert f"cannot write {disk}/run/bag: No space left on device" in text
    assert "bytes are free at" in text and "Make room" in text and "samrl bag repair" in text
    summary = json.loads((kept / "summary.json").read_text())
    assert "No space left on device" in summary["error"]
    bag = open_bag(kept / "bag")
    assert bag.truncated and bag.message_count > 100
    assert not [name for name in (kept / "files").read_text().split() if "half" in name or "reserve" in name]
