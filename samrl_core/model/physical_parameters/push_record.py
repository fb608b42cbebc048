"""What is known of one push: what the arm's driver reports, and where the camera saw the disc."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.common.errors import InputError


@dataclass(frozen=True, eq=False)
class Disc:
    """Shape of what is pushed, from CAD or from images; it lies flat.

    Raises:
        InputError: a length is not positive.
    """

    radius: float  # [m]
    thickness: float  # [m]
    rim_radius: float  # of the circle on which it stands: the radius less the rounding of its edge [m]

    def __post_init__(self) -> None:
        sizes = np.array([self.radius, self.thickness, self.rim_radius])
        if not (np.isfinite(sizes).all() and (sizes > 0).all() and self.rim_radius <= self.radius):
            raise InputError(
                f"disc's radius, thickness, rim radius {sizes} m must be positive, the rim within the radius"
            )


@dataclass(frozen=True, eq=False)
class PushRecord:
    """One push along a line, T control periods of the arm and N observations of the disc; positions are along
    the line, in one frame. The arm is at rest at the first sample.

    `free_acceleration` and `effective_mass` come from the commanded torque and the measured joints by the
    arm's nominal dynamics (`robots.tip_dynamics`), never from a simulator.

    Raises:
        InputError: lengths disagree, a value is not finite, or a mass or a time is not positive.
    """

    period_s: float  # of the arm's samples [s]
    push_steps: int  # the force acts in the first so many periods, then the arm brakes
    tip: np.ndarray  # (T,) measured position of the tool's tip [m]
    free_acceleration: np.ndarray  # (T,) of the tip, had it touched nothing in that period [m/s2]
    effective_mass: np.ndarray  # (T,) of the arm at its tip along the line [kg]
    seen_step: np.ndarray  # (N,) int, period at whose start the disc was observed
    seen: np.ndarray  # (N,) observed position of the disc's centre [m]

    def __post_init__(self) -> None:
        steps, sightings = np.shape(self.tip), np.shape(self.seen)
        if len(steps) != 1 or len(sightings) != 1 or steps[0] < 2 or sightings[0] < 2:
            raise InputError(f"a push needs two samples and two sightings at least, got {steps}, {sightings}")
        for name, shape in (
            ("free_acceleration", steps),
            ("effective_mass", steps),
            ("seen_step", sightings),
        ):
            if np.shape(getattr(self, name)) != shape:
                raise InputError(f"{name} has shape {np.shape(getattr(self, name))}, must be {shape}")
        for name in ("tip", "free_acceleration", "effective_mass", "seen"):
            if not np.isfinite(getattr(self, name)).all():
                raise InputError(f"{name} has a value that is not finite; cut the recording there")
        lightest = float(np.min(self.effective_mass))
        if not (np.isfinite(self.period_s) and self.period_s > 0 and lightest > 0):
            raise InputError(
                f"period {self.period_s} s and effective mass {lightest} kg must be positive and finite"
            )
        if not (0 < self.push_steps <= steps[0] and np.all(np.diff(self.seen_step) > 0)):
            raise InputError(
                f"push of {self.push_steps} periods must lie within the {steps[0]} recorded ones, and "
                f"sightings must be in order of time"
            )
        if not (0 <= self.seen_step[0] and self.seen_step[-1] <= steps[0]):
            raise InputError(f"sightings at {self.seen_step[[0, -1]]} are outside periods 0..{steps[0]}")

    def has_moved(self, noise: float, deviations: float = 4.0) -> bool:
        """Whether the disc's way stands out of the noise [m] of a sighting: thirds at both ends compared."""
        third = max(1, len(self.seen) // 3)
        way = abs(float(np.mean(self.seen[-third:]) - np.mean(self.seen[:third])))
        return way > deviations * noise * np.sqrt(2.0 / third)
