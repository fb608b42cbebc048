"""A mapping file of bodies: which columns are the track, and what is stated of body, support and gravity."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from samrl_core.cell.types.body_recording import GRAVITY, BodyModel, Support
from samrl_core.common.errors import InputError
from samrl_core.common.validation import Checked, fault
from samrl_ros.log_import.pose_specs import ANGLES, LENGTHS, Formula, FormulaList
from samrl_ros.log_import.specs import LoggedSpec, Pair

TURNS = ("quaternion", "rotation_vector", "rpy", "rotation_matrix", "matrix", "angle")
Length = Literal["m", "cm", "mm"]
Vector = Annotated[list[float], Field(min_length=3, max_length=3)]


class BodyTrackSpec(Checked):
    """Positions over time, in three axes or fewer, with turns or without."""

    source: str | None = None  # None: the only one
    position: list[Formula] | str | None = None  # one formula per axis of `axes`
    axes: Literal["xyz", "xy", "xz", "yz", "x", "y", "z"] = "xyz"
    unit: Length = "m"
    quaternion: list[Formula] | str | None = None
    order: Literal["xyzw", "wxyz"] = "xyzw"
    rotation_vector: list[Formula] | str | None = None
    rpy: list[Formula] | str | None = None  # about the fixed x, y, z axes
    rotation_matrix: list[Formula] | str | None = None  # 9 numbers, row by row
    matrix: list[Formula] | str | None = None  # 12 or 16 numbers, row by row, position among them
    angle: Formula | None = None  # about the axis that two measured ones leave
    angle_unit: Literal["rad", "deg"] = "rad"

    @model_validator(mode="after")
    def _one_rotation(self) -> BodyTrackSpec:
        given = [name for name in TURNS if getattr(self, name) is not None]
        if len(given) > 1:
            raise fault(f" has {' and '.join(given)}; give at most one of {', '.join(TURNS)}")
        if (self.matrix is None) == (self.position is None):
            raise fault(" must have position, or matrix alone")
        if self.angle is not None and len(self.axes) != 2:
            raise fault(f" turns about one axis, so `axes` must be two, are {self.axes!r}", "angle")
        if given and given != ["angle"] and self.axes != "xyz":
            raise fault(f" is of three axes, `axes` are {self.axes!r}; give `angle`", given[0])
        return self

    @property
    def quantities(self) -> dict[str, FormulaList]:
        """Formulas by key, as `read_source` looks for them."""
        found = {key: getattr(self, key) for key in ("position", *TURNS)}
        return {key: FormulaList(value) for key, value in found.items() if value is not None}


class BodySpec(Checked):
    """What is stated of the body. At most one shape; lengths in `unit`."""

    name: str = "body"
    sphere: float | None = None  # radius
    cylinder: list[float] | None = None  # radius, height
    box: list[float] | None = None  # three edges
    unit: Length = "m"
    mass: float | None = None  # [kg]
    inertia: Vector | None = None  # [kg m^2]
    center: Vector = Field(default=[0.0, 0.0, 0.0])  # of mass in the tracked frame

    def model(self, where: str) -> BodyModel:
        """The body. Raises `InputError` naming the key."""
        shapes = {k: getattr(self, k) for k in ("sphere", "cylinder", "box") if getattr(self, k) is not None}
        if len(shapes) > 1:
            raise InputError(f"{where} has {' and '.join(shapes)}; a body has one shape")
        shape, sizes = next(iter(shapes.items()), ("point", []))
        by = LENGTHS[self.unit]
        listed = sizes if isinstance(sizes, list) else [sizes]
        x, y, z = (by * float(c) for c in self.center)
        try:
            return BodyModel(
                self.name, shape, tuple(by * float(s) for s in listed), self.mass,
                tuple(self.inertia or ()), (x, y, z),
            )  # fmt: skip
        except InputError as error:
            raise InputError(f"{where}: {error}") from error


class SupportSpec(Checked):
    """The plane below it. `incline` is for tracks along the plane: gravity leans, the normal stays."""

    point: Vector = Field([0.0, 0.0, 0.0])
    normal: Vector = Field([0.0, 0.0, 1.0])
    unit: Length = "m"
    friction: float | None = None
    restitution: float | None = None
    rolls: bool = False

    def support(self, where: str) -> Support:
        """The plane. Raises `InputError` naming the key."""
        x, y, z = (LENGTHS[self.unit] * float(c) for c in self.point)
        nx, ny, nz = (float(c) for c in self.normal)
        try:
            return Support((x, y, z), (nx, ny, nz), self.friction, self.restitution, self.rolls)
        except InputError as error:
            raise InputError(f"{where}: {error}") from error


class BodiesSpec(Checked):
    """A body, its track, and what acts on it."""

    camera: str = "camera"
    body: BodySpec = BodySpec()
    track: BodyTrackSpec
    support: SupportSpec | None = None
    gravity: Vector = Field(list(GRAVITY))  # [m/s^2] in the track's frame
    incline: float | None = None  # angle by which the support falls along +x of a track along it
    angle_unit: Literal["rad", "deg"] = "deg"
    phase: Literal["auto", "flight", "contact"] = "auto"

    @model_validator(mode="after")
    def _incline_fits(self) -> BodiesSpec:
        if self.incline is None:
            return self
        if self.support is None or self.support.normal != [0.0, 0.0, 1.0] or self.gravity != list(GRAVITY):
            raise fault(
                " is for a track along the support: state `support` with normal [0, 0, 1], and leave"
                " `gravity` out",
                "incline",
            )
        if not abs(ANGLES[self.angle_unit] * self.incline) < 0.5 * np.pi:
            raise fault(f" is {self.incline} {self.angle_unit}, must be less than a right angle", "incline")
        return self

    @property
    def pull(self) -> tuple[float, float, float]:
        """Gravity in the track's frame [m/s^2]."""
        if self.incline is None:
            x, y, z = (float(g) for g in self.gravity)
            return x, y, z
        angle, size = ANGLES[self.angle_unit] * self.incline, -GRAVITY[2]
        return size * float(np.sin(angle)), 0.0, -size * float(np.cos(angle))


class BodyRecordingSpec(LoggedSpec):
    """Everything about one recording of a body, general keys and its own merged."""

    role: Literal["fit", "held_out"] | None = None  # None: the diagnosis holds some out
    bodies: BodiesSpec
    time_range: Pair | None = None

    def readers(self) -> dict[str, BodyTrackSpec]:
        """Its track."""
        return {"bodies.track": self.bodies.track}
