"""Named effects on images as corrections of the calibration that was stated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from samrl_core.cell.calibration.cell_correction import ENCODER_ZERO, LENS, find_beyond
from samrl_core.cell.types.pose import Pose
from samrl_core.diagnosis.export.recalibration import Advice, CorrectedTransform, Recalibration
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial
from samrl_core.diagnosis.residuals.poses import rigid
from samrl_core.diagnosis.selection.hypothesis import Fit, Hypothesis

# Family -> its name in a mapping, and where a cell keeps it.
TRANSFORMS = {
    "hand_eye": ("camera_in_flange", ("hand_eye", "camera_in_flange")),
    "base_to_base": ("base_in_base", ("base_to_base", "tool_base_in_camera_base")),
}

_LENS = {name: name for name in LENS}
# Family -> which number of a cell's correction each of its parameters is.
NUMBERS_OF: dict[str, dict[str, str]] = {
    "depth_scale": {"a": "depth_scale", "b": "depth_offset"},
    "intrinsics": _LENS,
    "lens_distortion": _LENS,
}


def recalibration(chosen: Fit, trials: Sequence[ImageTrial]) -> Recalibration:
    """Turn the named effects into corrections; what is no transform becomes a sentence.

    An effect that has a number beyond what a cell puts right is left out as a whole: half of a lens is none.
    """
    first = trials[0]
    transforms: list[CorrectedTransform] = []
    statements: list[Advice] = []
    numbers: dict[str, float] = {}
    known: list[tuple[tuple[str, ...], np.ndarray]] = []
    of_numbers: list[str] = []
    refused: list[Advice] = []
    zeros: dict[str, dict[str, float]] = {}
    of_zeros: list[str] = []
    for h, amplitudes, covariance in chosen.parts():
        if h.effect.family in TRANSFORMS:
            transforms.append(_transform(h, amplitudes, covariance, first))
            continue
        statements.append(Advice(h.name, _statement(h, amplitudes, first)))
        if h.effect.family == "encoder_offset":
            arm, index = first.joint_of(h.place)
            joint, zero = first.joints[arm][index], h.form.parameters(first, h.shape, amplitudes)["e"]
            if abs(zero) > ENCODER_ZERO:
                limit = f"{joint} is off by {zero:g} rad, a cell corrects up to {ENCODER_ZERO:g} rad"
                refused.append(Advice(h.name, f"{limit}: set the joint's zero in its drive"))
                continue
            zeros.setdefault(f"{arm}_arm", {})[joint] = zero
            of_zeros.append(h.name)
        if names := NUMBERS_OF.get(h.effect.family):
            values = h.form.parameters(first, h.shape, amplitudes)
            of_effect = {names[key]: value for key, value in values.items() if key in names}
            if beyond := find_beyond(of_effect):
                refused.append(Advice(h.name, beyond))
                continue
            numbers |= of_effect
            turn = _differentiate(h, amplitudes, first, names)
            known.append((tuple(of_effect), turn @ covariance @ turn.T))
            of_numbers.append(h.name)
    sources = tuple((t.recording.source, t.recording.sha256) for t in trials)
    return Recalibration(
        first.recording.camera,
        tuple(transforms),
        tuple(statements),
        sources,
        numbers,
        tuple(known),
        tuple(of_numbers),
        tuple(refused),
        zeros,
        tuple(of_zeros),
    )


def _differentiate(
    h: Hypothesis, amplitudes: np.ndarray, trial: ImageTrial, names: Mapping[str, str]
) -> np.ndarray:
    """How the numbers of a correction change with the amplitudes (N, A), by central differences."""

    def at(values: np.ndarray) -> np.ndarray:
        found = h.form.parameters(trial, h.shape, values)
        return np.array([value for key, value in found.items() if key in names])

    step = 1e-4 * np.maximum(np.abs(amplitudes), 1e-3)
    ends = [(at(amplitudes + move), at(amplitudes - move)) for move in np.diag(step)]
    return np.stack([above - below for above, below in ends], axis=1) / (2.0 * step)


def _transform(
    h: Hypothesis, amplitudes: np.ndarray, covariance: np.ndarray, trial: ImageTrial
) -> CorrectedTransform:
    recording = trial.recording
    bases = recording.camera_base_in_world.inverse() @ recording.tool_base_in_world
    stated = {"hand_eye": recording.camera_in_flange, "base_to_base": bases}[h.effect.family]
    name, calibration = TRANSFORMS[h.effect.family]
    turn = np.eye(6)
    turn[:3, :3] = stated.rotation  # the small transform's translation is along the child's axes
    found = Pose.from_matrix(stated.matrix() @ rigid.exp(amplitudes)[0])
    return CorrectedTransform(
        h.name, name, stated, found, turn @ covariance @ turn.T, calibration=calibration
    )


def _statement(h: Hypothesis, amplitudes: np.ndarray, trial: ImageTrial) -> str:
    values = h.form.parameters(trial, h.shape, amplitudes)
    family, (kind, _, name) = h.effect.family, h.place.partition(":")
    if family == "depth_scale":
        a, b = values.get("a", 0.0), values.get("b", 0.0)
        return f"divide depth by {1.0 + a:.5f} after taking {b:.5f} m off it"
    if family == "camera_latency":
        return f"shift the camera's stamps by {-values['T']:.4f} s"
    if family == "clock_offset":
        return f"shift {name}'s stamps by {-values['o']:.4f} s"
    if family == "encoder_offset":
        return f"subtract {values['e']:.6f} rad from what {name} reads"
    if family == "object_geometry":
        return f"scale the mesh of {name} by {1.0 + values['s']:.5f}"
    if family == "intrinsics":
        k = trial.recording.intrinsics
        fx, fy = k.fx * (1.0 + values.get("fx", 0.0)), k.fy * (1.0 + values.get("fy", 0.0))
        cx, cy = k.cx + k.width * values.get("cx", 0.0), k.cy + k.height * values.get("cy", 0.0)
        return f"state fx {fx:.3f}, fy {fy:.3f}, cx {cx - 0.5:.3f}, cy {cy - 0.5:.3f} px in camera_info"
    listed = ", ".join(f"{n} {v:.5f}" for n, v in values.items())
    return f"set {listed} of {kind} {name}" if name else f"set {listed} of the {kind}"
