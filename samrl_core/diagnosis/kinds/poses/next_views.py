"""The recording of poses that would split an ambiguity set, or the sentence that none does.

Candidate motions are simulated with the solved or stated chain, and judged as an arm's trajectories are:
by the log evidence that is left when the wrong effect is fitted to what the right one would do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose import look_at
from samrl_core.cell.types.pose_recording import ArmPoses, PoseRecording, PoseTrack
from samrl_core.diagnosis.findings.discrimination import (
    FILE,
    Rivals,
    discrimination,
    find_rivals,
    separation,
)
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.poses import rigid
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial
from samrl_core.diagnosis.result import NextExperiment
from samrl_core.diagnosis.selection.hypothesis import Fit, hypothesis
from samrl_core.diagnosis.selection.twins import AS_MUCH, principal_angle

VIEWS = 12
DISTANCES_M = (0.27, 0.6)
# Of a view from the direction of the recorded ones, and about the optical axis.
ASIDE_RAD, ROLL_RAD = (0.6, 1.3)
SHAKE_RAD, SHAKE_HZ = 0.2, (0.5, 0.7, 0.9)  # per axis
SECONDS, RATE_HZ = 12.0, 30.0
MOTIONS = {
    "views": "twelve views of the target at rest, at 0.27 to 0.6 m and turned about the optical axis",
    "turns": "the target held at rest in twelve orientations, up to 35 degrees apart",
    "camera_arm": "the camera's arm turning about all axes at 0.5 to 0.9 Hz while the other stands still",
    "tool_arm": "the target's arm turning about all axes at 0.5 to 0.9 Hz while the camera stands still",
}


def next_views(
    likelihood: Likelihood, fits: Sequence[Fit], names: Sequence[str], seed: int
) -> tuple[NextExperiment | None, str]:
    """The motion in which the closest pair differs most; where none splits them, why."""
    trial = likelihood.trials[0]
    assert isinstance(trial, PoseTrial)
    rivals = find_rivals(fits, names)
    pair = " and ".join(names)
    if any(h.place.startswith(("joint:", "link:")) for h, _ in rivals.values()):
        return None, f"{pair}: poses that move each joint by itself may split them; none was simulated"
    scored = []
    for kind, recording in _candidates(trial, seed).items():
        made = PoseTrial(recording, trial.constants, trial.noise)
        scored.append((discrimination(made, rivals), kind, made))
    best, kind, made = max(scored, key=lambda s: s[0])
    if best < AS_MUCH:
        angle = max(_least_angle(s[2], rivals) for s in scored)
        tried = "; ".join(MOTIONS[k] for _, k, _ in scored)
        return None, (
            f"no recording of these devices splits {pair}: their columns stay {np.degrees(angle):.1f} degrees"
            f" apart at most (tried: {tried}); an outside measurement must"
        )
    why = f"{pair} would differ by {best:.0f} of log evidence in {MOTIONS[kind]}"
    content = {"schema": 1, "kind": "poses", "motion": kind, "why": why, **_plan(made.recording)}
    return NextExperiment(FILE, why, separation(best), content), ""


def _least_angle(trial: PoseTrial, rivals: Rivals) -> float:
    """Smallest angle [rad] between any two of the effects in a recording; 0 where one is not seen."""
    likelihood = Likelihood([trial])
    made = [hypothesis(likelihood, h.effect, h.form, h.shape) for h, _ in rivals.values()]
    there = [h for h in made if h is not None]
    if len(there) < len(made) or len(there) < 2:
        return 0.0
    pairs = [(a, b) for i, a in enumerate(there) for b in there[i + 1 :]]
    return min(principal_angle(likelihood, a, b) for a, b in pairs)


def _candidates(trial: PoseTrial, seed: int) -> dict[str, PoseRecording]:
    """Recordings without noise of the same devices in other motions."""
    recording, c, rng = trial.recording, trial.constants, np.random.default_rng(seed)
    camera_home, tool_home = trial.chain.flange(0)[0], trial.chain.flange(1)[0]
    out: dict[str, PoseRecording] = {}
    rest, time = 2.0 * np.arange(VIEWS), np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    if recording.camera_arm is not None:
        target = c.base @ tool_home @ c.target
        out["views"] = _moved(trial, rest, _views(trial, target, rng) @ np.linalg.inv(c.camera), tool_home)
        out["camera_arm"] = _moved(trial, time, camera_home @ _shaken(time), tool_home)
    if recording.tool_arm is not None:
        turned = Rotation.from_rotvec(rng.uniform(-ASIDE_RAD, ASIDE_RAD, (VIEWS, 3))).as_matrix()
        steps = np.tile(np.eye(4), (VIEWS, 1, 1))
        steps[:, :3, :3], steps[:, :3, 3] = turned, rng.uniform(-0.1, 0.1, (VIEWS, 3))
        out["turns"] = _moved(trial, rest, camera_home, tool_home @ steps)
        out["tool_arm"] = _moved(trial, time, camera_home, tool_home @ _shaken(time))
    return out


def _views(trial: PoseTrial, target: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Cameras (VIEWS, 4, 4) in the camera arm's base that look at the target from about where they did."""
    from_target = rigid.inverse(trial.chain.predicted())[:, :3, 3]
    front = target[:3, :3] @ np.mean(from_target, axis=0)
    front = front / np.linalg.norm(front)
    out = []
    for k in range(VIEWS):
        away = Rotation.from_rotvec(rng.uniform(-ASIDE_RAD, ASIDE_RAD, 3)).apply(front)
        away = away + [1e-3, 0.0, 0.0]  # never straight up
        distance = DISTANCES_M[0] + (DISTANCES_M[1] - DISTANCES_M[0]) * k / (VIEWS - 1)
        eye = target[:3, 3] + distance * away / np.linalg.norm(away)
        out.append(look_at(eye, target[:3, 3], float(rng.uniform(-ROLL_RAD, ROLL_RAD))).matrix())
    return np.array(out)


def _shaken(time: np.ndarray) -> np.ndarray:
    out = np.tile(np.eye(4), (len(time), 1, 1))
    angles = SHAKE_RAD * np.sin(2 * np.pi * np.outer(time, SHAKE_HZ))
    out[:, :3, :3] = Rotation.from_rotvec(angles).as_matrix()
    return out


def _moved(trial: PoseTrial, time: np.ndarray, camera: np.ndarray, tool: np.ndarray) -> PoseRecording:
    """What would be seen with the flanges at (N, 4, 4) or still at (4, 4)."""
    recording, c = trial.recording, trial.constants
    flanges = [np.broadcast_to(f, (len(time), 4, 4)) for f in (camera, tool)]
    seen = rigid.inverse(flanges[0] @ c.camera) @ c.base @ flanges[1] @ c.target
    arms = [
        None if arm is None else ArmPoses(arm.role, _track(time, flange))
        for arm, flange in zip((recording.camera_arm, recording.tool_arm), flanges, strict=True)
    ]
    timed = recording.timed and float(np.median(np.diff(time))) < 0.2
    return replace(
        recording, name="next", seen=_track(time, seen), camera_arm=arms[0], tool_arm=arms[1], timed=timed
    )


def _track(time: np.ndarray, poses: np.ndarray) -> PoseTrack:
    return PoseTrack(time, poses[:, :3, 3].copy(), Rotation.from_matrix(poses[:, :3, :3]).as_quat())


def _plan(recording: PoseRecording) -> dict[str, object]:
    """Flanges of the arms for a user's own controller: time, position, quaternion xyzw."""
    return {
        "at_rest": not recording.timed or float(np.median(np.diff(recording.seen.time))) > 1.0,
        "flanges": {arm.role: _rows(arm.flange) for arm in recording.arms if arm.flange is not None},
    }


def _rows(track: PoseTrack) -> list[list[float]]:
    table = np.column_stack([track.time, track.position, track.quat_xyzw])
    return np.round(table[:: 1 if len(table) <= VIEWS else 3], 4).tolist()
