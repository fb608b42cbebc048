"""What a diagnosis found a cell to differ by from its description, put right where its sensors come in.

Poses change the calibration that is announced. Zeros of encoders change joint readings and commands where a
driver's come in and go out: the cell's arms stay as described, and a simulated cell's truth is not touched.
Depth and lens change the images themselves: depth is converted, and images are resampled to the described
pinhole, so that model, networks and bags stay of one camera. A covariance says how well the corrections are
known; `seen_error` says what that means at a place.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.observation import ArmCommand, ArmReading, Frame
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole
from samrl_core.common.text_files import parse_json, read_text

SCHEMA = 1
KIND = "cell_correction"
POSES = ("camera_in_flange", "tool_base_in_camera_base")
NUMBERS = {  # largest size that is still a camera of the kind that was described
    "depth_scale": 0.2, "depth_offset": 0.1, "fx": 0.3, "fy": 0.3, "cx": 0.2, "cy": 0.2,
    "k1": 1.0, "k2": 1.0, "p1": 0.05, "p2": 0.05,
}  # fmt: skip
LENS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
ENCODER_ZERO = 0.1  # largest zero error of a joint that is corrected [rad]
ARMS = ("camera_arm", "tool_arm")
TWIST = ("x", "y", "z", "rx", "ry", "rz")  # of a pose: position in its parent's axes, rotation in its own


def twist_names(pose: str) -> tuple[str, ...]:
    """Names of a pose's six coordinates in a covariance."""
    return tuple(f"{pose}.{axis}" for axis in TWIST)


@dataclass(frozen=True, eq=False)
class CorrectionCovariance:
    """How well the numbers of a correction are known; what is left out counts as exact.

    Raises:
        InputError: a matrix of another shape, not finite, not symmetric, or with a negative variance.
    """

    of: tuple[str, ...]  # of `twist_names` and `NUMBERS`
    matrix: np.ndarray  # (K, K) [m], [rad] and the units of `CellCorrection.numbers`

    def __post_init__(self) -> None:
        matrix, count, names = np.array(self.matrix, dtype=np.float64), len(self.of), ", ".join(self.of)
        if matrix.shape != (count, count) or len(set(self.of)) != count:
            raise InputError(
                f"covariance of {count} numbers ({names}) has shape {matrix.shape}, not {count}x{count}"
            )
        deviation = np.sqrt(np.abs(np.diag(matrix)))
        unit = matrix / np.maximum(np.outer(deviation, deviation), 1e-300)  # units of the rows differ
        if not np.isfinite(matrix).all() or not np.allclose(unit, unit.T, atol=1e-6):
            raise InputError(f"covariance of {names} must be finite and symmetric")
        if count and min(np.diag(matrix).min(), np.linalg.eigvalsh(unit).min() + 1e-6) < 0.0:
            raise InputError(f"covariance of {names} has a negative variance; let --apply write it anew")
        matrix.setflags(write=False)
        object.__setattr__(self, "matrix", matrix)

    @cached_property
    def factor(self) -> np.ndarray:
        """(K, K) F with F F' the matrix; what rounding leaves below zero is zero."""
        variances, axes = np.linalg.eigh(self.matrix)
        return axes * np.sqrt(np.maximum(variances, 0.0))

    @staticmethod
    def of_blocks(blocks: Iterable[tuple[Sequence[str], np.ndarray]]) -> CorrectionCovariance:
        """Of groups of numbers that were found one beside the other; a later group takes the place of what an
        earlier one has of the same name.
        """
        found = [(tuple(names), np.asarray(matrix, dtype=np.float64)) for names, matrix in blocks]
        of = tuple(dict.fromkeys(name for names, _ in found for name in names))
        whole = np.zeros((len(of), len(of)))
        for names, matrix in found:
            rows = [of.index(name) for name in names]
            whole[rows, :], whole[:, rows] = 0.0, 0.0
            whole[np.ix_(rows, rows)] = matrix
        return CorrectionCovariance(of, whole)


EXACT = CorrectionCovariance((), np.zeros((0, 0)))


@dataclass(frozen=True, eq=False)
class CellCorrection:
    """Corrections of a cell; what is left out is as described.

    Numbers by name: a depth reading is (1 + `depth_scale`) z + `depth_offset` [m]; `fx` and `fy` are by
    which share the true focal lengths are longer, `cx` and `cy` by which share of width and height the
    principal point lies further; `k1`, `k2`, `p1`, `p2` are Brown's.

    Zeros of encoders by role and joint: what the joint reads less what it is [rad]. How well they are known
    is not part of the covariance.

    Raises:
        InputError: an unknown number or arm, or a number that is not finite, beyond `NUMBERS` or beyond
            `ENCODER_ZERO`.
    """

    camera_in_flange: Pose | None = None
    tool_base_in_camera_base: Pose | None = None
    numbers: Mapping[str, float] = field(default_factory=dict[str, float])
    effects: tuple[str, ...] = ()  # `family@place` that they come from
    covariance: CorrectionCovariance = EXACT
    encoder_zeros: Mapping[str, Mapping[str, float]] = field(default_factory=dict[str, Mapping[str, float]])

    def __post_init__(self) -> None:
        for name in self.numbers:
            if name not in NUMBERS:
                raise InputError(f"a cell has no {name!r} to correct; it has {', '.join(NUMBERS)}")
        if beyond := find_beyond(self.numbers):
            raise InputError(beyond)
        _check_zeros(self.encoder_zeros)
        poses = [name for name in POSES if getattr(self, name) is not None]
        corrected = {*self.numbers, *(one for pose in poses for one in twist_names(pose))}
        if foreign := [name for name in self.covariance.of if name not in corrected]:
            raise InputError(f"covariance of {foreign[0]!r}, which is not corrected; leave it out")

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to correct."""
        poses = self.camera_in_flange or self.tool_base_in_camera_base
        return not (self.numbers or poses or self.encoder_zeros)

    def cell(self, cell: CellSpec) -> CellSpec:
        """The cell with its camera and the camera arm's base where they were found.

        The tool arm's base stays: it is the world's origin in every task.
        """
        if self.camera_in_flange is not None:
            cell = replace(cell, camera_in_flange=self.camera_in_flange)
        if self.tool_base_in_camera_base is not None:
            base = cell.tool_base_in_world @ self.tool_base_in_camera_base.inverse()
            cell = replace(cell, camera_base_in_world=base)
        return cell

    def require_joints(self, cell: CellSpec) -> None:
        """Check that the cell has the joints whose zeros are corrected.

        Raises:
            InputError: an arm lacks one; names it and those that are there.
        """
        for role, of_arm in self.encoder_zeros.items():
            names = cell.arm(role).joint_names
            if missing := [name for name in of_arm if name not in names]:
                raise InputError(
                    f"the correction has a zero of joint {missing[0]}, the {role} of {cell.name} has "
                    f"{', '.join(names)}; use the correction of this cell"
                )

    def reading(self, reading: ArmReading, names: Sequence[str], role: str) -> ArmReading:
        """An arm's reading, joints in the order of `names`, as encoders without zero errors give it."""
        zeros = self.zeros(names, role)
        return replace(reading, position=reading.position - zeros) if zeros.any() else reading

    def command(self, command: ArmCommand, names: Sequence[str], role: str) -> ArmCommand:
        """What an arm's driver is to be sent so that the arm, and not its reading, follows the command."""
        zeros = self.zeros(names, role)
        return replace(command, position=command.position + zeros) if zeros.any() else command

    def zeros(self, names: Sequence[str], role: str) -> np.ndarray:
        """What the joints of an arm read too much (J,) [rad], in the order of `names`."""
        of_arm = self.encoder_zeros.get(role, {})
        return np.array([of_arm.get(name, 0.0) for name in names])

    def frame(self, frame: Frame, intrinsics: Intrinsics) -> Frame:
        """A frame as the described camera would have given it; pixels that it did not see have no depth.

        Args:
            frame: of the true camera.
            intrinsics: of the described one.
        """
        if not self.numbers:
            return frame
        color, depth, mask = frame.color, frame.depth, frame.mask
        if any(name in self.numbers for name in LENS):
            seen = self._find_places(intrinsics)
            color = cv2.remap(color, seen.x, seen.y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            depth = np.where(seen.inside, depth[seen.row, seen.column], np.float32(np.nan))
            mask = np.where(seen.inside, mask[seen.row, seen.column], np.uint8(0))
        offset, slope = self.numbers.get("depth_offset", 0.0), 1.0 + self.numbers.get("depth_scale", 0.0)
        depth = ((depth - offset) / slope).astype(np.float32)
        return Frame(frame.stamp_ns, color, depth, mask)

    def _find_places(self, k: Intrinsics) -> LensPlaces:
        if self._lenses.get(k) is None:
            self._lenses[k] = find_lens_places(self.numbers, k)
        return self._lenses[k]

    @cached_property
    def _lenses(self) -> dict[Intrinsics, LensPlaces]:
        return {}


def _check_zeros(zeros: Mapping[str, Mapping[str, float]]) -> None:
    for role, of_arm in zeros.items():
        if role not in ARMS:
            raise InputError(f"a cell has no arm {role!r} whose zeros to correct; it has {', '.join(ARMS)}")
        for joint, zero in of_arm.items():
            if not (math.isfinite(zero) and abs(zero) <= ENCODER_ZERO):
                raise InputError(
                    f"zero of {joint} is {zero:g} rad, must be within +-{ENCODER_ZERO:g} rad; beyond that "
                    "set the joint's zero in its drive"
                )


def find_beyond(numbers: Mapping[str, float]) -> str:
    """Which of the numbers is not finite or beyond `NUMBERS`, and what that means; empty if none is."""
    for name, value in numbers.items():
        if not (math.isfinite(value) and abs(value) <= NUMBERS[name]):
            return (
                f"{name} is {value:g}, must be within +-{NUMBERS[name]:g}: beyond that the camera is "
                "another one than described; describe it anew"
            )
    return ""


@dataclass(frozen=True, eq=False)
class LensPlaces:
    """Where the true lens has what a pixel of the described camera looks at; all (H, W)."""

    x: np.ndarray  # float32, counted from the middle of the first pixel [px]
    y: np.ndarray
    row: np.ndarray  # nearest, within the image
    column: np.ndarray
    inside: np.ndarray  # bool: within the image, and no image of a ray that the lens folds back


def find_lens_places(numbers: Mapping[str, float], k: Intrinsics) -> LensPlaces:
    """Of a lens that differs from a described pinhole by the numbers of `LENS`; what is left out is zero."""
    of = {name: numbers.get(name, 0.0) for name in LENS}
    u, v = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
    rays = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones_like(u)], axis=-1).reshape(-1, 1, 3)
    matrix = np.array(
        [
            [k.fx * (1.0 + of["fx"]), 0.0, k.cx + k.width * of["cx"] - 0.5],
            [0.0, k.fy * (1.0 + of["fy"]), k.cy + k.height * of["cy"] - 0.5],
            [0.0, 0.0, 1.0],
        ]
    )
    zero, brown = np.zeros(3), np.array([of[name] for name in ("k1", "k2", "p1", "p2")])
    pixels = cv2.projectPoints(rays, zero, zero, matrix, brown)[0].reshape(k.height, k.width, 2)
    x, y = pixels[..., 0].astype(np.float32), pixels[..., 1].astype(np.float32)
    column, row = np.rint(x).astype(np.intp), np.rint(y).astype(np.intp)
    inside = (column >= 0) & (column < k.width) & (row >= 0) & (row < k.height)
    inside &= _is_before_fold(of["k1"], of["k2"], (rays[..., :2] ** 2).sum(axis=-1).reshape(inside.shape))
    return LensPlaces(x, y, np.clip(row, 0, k.height - 1), np.clip(column, 0, k.width - 1), inside)


def _is_before_fold(k1: float, k2: float, square: np.ndarray) -> np.ndarray:
    """Where the radius in the image, r (1 + k1 r^2 + k2 r^4), has grown all the way to a ray's r^2.

    Beyond its first maximum Brown's polynomial comes back and would show the inner image once more.
    """
    slope = np.polynomial.Polynomial([1.0, 3.0 * k1, 5.0 * k2])  # of r^2
    turns = [root.real for root in slope.roots() if abs(root.imag) < 1e-12 and root.real > 0.0]
    return square < min(turns, default=math.inf)


NO_CORRECTION = CellCorrection()


def as_data(correction: CellCorrection) -> dict[str, Any]:
    """For JSON; `correction_from` reads it."""
    data: dict[str, Any] = {"schema": SCHEMA, "kind": KIND, "effects": list(correction.effects)}
    for name in POSES:
        pose = getattr(correction, name)
        if pose is not None:
            data[name] = {"position": pose.position.tolist(), "quat_xyzw": pose.quat_xyzw.tolist()}
    data["numbers"] = dict(correction.numbers)
    if correction.encoder_zeros:
        data["encoder_zeros"] = {role: dict(of_arm) for role, of_arm in correction.encoder_zeros.items()}
    if (known := correction.covariance).of:
        data["covariance"] = {"of": list(known.of), "matrix": known.matrix.tolist()}
    return data


def correction_from(data: Any, where: str) -> CellCorrection:
    """What `as_data` wrote.

    Raises:
        InputError: another kind of data, or a pose or number that cannot be used; names `where`.
    """
    if not isinstance(data, dict) or data.get("kind") != KIND or data.get("schema") != SCHEMA:
        raise InputError(f"{where} is no correction of a cell; samrl diagnose --apply writes one, cell.json")
    numbers = data.get("numbers", {})
    if not isinstance(numbers, dict) or not all(isinstance(v, (int, float)) for v in numbers.values()):
        raise InputError(f"{where}: numbers are {numbers!r}, must be numbers by name")
    try:
        poses = {name: _pose(data[name]) for name in POSES if name in data}
        effects = tuple(str(name) for name in data.get("effects", ()))
        covariance = _covariance(data["covariance"]) if "covariance" in data else EXACT
        values = {name: float(value) for name, value in numbers.items()}
        zeros = {
            str(role): {str(joint): float(zero) for joint, zero in of_arm.items()}
            for role, of_arm in data.get("encoder_zeros", {}).items()
        }
        return CellCorrection(
            **poses, numbers=values, effects=effects, covariance=covariance, encoder_zeros=zeros
        )
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
        what = "a pose, a zero or the covariance"
        raise InputError(f"{where}: {what} cannot be read ({error!r}); let --apply write it anew") from error


def write_correction(path: Path, correction: CellCorrection) -> None:
    """Write the file that `read_correction` reads."""
    write_whole(path, json.dumps(as_data(correction), indent=1, allow_nan=False) + "\n")


def read_correction(path: Path) -> CellCorrection:
    """The correction of a file, as `samrl diagnose --apply` writes it.

    Raises:
        InputError: no such file, or as `correction_from`.
    """
    return correction_from(parse_json(read_text(path, "the cell's correction"), str(path)), str(path))


def correction_of(file: str) -> CellCorrection:
    """The correction of a file by its name, none for an empty one. Raises InputError as `read_correction`."""
    return read_correction(Path(file)) if file else NO_CORRECTION


def _pose(entry: Any) -> Pose:
    return Pose(np.array(entry["position"], dtype=float), np.array(entry["quat_xyzw"], dtype=float))


def _covariance(entry: Any) -> CorrectionCovariance:
    return CorrectionCovariance(tuple(map(str, entry["of"])), np.array(entry["matrix"], dtype=float))
