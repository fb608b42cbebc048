"""Bags to arm recordings and back, without ROS; other logs to bags."""

from samrl_ros.recordings.nominal_texts import TOLERANCE_FILE, read_tolerances
from samrl_ros.recordings.read import LoadedBag, load_recordings, read_recordings
from samrl_ros.recordings.write import write_recording

__all__ = [
    "LoadedBag",
    "TOLERANCE_FILE",
    "load_recordings",
    "read_recordings",
    "read_tolerances",
    "write_recording",
]
