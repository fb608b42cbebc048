"""Recordings of a free body: a thing that slides on a support, flies or bounces, as poses over time."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from samrl_core.cell.types.stated_tolerances import StatedTolerances
from samrl_core.common.errors import InputError

PHASES = ("auto", "flight", "contact")
SHAPES = {"point": 0, "sphere": 1, "cylinder": 2, "box": 3}  # name -> how many sizes
GRAVITY = (0.0, 0.0, -9.81)


@dataclass(frozen=True)
class BodyTolerances(StatedTolerances):
    """How far the real thing may be from its description and still count as nominal.

    Half widths of what is plausible, unless `stated_as` says that they are standard deviations.
    """

    length_scale: float = 0.005  # of the track's unit of length, or of gravity, as a fraction
    frame_rate: float = 0.0005  # of the stamps, as a fraction
    tilt: float = 0.005  # of gravity in the track's frame, and of the support against it, per axis [rad]
    friction: float = 0.05  # of the stated coefficient, as a fraction
    restitution: float = 0.02  # of the stated coefficient
    rebound: float = 0.02  # by which one impact differs from the next, as a fraction of its speed
    center: float = 0.001  # of the centre of mass in the tracked frame, per axis [m]
    inertia: float = 0.05  # as a fraction
    air: float = 0.01  # drag of the air over mass: of a dense body, deceleration per squared speed [1/m]
    track_position: float = 0.0005  # errors of the tracker that last over a motion, per axis [m]
    track_rotation: float = 0.01  # likewise [rad]


@dataclass(frozen=True)
class Support:
    """A plane on which the body may slide, roll or bounce, in the track's frame."""

    point: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m]
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)  # out of the plane
    friction: float | None = None  # coefficient of sliding, of rolling where it rolls; None: not stated
    restitution: float | None = None  # None: not stated
    rolls: bool = False  # without slipping

    def __post_init__(self) -> None:
        length = float(np.linalg.norm(self.normal))
        if not (np.isfinite(self.point).all() and np.isfinite(length) and length > 0):
            raise InputError(
                f"support at {self.point} with normal {self.normal}: must be finite, normal not 0"
            )
        object.__setattr__(self, "normal", tuple(float(x) / length for x in self.normal))
        if self.friction is not None and not 0.0 <= self.friction <= 5.0:
            raise InputError(f"friction of the support is {self.friction}, must be 0 to 5")
        if self.restitution is not None and not 0.0 <= self.restitution <= 1.0:
            raise InputError(f"restitution of the support is {self.restitution}, must be 0 to 1")


@dataclass(frozen=True)
class BodyModel:
    """What is stated of the body, in the frame that is tracked."""

    name: str = "body"
    shape: str = "point"  # of `SHAPES`
    sizes: tuple[float, ...] = ()  # [m] sphere: radius; cylinder: radius, height; box: three edges
    mass: float | None = None  # [kg]
    inertia: tuple[float, ...] = ()  # [kg m^2] about the centre of mass, along the frame's axes; needs mass
    center: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of mass [m]

    def __post_init__(self) -> None:
        if self.shape not in SHAPES or len(self.sizes) != SHAPES.get(self.shape):
            raise InputError(f"shape {self.shape!r} with sizes {self.sizes}; known are {SHAPES} (sizes each)")
        if not all(np.isfinite(s) and s > 0 for s in self.sizes):
            raise InputError(f"sizes of the {self.shape} are {self.sizes}, must be > 0")
        if self.mass is not None and not (np.isfinite(self.mass) and self.mass > 0):
            raise InputError(f"mass is {self.mass}, must be > 0 kg")
        if self.inertia and (len(self.inertia) != 3 or min(self.inertia) <= 0 or self.mass is None):
            raise InputError(f"inertia {self.inertia} must be three numbers > 0, with `mass` stated")
        if self.inertia and 2.0 * max(self.inertia) > sum(self.inertia) * (1.0 + 1e-6):
            raise InputError(f"inertia {self.inertia}: no body has one larger than the sum of the others")

    @property
    def gyration(self) -> np.ndarray:
        """Inertia over mass (3,) [m^2]; empty where neither inertia nor shape is stated."""
        if self.inertia and self.mass is not None:
            return np.asarray(self.inertia) / self.mass
        if self.shape == "sphere":
            return np.full(3, 0.4 * self.sizes[0] ** 2)
        if self.shape == "cylinder":
            radius, height = self.sizes
            across = (3.0 * radius**2 + height**2) / 12.0
            return np.array([across, across, 0.5 * radius**2])
        if self.shape == "box":
            squares = np.square(self.sizes)
            return (np.sum(squares) - squares) / 12.0
        return np.zeros(0)

    def reach(self, along: np.ndarray) -> np.ndarray:
        """How far (N,) [m] the body reaches from its frame's origin along its unit vectors (N, 3)."""
        if self.shape == "sphere":
            return np.full(len(along), self.sizes[0])
        if self.shape == "cylinder":
            radius, height = self.sizes
            across = np.sqrt(np.maximum(1.0 - along[:, 2] ** 2, 0.0))
            return radius * across + 0.5 * height * np.abs(along[:, 2])
        if self.shape == "box":
            return 0.5 * np.abs(along) @ np.asarray(self.sizes)
        return np.zeros(len(along))

    @property
    def rolling(self) -> float:
        """Inertia over mass and squared radius of what rolls; 0 where it has no radius."""
        if self.shape not in ("sphere", "cylinder"):
            return 0.0
        return float(self.gyration[-1] / self.sizes[0] ** 2)


@dataclass(frozen=True, eq=False)
class BodyTrack:
    """Poses of a body at strictly increasing stamps. Axes that were not measured hold zeros."""

    time: np.ndarray  # (N,) [s]
    position: np.ndarray  # (N, 3) [m] of the tracked frame's origin
    axes: str = "xyz"  # that were measured
    quat_xyzw: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))  # (N, 4), or (0, 4): not measured
    turns: str = ""  # axes of the track's frame about which turns were measured: xyz, one of them, or none

    def __post_init__(self) -> None:
        count = len(self.time)
        if not self.axes or any(a not in "xyz" for a in self.axes) or len(set(self.axes)) != len(self.axes):
            raise InputError(f"measured axes {self.axes!r}, must be some of x, y, z, each once")
        if self.turns not in ("", "x", "y", "z", "xyz"):
            raise InputError(f"measured turns {self.turns!r}, must be x, y, z, xyz or none")
        quats = (count if self.turns else 0, 4)
        for name, shape in {"time": (count,), "position": (count, 3), "quat_xyzw": quats}.items():
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != shape or not np.isfinite(value).all():
                raise InputError(f"{name} of a body's track has shape {value.shape}, must be finite {shape}")
        if count > 1 and float(np.min(np.diff(self.time))) <= 0:
            raise InputError("stamps of a body's track must increase; leave out repeated poses")
        if self.turns and count:
            length = np.linalg.norm(self.quat_xyzw, axis=1)
            if float(np.max(np.abs(length - 1.0))) > 1e-3:
                k = int(np.argmax(np.abs(length - 1.0)))
                raise InputError(f"quaternion {k} of a body's track has length {length[k]:.4f}, must be 1")

    def __len__(self) -> int:
        return len(self.time)

    def only(self, keep: np.ndarray) -> BodyTrack:
        """The poses of a mask or of indices."""
        quats = self.quat_xyzw[keep] if self.turns else self.quat_xyzw
        return BodyTrack(self.time[keep], self.position[keep], self.axes, quats, self.turns)


@dataclass(frozen=True, eq=False)
class BodyRecording:
    """One motion of one body: a toss, a fall, a slide, or several of them one after another."""

    name: str
    source: str
    sha256: str
    track: BodyTrack
    body: BodyModel = field(default_factory=BodyModel)
    support: Support | None = None  # None: it touches nothing that is known
    gravity: tuple[float, float, float] = GRAVITY  # [m/s^2] in the track's frame
    camera: str = "camera"
    phase: str = "auto"  # of `PHASES`: what all of the track is; auto: found from the data
    tolerances: BodyTolerances = field(default_factory=BodyTolerances)

    def __post_init__(self) -> None:
        if self.phase not in PHASES:
            raise InputError(f"phase {self.phase!r}; known are {', '.join(PHASES)}")
        if self.phase == "contact" and self.support is None:
            raise InputError(f"{self.name}: phase contact needs `support`")
        size = float(np.linalg.norm(self.gravity))
        if not np.isfinite(size) or size <= 0:
            raise InputError(f"{self.name}: gravity is {self.gravity}, must be finite and not zero")
        if self.support is not None and self.support.rolls and self.body.rolling == 0:
            raise InputError(f"{self.name}: `rolls` needs a sphere or a cylinder; shape is {self.body.shape}")

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.track.time[-1] - self.track.time[0])
