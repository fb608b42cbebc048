"""Constants of a chain that nobody stated, from the poses themselves.

One unknown is an average; two that frame the chain, A X = Y B, have a closed form in the singular vectors of
the rotations' Kronecker products (Shah 2013, Solving the robot-world/hand-eye calibration problem using the
Kronecker product, J. Mechanisms Robotics 5). Both are refined by least squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose_recording import PoseRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.poses import rigid
from samrl_core.diagnosis.residuals.poses.chain import Chain, Constants, track_rate

LENGTH_PER_RADIAN = 0.3  # [m] by which residuals of both kinds are made alike
WEIGHT = np.array([1.0] * 3 + [LENGTH_PER_RADIAN] * 3)  # of a twist
MOST_POSES = 400  # of a recording, that are solved with
LONGEST_OFFSET_S = 2.0  # between clocks that is looked for
FINE_OFFSET_S = 0.001
RATE_STEP_S = 1e-4  # over which the twist per second of clock offset is taken
AGREE_RAD = 0.05  # by which target and arm may turn otherwise between two views
LEAST_AGREEING = 8  # views that agree, from which on the others are left out
NEARLY_ALL = 0.9  # of the views: the few others are for the robust fit
GROSS_M, GROSS_RAD = 0.5, 1.0  # median residuals beyond which a description is wrong, not a calibration


def solved(recordings: Sequence[PoseRecording]) -> tuple[Constants, list[str]]:
    """Constants for all recordings, the unknown ones solved for; with notes of what was solved.

    Raises:
        InputError: more is unknown than poses can tell.
    """
    stated = Constants.stated(recordings[0])
    if not stated.free:
        return stated, []
    recordings = [_agreeing(r, stated) for r in recordings]
    chains = [Chain(r, stated) for r in recordings]
    offset = _turning_offset(chains[0])
    first = _closed_form(chains, stated, offset)
    constants = _refined(recordings, first, offset)
    one = recordings[0]
    names = {
        "camera": "camera_in_flange" if one.camera_arm is not None else "camera_in_base",
        "base": "base_in_base" if one.tool_arm is not None else "target_in_base",
        "target": "target_in_flange",
    }
    notes = []
    for name in sorted(stated.free):
        matrix = getattr(constants, name)
        q = Rotation.from_matrix(matrix[:3, :3]).as_quat()
        notes.append(
            f"{names[name]} is not stated; from the poses, all else as stated, it is position"
            f" {np.round(matrix[:3, 3], 5).tolist()} m, quaternion {np.round(q, 5).tolist()} (xyzw)"
        )
    return constants, notes


def check_stated(recording: PoseRecording, twist: np.ndarray, predicted: np.ndarray) -> None:
    """Refuse a description that no error of a calibration and of the target's size explains.

    Args:
        recording: of the poses.
        twist: (N, 6) residuals, referred to the target.
        predicted: (N, 3) positions of the target in the camera [m].

    Raises:
        InputError: with what the poses themselves give.
    """
    far, turned = (float(np.median(np.linalg.norm(part, axis=1))) for part in (twist[:, :3], twist[:, 3:]))
    share = float(np.sum(twist[:, :3] * predicted)) / max(float(np.sum(predicted**2)), 1e-12)
    of_another_size = float(np.median(np.linalg.norm(twist[:, :3] - share * predicted, axis=1)))
    if min(far, of_another_size) < GROSS_M and turned < GROSS_RAD:
        return
    unknown = replace(recording, camera_in_flange=None, base_in_base=None)
    if recording.tool_arm is not None and recording.camera_arm is None:
        unknown = replace(recording, camera_in_flange=None, target_in_flange=None)
    given = "; ".join(solved([unknown])[1])
    raise InputError(
        f"{recording.name}: the stated transforms miss the seen poses by {far:.2f} m and {turned:.2f} rad"
        f" (median; limits {GROSS_M:g} m, {GROSS_RAD:g} rad): no calibration is off by so much."
        f" Look for an inverse, a unit, the order of a quaternion. Left out, {given}"
    )


def agreeing_views(chain: Chain) -> np.ndarray:
    """(N,) bool, the largest set of views whose turns are the arm's; all where nearly all are.

    Between two views target and arm turn by one angle, whoever carries the camera (Tsai and Lenz 1989). A
    board that is taken for itself turned by half, or a small tag that flips, breaks that in many views at
    once, more than robust least squares stand. Of two moving arms, and while all moves, nothing is told.
    """
    count = len(chain.time)
    moving = [side for side in (0, 1) if chain.arms[side] is not None]
    if chain.recording.timed or len(moving) != 1 or not LEAST_AGREEING <= count <= MOST_POSES:
        return np.ones(count, dtype=bool)
    apart = np.abs(_all_turns(chain.seen) - _all_turns(chain.flange(moving[0], 0.0)))
    fit = apart < AGREE_RAD
    keep = np.ones(count, dtype=bool)
    while keep.sum() >= max(LEAST_AGREEING, 0.5 * count):
        friends = np.where(keep, (fit & keep).sum(axis=1), count)
        if friends.min() >= NEARLY_ALL * keep.sum():
            break
        keep[int(np.argmin(friends))] = False
    enough = keep.sum() >= max(LEAST_AGREEING, 0.5 * count)
    return keep if enough and keep.sum() < NEARLY_ALL * count else np.ones(count, dtype=bool)


def _all_turns(poses: np.ndarray) -> np.ndarray:
    """Angles [rad] (N, N) between each two of (N, 4, 4)."""
    trace = np.einsum("nij,mij->nm", poses[:, :3, :3], poses[:, :3, :3])
    return np.asarray(np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0)))


def _agreeing(recording: PoseRecording, stated: Constants) -> PoseRecording:
    """The recording without views whose turns are not the arm's."""
    chain = Chain(recording, stated)
    keep = np.isin(recording.seen.time, chain.time[agreeing_views(chain)])
    if keep.sum() == len(chain.time):
        return recording
    seen = recording.seen
    return replace(recording, seen=type(seen)(seen.time[keep], seen.position[keep], seen.quat_xyzw[keep]))


def _turning_offset(chain: Chain) -> float:
    """Time [s] by which the only arm's stamps must be shifted so that both turn at the same rates."""
    moving = [side for side in (0, 1) if chain.arms[side] is not None]
    if not chain.recording.timed or len(moving) != 1 or len(chain.time) < 30:
        return 0.0
    step = float(np.median(np.diff(chain.time)))
    grid = np.arange(chain.time[0], chain.time[-1], step)
    seen = rigid.Interpolated(chain.recording.seen).at(grid)
    arm = chain.arms[moving[0]]
    assert arm is not None

    def turning(poses: np.ndarray) -> np.ndarray:
        between = Rotation.from_matrix(np.swapaxes(poses[:-1, :3, :3], 1, 2) @ poses[1:, :3, :3])
        return between.magnitude()

    camera = turning(seen)
    if float(np.std(camera)) < 1e-4:
        return 0.0
    most = min(LONGEST_OFFSET_S, 0.2 * (grid[-1] - grid[0]))
    stamps = np.arange(grid[0] - most, grid[-1] + most + 2.0 * step, step)
    turned = turning(arm.at(stamps))  # between a stamp and the next

    def rough_mismatch(offset: float) -> float:
        return float(np.mean((np.interp(grid[:-1] + offset, stamps[:-1], turned) - camera) ** 2))

    def mismatch(offset: float) -> float:
        return float(np.mean((turning(arm.at(grid + offset)) - camera) ** 2))

    best = min(np.arange(-most, most + step, max(step, 0.01)), key=rough_mismatch)
    return float(min(np.arange(best - 0.012, best + 0.012, FINE_OFFSET_S), key=mismatch))


def _closed_form(chains: Sequence[Chain], stated: Constants, offset: float) -> Constants:
    """First guess of the unknown constants."""
    camera_flange = np.concatenate([c.flange(0, offset if c.arms[0] is not None else 0.0) for c in chains])
    tool_flange = np.concatenate([c.flange(1, offset if c.arms[1] is not None else 0.0) for c in chains])
    seen = np.concatenate([c.seen for c in chains])
    free = stated.free
    if free == {"camera", "base"}:
        x, y = _two_sided(camera_flange, tool_flange @ stated.target @ rigid.inverse(seen))
        return Constants(x, y, stated.target, free)
    if free == {"base", "target"}:
        x, y = _two_sided(tool_flange, rigid.inverse(camera_flange @ stated.camera @ seen))
        return Constants(stated.camera, rigid.inverse(y), x, free)
    if free == {"camera", "target"} and chains[0].arms[0] is None:
        x, y = _two_sided(tool_flange, seen)
        return Constants(y, np.eye(4), x, free)
    if free == {"camera"}:
        found = rigid.inverse(camera_flange) @ stated.base @ tool_flange @ stated.target @ rigid.inverse(seen)
        return Constants(average(found), stated.base, stated.target, free)
    if free == {"base"}:
        found = camera_flange @ stated.camera @ seen @ rigid.inverse(tool_flange @ stated.target)
        return Constants(stated.camera, average(found), stated.target, free)
    if free == {"target"}:
        found = rigid.inverse(stated.base @ tool_flange) @ camera_flange @ stated.camera @ seen
        return Constants(stated.camera, stated.base, average(found), free)
    raise InputError(
        f"the transforms {sorted(free)} are all unknown; with both arms moving, state camera_in_flange or"
        " target_in_flange, and base_in_base if neither frames the chain"
    )


def _two_sided(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """X and Y (4, 4) of A X = Y B for stacks A and B (N, 4, 4)."""
    ra, rb = a[:, :3, :3], b[:, :3, :3]
    kron = np.einsum("nij,nkl->ikjl", ra, rb).reshape(9, 9)
    u, _, vt = np.linalg.svd(kron)
    x, y = _nearest_rotation(vt[0].reshape(3, 3)), _nearest_rotation(u[:, 0].reshape(3, 3))
    left = np.concatenate([np.concatenate([-r, np.eye(3)], axis=1) for r in ra])
    right = (a[:, :3, 3] - np.einsum("ij,nj->ni", y, b[:, :3, 3])).reshape(-1)
    moved, *_ = np.linalg.lstsq(left, right, rcond=None)
    out = np.eye(4), np.eye(4)
    out[0][:3, :3], out[0][:3, 3] = x, moved[:3]
    out[1][:3, :3], out[1][:3, 3] = y, moved[3:]
    return out


def _nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    matrix = matrix * np.sign(np.linalg.det(matrix))
    u, _, vt = np.linalg.svd(matrix)
    return u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt


def average(matrices: np.ndarray) -> np.ndarray:
    """Mean rigid transform of a stack: rotations by their chordal mean, positions by the median."""
    out = np.eye(4)
    out[:3, :3] = Rotation.from_matrix(matrices[:, :3, :3]).mean().as_matrix()
    out[:3, 3] = np.median(matrices[:, :3, 3], axis=0)
    return out


def _refined(recordings: Sequence[PoseRecording], first: Constants, offset: float) -> Constants:
    """Least squares over the unknown constants and, where stamps tell, the offset of the clocks."""
    free = sorted(first.free)
    chains = [Chain(_thinner(r), first) for r in recordings]
    timed = recordings[0].timed and track_rate(recordings[0].seen) > 2.0

    def constants(values: np.ndarray) -> Constants:
        moved = {name: getattr(first, name) for name in ("camera", "base", "target")}
        for k, name in enumerate(free):
            moved[name] = moved[name] @ rigid.exp(values[6 * k : 6 * k + 6])[0]
        return Constants(**moved, free=first.free)

    def moved_to(values: np.ndarray) -> float:
        at = constants(values)
        for chain in chains:
            chain.constants = at
        return offset + (float(values[-1]) if timed else 0.0)

    def twists(chain: Chain, shift: float) -> np.ndarray:
        return rigid.log(chain.seen @ rigid.inverse(chain.predicted((shift, shift))))

    def residual(values: np.ndarray) -> np.ndarray:
        shift = moved_to(values)
        return np.concatenate([(twists(chain, shift) * WEIGHT).reshape(-1) for chain in chains])

    def jacobian(values: np.ndarray) -> np.ndarray:
        shift = moved_to(values)
        of_step = [
            np.linalg.inv(rigid.inverse_jacobian(v)[0]) for v in values[: 6 * len(free)].reshape(-1, 6)
        ]
        parts = []
        for chain in chains:
            errors = chain.error_twists((shift, shift))
            columns = [np.moveaxis(errors[name], 0, 2) @ of_step[k] for k, name in enumerate(free)]
            if timed:
                ahead, behind = (chain.predicted((s, s)) for s in (shift + RATE_STEP_S, shift - RATE_STEP_S))
                columns.append(rigid.log(ahead @ rigid.inverse(behind))[..., None] / (2.0 * RATE_STEP_S))
            of_error = -rigid.inverse_jacobian(twists(chain, shift)) @ np.concatenate(columns, axis=2)
            parts.append((of_error * WEIGHT[:, None]).reshape(-1, len(values)))
        return np.concatenate(parts)

    start = np.zeros(6 * len(free) + (1 if timed else 0))
    found = least_squares(
        residual, start, jacobian, loss="soft_l1", f_scale=0.005, x_scale="jac", max_nfev=40
    )
    return constants(found.x)


def _thinner(recording: PoseRecording) -> PoseRecording:
    every = max(1, len(recording.seen) // MOST_POSES)
    seen = recording.seen
    track = type(seen)(seen.time[::every], seen.position[::every], seen.quat_xyzw[::every])
    return replace(recording, seen=track)


def closing_error(recording: PoseRecording) -> float:
    """How far the chain stays open with the best constants and clock offset [m], median over the poses.

    Turns count with `LENGTH_PER_RADIAN`. Millimetres where the description is right, decimetres where an
    inverse, a unit, the order of a quaternion or who carries the camera is not.

    Raises:
        InputError: as `solved`.
    """
    constants, _ = solved([recording])
    chain = Chain(_thinner(recording), constants)
    longest = 0.2 * (chain.time[-1] - chain.time[0]) if recording.timed else 0.0
    tried = np.arange(-LONGEST_OFFSET_S, LONGEST_OFFSET_S, 0.02) if recording.timed else np.zeros(1)
    apart = chain.seen @ rigid.inverse(chain.predicted_each(tried[np.abs(tried) <= longest]))
    twist = rigid.log(apart.reshape(-1, 4, 4)) * WEIGHT
    sizes = np.linalg.norm(twist, axis=1).reshape(apart.shape[:2])
    return float(np.median(sizes, axis=1).min())
