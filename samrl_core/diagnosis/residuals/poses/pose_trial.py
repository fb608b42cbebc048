"""A pose recording as the effects see it: errors of the seen target, and what each link of the chain does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from samrl_core.cell.types.pose_recording import PoseRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.phases import REST, phases_of_speed
from samrl_core.diagnosis.residuals.poses import rigid
from samrl_core.diagnosis.residuals.poses.chain import Chain, Constants, track_rate
from samrl_core.diagnosis.residuals.poses.corner_noise import find_square
from samrl_core.diagnosis.residuals.poses.noise import (
    LEAST_STEPS,
    DetectorNoise,
    distance_of,
    find_apart,
    find_change,
    find_tour,
    growth_power,
    leftover,
    noise_level,
    rounding,
    slow_level,
    stamp_jitter,
)

CHANNELS = ("position_x", "position_y", "position_z", "rotation_x", "rotation_y", "rotation_z")
UNITS = {name: "m" if name.startswith("position") else "rad" for name in CHANNELS}
LEAST_POSES = 6
TIMING_RATE_HZ = 5.0  # below it poses are no motion: nothing is said of clocks
RATE_STEP_S = 0.01  # of the difference that gives a rate
END_S, END_SHARE = 0.5, 0.05  # of a recording at either end of an arm's track, the less of the two
LEFT_OUT = 1e3  # times the noise: as good as left out
MOST_AT_REST = 2000  # views, of which the nearest are sought: more are nobody's calibration
JITTER_ROUNDS = 3  # of a level without it, and it beside that level
LEVER_M = 0.5  # at which a translation of 1 m/s counts as 2 rad/s, for phases
# Standard deviations of what the noise estimate lets be off: beyond the catalogue's ranges.
TRANSLATION, ROTATION, SIZE, ZERO, CLOCK = 0.03, 0.05, 0.05, 0.02, 0.1
OFFSETS_S = np.array(
    [0.0, *(s * t for t in (0.004, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64) for s in (1, -1))]
)


class PoseTrial(Observed):
    """Left twists of the target in the camera, seen against predicted, referred to the target's origin."""

    kind = "poses"
    exact = True

    def __init__(
        self,
        recording: PoseRecording,
        constants: Constants,
        noise: DetectorNoise | None = None,
        like: DetectorNoise | None = None,
        few: bool = False,
    ) -> None:
        """Form the residuals at the given constants, with `noise` or the recording's own.

        `like` is the noise of more poses of the same detector, which tell how it grows with the distance. Of
        `few` views at rest the constants that noise is estimated around take up most of it: it is no less.

        Raises:
            InputError: fewer than `LEAST_POSES` poses.
        """
        if len(recording.seen) < LEAST_POSES:
            raise InputError(
                f"{recording.name} has {len(recording.seen)} seen poses, at least {LEAST_POSES} are needed"
            )
        self.recording, self.constants = recording, constants
        self.chain = Chain(recording, constants)
        self.channels = CHANNELS
        self.cached: dict[tuple[str, str], Any] = {}
        self.views = self.chain.predicted()  # of the target, (N, 4, 4) in the camera
        self.seen_position = self.views[:, :3, 3]
        self.twist = rigid.log(self.chain.seen @ rigid.inverse(self.views))
        self._residual = self.at_target(self.twist)
        self.shows_time = (
            recording.timed
            and track_rate(recording.seen) >= TIMING_RATE_HZ
            and all(_rate(a.stamps) >= TIMING_RATE_HZ for a in recording.arms)
        )
        if noise is None:
            self.noise, self._sigma, apart = self._noise(like, few)
        else:
            self.noise, self._sigma, apart = (
                noise,
                noise.at(self.views),
                np.zeros(len(self.views), dtype=bool),
            )
        self.outliers = int(np.count_nonzero(apart))
        self.moved = find_change(apart)  # begin and end of seen poses, all of which stand apart
        self._sigma[self._at_ends()] *= LEFT_OUT

    # -- what any recording tells ----------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Of the recording."""
        return self.recording.name

    @property
    def places(self) -> tuple[str, ...]:
        """The camera."""
        return (f"sensor:{self.recording.camera}",)

    @property
    def units(self) -> Mapping[str, str]:
        """Metres and radians."""
        return UNITS

    @property
    def residual(self) -> Mapping[str, np.ndarray]:
        """Per channel (N, 1)."""
        return {name: self._residual[:, [k]] for k, name in enumerate(CHANNELS)}

    @cached_property
    def sigma(self) -> Mapping[str, np.ndarray]:
        """Per channel (N, 1)."""
        return {name: self._sigma[:, [k]] for k, name in enumerate(CHANNELS)}

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.recording.duration

    def elapsed(self, channel: str) -> np.ndarray:
        """Times (N,) since the first seen pose [s]."""
        return self.chain.time - self.chain.time[0]

    def phases(self, channel: str) -> np.ndarray:
        """Rest, slow or fast (N, 1), by how fast the target turns and moves in the camera."""
        if not self.shows_time:
            return np.full((len(self.chain.time), 1), REST)
        return phases_of_speed(self.speed)[:, None]

    def drivers(self, channel: str, row: int) -> dict[str, np.ndarray]:
        """Where the target stood in the camera, and when."""
        x, y, z = self.seen_position.T
        return {
            "target right of the axis": x / z,
            "target below the axis": y / z,
            "distance": np.linalg.norm(self.seen_position, axis=1),
            "distance from the image's centre": np.hypot(x, y) / np.abs(z),
            "time": self.elapsed(channel),
            "speed": self.speed if self.shows_time else np.zeros(len(x)),
        }

    def names_of(self, kind: str) -> tuple[str, ...]:
        """Cameras, targets, arms, and the joints of arms that have them."""
        arms = [arm for arm in self.chain.arms if arm is not None]
        return {
            "sensor": self.places,
            "body": (f"body:{self.recording.target}",),
            "cell": ("cell",),
            "arm": tuple(f"arm:{arm.role}" for arm in arms),
            "joint": tuple(f"joint:{joint}" for arm in arms if arm.has_joints for joint in arm.joints),
        }.get(kind, ())

    # -- where columns go ------------------------------------------------------------------------------

    def at_target(self, twists: np.ndarray) -> np.ndarray:
        """Twists (..., N, 6) of the camera's origin, referred to the target's: linear, effects stay exact."""
        out = np.array(twists, dtype=float)
        out[..., :3] += np.cross(out[..., 3:], self.seen_position)
        return out

    def columns(self, twists: np.ndarray) -> Columns:
        """Columns of twists (p, N, 6) of the target in the camera, about the camera's origin."""
        rows = self.at_target(twists)
        return {(name, 0): rows[..., k] for k, name in enumerate(CHANNELS)}

    def side_of(self, role: str) -> int:
        """0 for the camera's arm, 1 for the target's."""
        (side,) = (k for k, arm in enumerate(self.chain.arms) if arm is not None and arm.role == role)
        return side

    def joint_of(self, place: str) -> tuple[int, int]:
        """Side and index of `joint:<name>`."""
        name = place.partition(":")[2]
        for side, arm in enumerate(self.chain.arms):
            if arm is not None and arm.has_joints and name in arm.joints:
                return side, arm.joints.index(name)
        raise InputError(f"{self.name} has no {place}")

    @property
    def inner_links(self) -> dict[str, tuple[int, int]]:
        """Side and joint index of links behind the first joint and before the last, of arms with joints."""
        out = {}
        for side, arm in enumerate(self.chain.arms):
            if arm is not None and arm.has_joints:
                out |= {link: (side, j) for j, link in enumerate(arm.links) if 0 <= j < len(arm.links) - 1}
        return out

    @cached_property
    def links(self) -> Mapping[str, np.ndarray]:
        """Twists (6, N, 6) per unit error of each constant transform."""
        return self.chain.error_twists()

    @cached_property
    def rates(self) -> dict[str, np.ndarray]:
        """Twists (N, 6) per second by which each arm's reading moves the target, by the arm's role."""
        arms = {arm.role: side for side, arm in enumerate(self.chain.arms) if arm is not None}
        return {role: self.chain.rate(side, RATE_STEP_S) for role, side in arms.items()}

    @cached_property
    def joint_twists(self) -> dict[str, np.ndarray]:
        """Twists (J, N, 6) per radian of the joints of each arm that has them, by the arm's role."""
        arms = {
            arm.role: side for side, arm in enumerate(self.chain.arms) if arm is not None and arm.has_joints
        }
        return {role: self.chain.joint_twists(side) for role, side in arms.items()}

    @property
    def size_twist(self) -> np.ndarray:
        """Twist (N, 6) per unit by which the real target is larger than stated: it seems nearer."""
        out = np.zeros((len(self.seen_position), 6))
        out[:, :3] = -self.seen_position
        return out

    @cached_property
    def speed(self) -> np.ndarray:
        """(N,) how fast the target turns and moves in the camera [rad/s]."""
        turns, moves = (np.linalg.norm(part, axis=1) for part in (self.rate[:, 3:], self.rate[:, :3]))
        return np.hypot(turns, moves / LEVER_M)

    @cached_property
    def rate(self) -> np.ndarray:
        """Change (N, 6) of the target's pose per second by which all arms' readings move it together."""
        return self.at_target(sum(self.rates.values(), np.zeros((len(self.chain.time), 6))))

    def _at_ends(self) -> np.ndarray:
        """Views (N,) at which a shift of stamps asks for the arm before its track begins, or after its end.

        Nobody knows it there, and what is made up makes every delay wrong, the true one too.
        """
        time = self.chain.time
        if not self.shows_time:
            return np.zeros(len(time), dtype=bool)
        width = min(END_S, END_SHARE * self.duration)
        begin = max(arm.stamps[0] for arm in self.recording.arms) + width
        end = min(arm.stamps[-1] for arm in self.recording.arms) - width
        return (time < begin) | (time > end)

    # -- noise -----------------------------------------------------------------------------------------

    def _noise(self, like: DetectorNoise | None, few: bool) -> tuple[DetectorNoise, np.ndarray, np.ndarray]:
        """The noise, its standard deviations (N, 6), and which detections (N,) stand apart."""
        columns, spread = self._what_may_be_off()
        residual = self._residual
        if self.shows_time:
            residual = self._aligned(columns, spread)
            columns += [self.at_target(rate) for rate in self.rates.values()]
            spread += [CLOCK] * len(self.rates)
        left = leftover(residual, columns, spread)
        stated = self.recording.tolerances
        floor = stated.deviation * np.array([stated.detection_position] * 3 + [stated.detection_rotation] * 3)
        noise = self._growing(left) if like is None else like
        growth = noise.growth(self.views)
        middle = np.median(growth, axis=0)
        growth = growth * self._of_jitter(left, growth / middle)
        even = left * middle / growth
        least = like.level * middle if few and like is not None else np.zeros(len(floor))
        score = np.empty(len(even))
        beside = self._beside(even)
        level, score[beside] = find_apart(even[beside], floor, least, self._own_step)
        noise = replace(noise, level=level / middle)
        sigma = noise.level * growth
        apart = score > 0.0
        sigma[apart] *= (score[apart] ** 2)[:, None]  # as good as left out
        return noise, sigma, apart

    def _beside(self, left: np.ndarray) -> np.ndarray:
        """Order (N,) of the views in which neighbours of what is left (N, 6) are alike.

        That of time; at rest that of places, if those tell more of it: what drifts is no noise either.
        """
        in_time = np.arange(len(left))
        if self.shows_time or len(left) > MOST_AT_REST:
            return in_time
        arms = (side for side, arm in enumerate(self.chain.arms) if arm is not None)
        tour = find_tour([self.seen_position, *(self.chain.flange(side)[:, :3, 3] for side in arms)])
        return min(in_time, tour, key=lambda order: np.log(noise_level(left[order], np.zeros(6))).sum())

    def _growing(self, left: np.ndarray) -> DetectorNoise:
        """Noise of an open level that grows as what is left (N, 6) clearly shows."""
        by_distance = DetectorNoise(np.ones(6), growth_power(left, distance_of(self.views)))
        square = find_square(left, self.views, by_distance.growth(self.views))
        return replace(by_distance, square=square)

    def _of_jitter(self, left: np.ndarray, growth: np.ndarray) -> np.ndarray:
        """Factors (N, 6) above one by which stamps that scatter raise noise of a growth (N, 6)."""
        if not self.shows_time:
            return np.ones_like(left)
        rate = self._rate_near() / growth
        even, step = left / growth, self._own_step
        jitter = least = float(np.hypot.reduce([rounding(each) for each in self._all_stamps]))
        if len(left) < LEAST_STEPS:
            return np.sqrt(1.0 + (jitter * rate / noise_level(even, np.zeros(6))) ** 2)
        for _ in range(JITTER_ROUNDS):
            level = slow_level(even, rate, jitter, step)
            jitter = stamp_jitter(even, rate, level, step, least)
        return np.sqrt(1.0 + (jitter * rate / level) ** 2)

    def _rate_near(self) -> np.ndarray:
        """How fast a shift of stamps moves the target (N, 6) per s, over a view and those beside it.

        A reading with a wrong stamp is in the spline on both sides of it.
        """
        padded = np.pad(self.rate**2, ((1, 1), (0, 0)), mode="edge")
        return np.sqrt(0.25 * padded[:-2] + 0.5 * padded[1:-1] + 0.25 * padded[2:])

    @property
    def _all_stamps(self) -> list[np.ndarray]:
        """Of the camera and of the arms."""
        return [self.recording.seen.time, *(arm.stamps for arm in self.recording.arms)]

    @property
    def _own_step(self) -> int:
        """Views from one to the next that shares no reading of a tracker.

        Joints' encoders have no such noise.
        """
        steps = [np.median(np.diff(arm.stamps)) for arm in self.recording.arms if arm.flange is not None]
        shares = self.shows_time and max(steps, default=0.0) > 0.5 / track_rate(self.recording.seen)
        return 2 if shares else 1

    def _what_may_be_off(self) -> tuple[list[np.ndarray], list[float]]:
        """Columns (N, 6) of every constant, the size and joints' zeros, and their standard deviations."""
        columns: list[np.ndarray] = []
        spread: list[float] = []
        for twists in self.links.values():
            columns += [self.at_target(t) for t in twists]
            spread += [TRANSLATION] * 3 + [ROTATION] * 3
        columns.append(self.at_target(self.size_twist))
        spread.append(SIZE)
        for twists in self.joint_twists.values():
            columns += [self.at_target(t) for t in twists]
            spread += [ZERO] * len(twists)
        return columns, spread

    @cached_property
    def left_in_noise(self) -> tuple[np.ndarray, np.ndarray]:
        """What no constant, size, zero or clock of the chain explains, (N, 6), and their columns (K, N, 6).

        Both in standard deviations; detections that stand apart are in it as they are.
        """
        columns, spread = self._what_may_be_off()
        if self.shows_time:
            columns += [self.at_target(rate) for rate in self.rates.values()]
            spread += [CLOCK] * len(self.rates)
        noise = self.noise.at(self.views)
        return leftover(self._residual, columns, spread) / noise, np.array(columns) / noise

    def _aligned(self, columns: list[np.ndarray], spread: list[float]) -> np.ndarray:
        """Residuals at the arms' common clock offset that leaves least: noise must not hold a delay."""
        best: tuple[float, np.ndarray] | None = None
        longest = 0.2 * self.duration
        for offset in OFFSETS_S[np.abs(OFFSETS_S) <= longest]:
            moved = self._residual
            if offset:
                moved = moved - self.at_target(self.chain.shift_twist((offset, offset)))
            left = leftover(moved, [*columns, *(self.at_target(r) for r in self.rates.values())],
                            [*spread, *([0.5 * max(abs(offset), 0.004)] * len(self.rates))])  # fmt: skip
            size = float(np.median(np.abs(left[:, :3]))) + 0.3 * float(np.median(np.abs(left[:, 3:])))
            if best is None or size < 0.97 * best[0]:
                best = (size, moved)
        assert best is not None
        return best[1]


def _rate(stamps: np.ndarray) -> float:
    return 1.0 / float(np.median(np.diff(stamps))) if len(stamps) > 1 else 0.0
