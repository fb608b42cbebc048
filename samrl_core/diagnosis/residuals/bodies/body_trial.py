"""Tracks of a body as the effects see them: positions and turns over what the nominal motion would be."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from samrl_core.cell.types.body_recording import BodyRecording
from samrl_core.diagnosis.residuals.bodies.constants import BodyConstants
from samrl_core.diagnosis.residuals.bodies.find_segments import Found, Impact
from samrl_core.diagnosis.residuals.bodies.fit_inertia import inertia_errors
from samrl_core.diagnosis.residuals.bodies.free_rotation import FreeRotation
from samrl_core.diagnosis.residuals.bodies.motions import Motions, motions_of, noise_levels, sigmas
from samrl_core.diagnosis.residuals.bodies.segment import PATTERNS, Cleaner, Segment, polynomials
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.phases import phases_of_speed

POSITIONS = tuple(f"position_{axis}" for axis in "xyz")
TURNS = tuple(f"rotation_{axis}" for axis in "xyz")
REBOUND = "rebound"
DRAG = "drag of the air"
SLIDING_DRAG = "a drag that grows with the square of the speed"
UNITS = {**dict.fromkeys(POSITIONS, "m"), **dict.fromkeys(TURNS, "rad"), REBOUND: "m/s"}

Field = Callable[[Segment], np.ndarray]


class BodyTrial(Observed):
    """Residuals of one or more recordings of one body, motion by motion."""

    kind = "bodies"
    exact = True
    short = True

    def __init__(
        self, recordings: Sequence[BodyRecording], motions: Motions, constants: BodyConstants,
        channels: tuple[str, ...], levels: tuple[np.ndarray, np.ndarray], ways: np.ndarray,
    ) -> None:  # fmt: skip
        """Form residuals; `channels` are those of all trials together, `levels` the noise of positions (3,)
        [m] and of turns (3,) [rad], `ways` (S, 3) of every fitted motion, whichever trial it is in."""
        self.recordings, self.recording, self.constants = tuple(recordings), recordings[0], constants
        self.channels, self.cached, self.ways = channels, dict[tuple[str, str], Any](), ways
        self.segments, self.rotations, self.level = motions.segments, motions.rotations, levels[0]
        self.impacts = motions.impacts if REBOUND in channels else ()
        self.notes = list[str]()
        starts = np.concatenate([[0.0], np.cumsum([r.duration for r in recordings])])
        self._offsets = starts[:-1]
        self._duration = float(starts[-1])
        self._flying = [motions.segments[k] for k in motions.flying]
        self._position_sigma, self.outliers = sigmas(motions.path_rests, levels[0])
        pairs = zip(self.segments, self._position_sigma, strict=True)
        self._cleaners = [self._cleaner(s, d) for s, d in pairs]
        self._turn_sigma, apart = sigmas(motions.turn_rests, levels[1])
        self.outliers = max(self.outliers, apart) + motions.strays
        triples = zip(self._flying, self.rotations, self._turn_sigma, strict=True)
        self._turn_cleaners = [self._turn_cleaner(s, r, d) for s, r, d in triples]
        turned = [r.residual[None] for r in self.rotations]
        self._residual = self._positions(motions.paths) | self._turns(turned)
        if self.impacts:
            before = np.array([i.before for i in self.impacts])
            after = np.array([i.after for i in self.impacts])
            self._residual[REBOUND, 0] = (after + constants.restitution * before)[None]

    # -- what any recording tells ----------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Of the recording, or of the first and the last."""
        names = [r.name for r in self.recordings]
        return names[0] if len(names) == 1 else f"{names[0]} .. {names[-1]}"

    @property
    def places(self) -> tuple[str, ...]:
        """The body."""
        return (f"body:{self.recording.body.name}",)

    @property
    def units(self) -> Mapping[str, str]:
        """Metres, radians, metres per second."""
        return UNITS

    @cached_property
    def residual(self) -> Mapping[str, np.ndarray]:
        """Per channel (N, 1)."""
        empty = np.zeros((1, 0))
        return {name: self._residual.get((name, 0), empty).T for name in self.channels}

    @cached_property
    def sigma(self) -> Mapping[str, np.ndarray]:
        """Per channel (N, 1)."""
        out = {}
        for name in self.channels:
            if name == REBOUND:
                parts = [self._impact_sigma()]
            elif name in TURNS:
                parts = [s[:, TURNS.index(name)] for s in self._turn_sigma]
            else:
                parts = [s[:, POSITIONS.index(name)] for s in self._position_sigma]
            out[name] = np.concatenate([np.zeros(0), *parts])[:, None]
        return out

    @property
    def duration(self) -> float:
        """Length of all recordings one after another [s]."""
        return self._duration

    def elapsed(self, channel: str) -> np.ndarray:
        """Times (N,) since the first recording began [s]."""
        if channel == REBOUND:
            return np.array([self._since(i.recording, i.time) for i in self.impacts])
        return np.concatenate([np.zeros(0), *(self._since(s.recording, s.time) for s in self._of(channel))])

    def phases(self, channel: str) -> np.ndarray:
        """Rest, slow or fast (N, 1), by the speed of the body."""
        if channel == REBOUND:
            speed = np.array([abs(i.before) for i in self.impacts])
        else:
            speed = self._stacked(channel, lambda s: np.linalg.norm(s.velocity, axis=1))
        return phases_of_speed(speed)[:, None]

    def drivers(self, channel: str, row: int) -> dict[str, np.ndarray]:
        """Where the body was, how fast, and when."""
        if channel == REBOUND:
            return {"speed of the impact": np.array([-i.before for i in self.impacts])}
        out = {"time": self.elapsed(channel)}
        for k, axis in enumerate("xyz"):
            out[f"place along {axis}"] = self._stacked(channel, lambda s, k=k: s.position[:, k])
            out[f"speed along {axis}"] = self._stacked(channel, lambda s, k=k: s.velocity[:, k])
        if channel in POSITIONS:
            for name, columns in self.suspects.items():
                if len(columns[channel, 0]) == 1:
                    out[name] = columns[channel, 0][0]
        return out

    def names_of(self, kind: str) -> tuple[str, ...]:
        """The body, the camera that tracks it, and the cell."""
        return {
            "body": self.places,
            "sensor": (f"sensor:{self.recording.camera}",),
            "cell": ("cell",),
        }.get(kind, ())

    # -- where columns go ------------------------------------------------------------------------------

    @property
    def flies(self) -> bool:
        """Whether there is a flight."""
        return any(not s.slides for s in self.segments)

    @property
    def slides(self) -> bool:
        """Whether there is sliding or rolling."""
        return any(s.slides for s in self.segments)

    @property
    def sees_normal(self) -> bool:
        """Whether the height over the support was measured."""
        support, axes = self.recording.support, self.recording.track.axes
        return support is not None and all(
            axis in axes or abs(part) < 0.1 for axis, part in zip("xyz", support.normal, strict=True)
        )

    def accelerated(self, field: Field) -> Columns:
        """Columns of accelerations (p, n, 3) [m/s^2] of each motion."""
        return self.displaced(lambda s: s.travelled(field(s)))

    def displaced(self, field: Field) -> Columns:
        """Columns of displacements (p, n, 3) [m] of each motion."""
        return self._positions([field(s) for s in self.segments])

    def turned(self, field: Callable[[FreeRotation], np.ndarray]) -> Columns:
        """Columns of rotation vectors (p, n, 3) [rad] of each flight."""
        return self._turns([field(r) for r in self.rotations])

    def rebounded(self, rate: Callable[[Impact], float]) -> Columns:
        """One column of speeds after each impact [m/s]."""
        if not self.impacts:
            return {}
        return {(REBOUND, 0): np.array([[rate(i) for i in self.impacts]])}

    @cached_property
    def suspects(self) -> dict[str, Columns]:
        """What is known to act on bodies and is no effect of the library, with columns."""

        def drag(s: Segment) -> np.ndarray:
            return -(np.linalg.norm(s.velocity, axis=1, keepdims=True) * s.velocity)[None]

        def damping(s: Segment) -> np.ndarray:
            return -s.velocity[None] * (0.0 if s.slides else 1.0)

        def lift(s: Segment) -> np.ndarray:
            return np.cross(np.eye(3)[:, None], s.velocity[None]) * (0.0 if s.slides else 1.0)

        def curl(s: Segment) -> np.ndarray:
            return s.load * np.cross(s.normal, s.direction)[None]

        out = {}
        if self.flies:
            out[DRAG] = self.accelerated(drag)
            out["a force against the velocity"] = self.accelerated(damping)
            out["a force across the velocity (spin in air)"] = self.accelerated(lift)
        if self.slides:
            out["a force across the sliding"] = self.accelerated(curl)
        if self.slides and not self.flies:
            out[SLIDING_DRAG] = self.accelerated(drag)
        return out

    def _positions(self, paths: Sequence[np.ndarray]) -> Columns:
        """Paths (..., n, 3) of each motion as cleaned columns of the measured axes."""
        out: Columns = {}
        for k, channel in enumerate(POSITIONS):
            if channel in self.channels and paths:
                out[channel, 0] = np.concatenate(
                    [np.atleast_2d(c[k](p[..., k])) for c, p in zip(self._cleaners, paths, strict=True)],
                    axis=-1,
                )
        return out

    def _turns(self, vectors: Sequence[np.ndarray]) -> Columns:
        """Rotation vectors (p, n, 3) of each flight as cleaned columns."""
        if not vectors:
            return {}
        cleaned = []
        for cleaner, v in zip(self._turn_cleaners, vectors, strict=True):
            flat = np.swapaxes(v, -1, -2).reshape(*v.shape[:-2], -1)
            cleaned.append(cleaner(flat).reshape(*v.shape[:-2], 3, v.shape[-2]))
        whole = np.concatenate(cleaned, axis=-1)
        return {(channel, 0): whole[..., k, :] for k, channel in enumerate(TURNS)}

    def _of(self, channel: str) -> Sequence[Segment]:
        return self._flying if channel in TURNS else self.segments

    def _since(self, recording: int, time: Any) -> Any:
        return self._offsets[recording] + time - self.recordings[recording].track.time[0]

    def _stacked(self, channel: str, of: Callable[[Segment], np.ndarray]) -> np.ndarray:
        return np.concatenate([np.zeros(0), *(of(s) for s in self._of(channel))])

    # -- noise -----------------------------------------------------------------------------------------

    def _cleaner(self, segment: Segment, sigma: np.ndarray) -> list[Cleaner]:
        """One per axis."""
        stated = self.recording.tolerances
        start = polynomials(segment.time, (0, 1))
        lasting = stated.deviation * stated.track_position * polynomials(segment.time, PATTERNS)
        return [Cleaner(start, lasting, sigma[:, k]) for k in range(3)]

    def _turn_cleaner(self, segment: Segment, rotation: FreeRotation, sigma: np.ndarray) -> Cleaner:
        """One for all three axes: a start about one of them may show about the others."""
        stated, count = self.recording.tolerances, len(segment)
        free = np.swapaxes(rotation.start, 1, 2).reshape(6, -1)
        lasting = stated.deviation * stated.track_rotation * polynomials(segment.time, PATTERNS)
        blocks = np.zeros((3 * len(PATTERNS), 3 * count))
        for k in range(3):
            blocks[k * len(PATTERNS) : (k + 1) * len(PATTERNS), k * count : (k + 1) * count] = lasting
        return Cleaner(free, blocks, sigma.T.reshape(-1))

    def _impact_sigma(self) -> np.ndarray:
        """Standard deviations (M,) of speeds after impacts [m/s]."""
        support = self.recording.support
        noise = 0.0 if support is None else float(np.linalg.norm(self.level * support.normal))
        stated, e = self.recording.tolerances, self.constants.restitution
        rough = stated.deviation * stated.rebound
        return np.array(
            [
                np.sqrt((noise * i.after_spread) ** 2 + (noise * e * i.before_spread) ** 2
                        + (rough * i.before) ** 2 + 1e-8)
                for i in self.impacts
            ]
        )  # fmt: skip


def channels_of(recordings: Sequence[BodyRecording], found: Sequence[Found]) -> tuple[str, ...]:
    """Channels that the tracks fill; none where there is no motion that a model describes."""
    track, body = recordings[0].track, recordings[0].body
    segments = [s for f in found for s in f.segments]
    out: list[str] = []
    if segments:
        out += [c for c, axis in zip(POSITIONS, "xyz", strict=True) if axis in track.axes]
        if track.turns == "xyz" and len(body.gyration) and any(not s.slides for s in segments):
            out += TURNS
    if any(f.impacts for f in found):
        out.append(REBOUND)
    return tuple(out)


def body_trials(
    bundles: Sequence[Sequence[BodyRecording]],
    found: Sequence[Sequence[Found]],
    constants: BodyConstants,
    channels: tuple[str, ...],
    fitted: int,
) -> list[BodyTrial]:
    """One trial for each bundle of recordings, the first `fitted` to fit; these tell the noise together."""
    turns, errors = TURNS[0] in channels, np.zeros(2)
    if turns:
        flights = [s for group in found[:fitted] for f in group for s in f.segments if not s.slides]
        errors = inertia_errors(flights, bundles[0][0].body.gyration)
    made = [motions_of(b, f, constants, turns, errors) for b, f in zip(bundles, found, strict=True)]
    levels = zip(
        noise_levels([m.path_rests for m in made], fitted),
        noise_levels([m.turn_rests for m in made], fitted),
        strict=True,
    )
    ways = [np.mean(s.velocity, axis=0) * len(s) for m in made[:fitted] for s in m.segments]
    shared = np.array(ways).reshape(-1, 3)
    return [
        BodyTrial(b, m, constants, channels, n, shared) for b, m, n in zip(bundles, made, levels, strict=True)
    ]
