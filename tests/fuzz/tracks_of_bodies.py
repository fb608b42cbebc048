"""Drafts of damaged tracks: every layout of a motion capture, of poses, and of two clocks."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.writing import as_yaml
from tests.diagnosis.bodies.body_worlds import Tracker, World, several, toss
from tests.fuzz.reader import Reader
from tests.recordings.logs import body_logs


def _draft(path: Path) -> None:
    as_yaml(draft_any([path], None, None))


def _sound(*writers: body_logs.Writer) -> Callable[[], list[bytes]]:
    def make() -> list[bytes]:
        (made,) = several(toss, World(tracker=Tracker(rate=60.0)), 1, 3)
        with tempfile.TemporaryDirectory() as folder:
            return [write(Path(folder) / "a", made.track).read_bytes() for write in writers]

    return make


def _pair() -> list[bytes]:
    time = np.arange(0.0, 3.0, 0.05)
    rows = [f"{t:.3f},{np.sin(t):.4f},0.2,0.6,0,0,0,1,{np.cos(t):.4f},0.1,0.4,0,0,0,1" for t in time]
    names = [f"{n}_{a}" for n in ("tag", "tcp") for a in ("x", "y", "z", "qx", "qy", "qz", "qw")]
    return ["\n".join([",".join(["t", *names]), *rows]).encode()]


def _clocks() -> list[bytes]:
    rows = [f"{k},{50000 * k},{0.05 * k:.3f}" for k in range(80)]
    return ["\n".join(["seq,device_time_us,host_time_s", *rows]).encode()]


def _echoes() -> list[bytes]:
    """Of a body's positions and of two joints, by ROS 2 and by ROS 1."""
    out = []
    for seconds, rest in (("sec", "nanosec"), ("secs", "nsecs")):
        point = joints = "WARNING: topic does not appear to be published yet\n"
        for k in range(40):
            t = k / 60.0
            head = f"header:\n  stamp:\n    {seconds}: 7\n    {rest}: {int(1e9 * t)}\n  frame_id: mocap\n"
            point += f"{head}point:\n  x: {0.5 * t}\n  y: 1e-05\n  z: {2.0 - 4.905 * t * t}\n---\n"
            joints += f"{head}name: [a, b]\nposition: [{np.sin(t)}, 0.1]\nvelocity: []\neffort: []\n---\n"
        out += [point.encode(), joints.encode()]
    return out


def _named_cells() -> list[bytes]:
    """A joint in lines of `name:value`, and two below two lines of names."""
    pairs = lines = ""
    for k in range(60):
        t = k / 50.0
        pairs += (
            f"t_ms:{20 * k},theta_deg:{np.sin(t):.3f},theta_dps:{np.cos(t):.3f},volt:{np.cos(2 * t):.2f}\n"
        )
        lines += f"{t:.3f},{np.sin(t):.4f},{np.cos(t):.4f},{np.sin(2 * t):.4f},{2 * np.cos(2 * t):.4f}\n"
    head = ",hip,hip,knee,knee\n,position,velocity,position,velocity\ntime,,,,\n"
    return [pairs.encode(), (head + lines).encode()]


TRACKS_OF_BODIES = (
    Reader(
        "draft of a motion capture", "a.csv",
        _sound(body_logs.motive, body_logs.motive_labelled, body_logs.vicon), _draft, share=0.1,
    ),
    Reader(
        "draft of a trajectory", "a.csv",
        _sound(body_logs.euroc, body_logs.ros_seconds, body_logs.semicolons), _draft, share=0.1,
    ),
    Reader("draft of a text", "a.txt", _sound(body_logs.tum), _draft, share=0.1),
    Reader("draft of poses", "a.csv", _pair, _draft, share=0.05),
    Reader("draft of an echo", "a.txt", _echoes, _draft, share=0.1),
    Reader("draft of named cells", "a.txt", _named_cells, _draft, share=0.1),
    Reader("draft of clocks", "a.csv", _clocks, _draft, share=0.1),
)  # fmt: skip
