"""Which kind a recording is of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.cell.types.body_recording import BodyRecording
from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.cell.types.pose_recording import PoseRecording
from samrl_core.cell.types.reading_recording import ReadingRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.kinds.arms import Arms
from samrl_core.diagnosis.kinds.bodies.body_tracks import BodyTracks
from samrl_core.diagnosis.kinds.images.images import Images
from samrl_core.diagnosis.kinds.kind import Kind, Recording
from samrl_core.diagnosis.kinds.poses.poses import Poses
from samrl_core.diagnosis.kinds.readings.readings import Readings

KINDS: dict[type, Kind[Any]] = {
    ArmRecording: Arms(),
    PoseRecording: Poses(),
    ReadingRecording: Readings(),
    BodyRecording: BodyTracks(),
    ImageRecording: Images(),
}


def kind_of(recordings: Sequence[Recording]) -> Kind[Any]:
    """The kind of all recordings.

    Raises:
        InputError: recordings of several kinds: each is diagnosed for itself.
    """
    types = {type(r) for r in recordings}
    if len(types) > 1:
        names = ", ".join(f"{r.name} ({type(r).__name__})" for r in recordings)
        raise InputError(f"recordings of several kinds: {names}; diagnose each kind for itself")
    (only,) = types
    return KINDS[only]
