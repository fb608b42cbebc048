"""Named effects on poses as corrections of the calibration that was stated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.pose_recording import PoseRecording
from samrl_core.diagnosis.effects.pose_forms import SIX
from samrl_core.diagnosis.export.recalibration import Advice, CorrectedTransform, Recalibration
from samrl_core.diagnosis.residuals.poses import rigid
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial
from samrl_core.diagnosis.selection.hypothesis import Fit, Hypothesis

LINK_OF = {"hand_eye": "camera", "base_to_base": "base", "kinematic_error": "target"}


def recalibration(chosen: Fit, trials: Sequence[PoseTrial]) -> Recalibration:
    """Turn the named effects into corrections."""
    first = trials[0]
    transforms: list[CorrectedTransform] = []
    statements: list[Advice] = []
    for h, amplitudes, covariance in chosen.parts():
        link = LINK_OF.get(h.effect.family)
        if link is not None and not h.place.startswith("link:"):
            transforms.append(_transform(h, link, amplitudes, covariance, first))
        else:
            statements.append(Advice(h.name, _statement(h, amplitudes, first)))
    sources = tuple((t.recording.source, t.recording.sha256) for t in trials)
    return Recalibration(first.recording.camera, tuple(transforms), tuple(statements), sources)


def _transform(
    h: Hypothesis, link: str, amplitudes: np.ndarray, covariance: np.ndarray, trial: PoseTrial
) -> CorrectedTransform:
    stated = getattr(trial.constants, link)
    found = stated @ rigid.exp(amplitudes)[0]
    turn = np.eye(6)
    turn[:3, :3] = stated[:3, :3]  # the small transform's translation is along the child's axes
    name, calibration = _name_of(link, trial.recording)
    return CorrectedTransform(
        h.name,
        name,
        stated=Pose.from_matrix(stated),
        found=Pose.from_matrix(found),
        covariance=turn @ covariance @ turn.T,
        calibration=calibration,
    )


def _name_of(link: str, recording: PoseRecording) -> tuple[str, tuple[str, str] | None]:
    """A link's name in a mapping, and where a cell keeps it."""
    still, both = recording.camera_arm is None, recording.tool_arm is not None
    if link == "camera":
        return ("camera_in_base", None) if still else ("camera_in_flange", ("hand_eye", "camera_in_flange"))
    if link == "target":
        return "target_in_flange", None
    return (
        ("base_in_base", ("base_to_base", "tool_base_in_camera_base")) if both else ("target_in_base", None)
    )


def _statement(h: Hypothesis, amplitudes: np.ndarray, trial: PoseTrial) -> str:
    values = h.form.parameters(trial, h.shape, amplitudes)
    family, (kind, _, name) = h.effect.family, h.place.partition(":")
    if family == "camera_latency":
        return f"shift the camera's stamps: `time: {{offset_s: {-values['T']:.5f}}}` of its source"
    if family == "clock_offset":
        drift = values.get("drift", 0.0)
        rest = f", and {-1e6 * drift:.1f} us per second of the recording" if drift else ""
        return f"shift {name}'s stamps: `time: {{offset_s: {-values['o']:.5f}}}` of its source{rest}"
    if family == "encoder_offset":
        return f"subtract {values['e']:.6f} rad from what {name} reads"
    if family == "object_geometry":
        return f"state the target's size times {1.0 + values['s']:.5f} where it is detected"
    listed = ", ".join(f"{n} {values[n]:.6f}" for n in SIX if n in values)
    return f"multiply the frame of {kind} {name} in the URDF by exp({listed}) [m, rad]"
