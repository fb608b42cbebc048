"""Ten kinds outside the catalogue: nothing that the contract's families stand for, and none of the first
set's.

Each is sized against what the recordings ask of the arm, so that a severity of 0.5 shows plainly in its
channel.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks
from samrl_core.blind_test.second_set.sizes import between, either_sign
from samrl_core.cell.types.arm_recording import JointSignal

_PERIOD = 0.001  # [s] of the cell's controllers
_REACH = {"tool_arm": 0.5, "camera_arm": 0.5}  # [m] a usual lever of a force at the flange


def _force_scale(site: Site) -> float:
    """A force at the flange that a shoulder feels as a tenth of its largest torque [N]."""
    return 0.1 * float(site.peak_torque[:4].max()) / _REACH[site.role]


def _flange_speed(site: Site, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    _, _, jacobian = site.model.flange_and_jacobian(q)
    return jacobian, jacobian @ v


def _encoder_creep(site: Site, form: str, severity: float) -> Injection:
    """A code disc that slips on its shaft, a little more with every movement in one direction."""
    slip, joint = quantile(severity, 0.005, 0.05), site.joint

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        lost = [0.0]

        def read(t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            if t >= 0:
                lost[0] += slip * max(float(v[joint]), 0.0) * _PERIOD
            q = q.copy()
            q[joint] -= lost[0]
            return q, v

        hooks.encoder.append(read)

    return Injection({"slip": Quantity(slip, "1")}, attach)


class _Grabs:
    """Friction in bursts: (t0, t1, level)."""

    def __init__(self, spans: list[tuple[float, float, float]]) -> None:
        self._spans = spans

    def linear(self, t: float, q: float, v: float, load: float, dt: float) -> tuple[float, float]:
        level = sum(size for begin, end, size in self._spans if begin <= t < end)
        speed = max(abs(v), 1e-6)
        return 0.0, level * math.tanh(speed / 0.005) / speed

    def commit(self, t: float, q: float, v: float, load: float, dt: float) -> None:
        """No state."""


def _brake_grabs(site: Site, form: str, severity: float) -> Injection:
    """A holding brake that does not stay open: it grabs some times a recording, for parts of a second."""
    size = quantile(severity, 0.05, 0.3) * max(float(site.peak_torque[site.joint]), 2.0)

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        begins = 0.2 + np.cumsum(np.append(0.0, rng.uniform(0.5, 2.0, size=24)))
        lengths, sizes = rng.uniform(0.08, 0.4, size=25), size * rng.uniform(0.5, 1.5, size=25)
        spans = [(float(b), float(b + w), float(s)) for b, w, s in zip(begins, lengths, sizes, strict=True)]
        hooks.add_friction(site.joint, _Grabs(spans))

    return Injection({"torque": Quantity(size, "N m")}, attach)


def _dead_band(site: Site, form: str, severity: float) -> Injection:
    """A bridge without current below a threshold, whose place in the range of torques has shifted."""
    width = quantile(severity, 0.03, 0.15) * max(float(site.peak_torque[site.joint]), 1.5)
    centre, joint = 0.25 * either_sign(site) * float(site.peak_torque[site.joint]), site.joint

    def stage(t: float, effort: np.ndarray) -> np.ndarray:
        out = effort.copy()
        over = effort[joint] - centre
        out[joint] = centre + math.copysign(max(abs(over) - width, 0.0), over)
        return out

    parameters = {"width": Quantity(width, "N m"), "centre": Quantity(centre, "N m")}
    return Injection(parameters, lambda hooks, rng: hooks.drive.append(stage))


def _resonance(site: Site, form: str, severity: float) -> Injection:
    """An amplifier that overshoots: a bell of some decibels about some hertz in the torque's path."""
    height, hertz, joint = quantile(severity, 0.3, 2.0), between(site, 4.0, 9.0), site.joint
    k, q = math.tan(math.pi * hertz * _PERIOD), 2.0
    # Bell filter (Zoelzer, DAFX, table 2.3), with gain 1 + height.
    low = 1.0 + k / q + k * k
    b = np.array([1 + (1 + height) * k / q + k * k, 2 * (k * k - 1), 1 - (1 + height) * k / q + k * k]) / low
    a = np.array([1.0, 2 * (k * k - 1) / low, (1 - k / q + k * k) / low])

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        past = np.zeros(4)  # two inputs, two outputs, newest first
        begun = [False]

        def stage(t: float, effort: np.ndarray) -> np.ndarray:
            asked = float(effort[joint])
            if not begun[0]:
                past[:], begun[0] = asked, True
            given = b[0] * asked + b[1] * past[0] + b[2] * past[1] - a[1] * past[2] - a[2] * past[3]
            past[:] = (asked, past[0], given, past[2])
            out = effort.copy()
            out[joint] = given
            return out

        hooks.drive.append(stage)

    parameters = {"gain": Quantity(1.0 + height, "1"), "frequency": Quantity(hertz, "Hz")}
    return Injection(parameters, attach)


def _spinning_wheel(site: Site, form: str, severity: float) -> Injection:
    """A spindle that runs in the tool: its angular momentum h turns with the flange, torque = h x omega."""
    momentum = quantile(severity, 0.2, 2.0) * either_sign(site)  # [N m s]
    axis = site.rng.normal(size=3)
    axis /= float(np.linalg.norm(axis))

    def push(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        _, rotation, jacobian = site.model.flange_and_jacobian(q)
        omega = jacobian[3:] @ v
        return jacobian[3:].T @ np.cross(momentum * (rotation @ axis), omega)

    return Injection(
        {"angular_momentum": Quantity(momentum, "N m s")}, lambda hooks, rng: hooks.external.append(push)
    )


def _draught(site: Site, form: str, severity: float) -> Injection:
    """A fan that blows at the tool in gusts: drag ~ |w - v| (w - v) at the flange."""
    usual = quantile(severity, 0.3, 1.5) * _force_scale(site)  # [N] at the mean wind
    angle = between(site, -math.pi, math.pi)
    towards = np.array([math.cos(angle), math.sin(angle), 0.2])

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        gusts = 3.0 * np.asarray(
            lfilter([0.05], [1.0, -0.95], rng.normal(size=40_000))
        )  # correlated over 0.2 s

        def push(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
            at = min(max(t + 1.0, 0.0) * 100.0, len(gusts) - 2)
            whole = int(at)
            gust = gusts[whole] + (at - whole) * (gusts[whole + 1] - gusts[whole])
            jacobian, speed = _flange_speed(site, q, v)
            wind = 3.0 * (1.0 + 0.6 * gust) * towards - speed[:3]
            return jacobian[:3].T @ (usual / 9.0 * float(np.linalg.norm(wind)) * wind)

        hooks.external.append(push)

    return Injection({"force": Quantity(usual, "N")}, attach)


def _magnet(site: Site, form: str, severity: float) -> Injection:
    """A magnet beside the way: it draws the flange towards a point, the nearer the more."""
    usual = quantile(severity, 0.5, 3.0) * _force_scale(site)  # [N] at its strongest
    middle = 0.5 * (site.lowest + site.highest)
    offset = site.rng.normal(size=3)
    offset *= 0.08 / float(np.linalg.norm(offset))
    point, width = site.model.flange_and_jacobian(middle)[0] + offset, 0.08

    def push(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        origin, _, jacobian = site.model.flange_and_jacobian(q)
        away = (point - origin) / width
        # Steepest at a distance of one width, where the force is `usual`.
        force = usual * math.exp(0.5 * (1.0 - float(away @ away))) * away
        return jacobian[:3].T @ force

    return Injection({"force": Quantity(usual, "N")}, lambda hooks, rng: hooks.external.append(push))


def _supply_sag(site: Site, form: str, severity: float) -> Injection:
    """One supply for all drives: the more torque all give together, the less each gets, 50 ms later."""
    sag = quantile(severity, 0.04, 0.25)
    usual = float((site.peak_torque / site.spec.limits.effort).sum())

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        drawn: list[float] = []

        def stage(t: float, effort: np.ndarray) -> np.ndarray:
            now = float((np.abs(effort) / site.spec.limits.effort).sum()) / usual
            if not drawn:
                drawn.append(now)
            drawn[0] += _PERIOD / 0.05 * (now - drawn[0])
            return effort * (1.0 - sag * drawn[0] ** 2)

        hooks.drive.append(stage)

    return Injection({"sag": Quantity(sag, "1")}, attach)


def _crosstalk(site: Site, form: str, severity: float) -> Injection:
    """Strain gauges that feel the neighbours' load: one sensor reads shares of two other joints."""
    share, count, joint = quantile(severity, 0.04, 0.25), len(site.armature), site.joint
    ranked = [int(j) for j in np.argsort(-site.peak_torque) if int(j) != joint]
    strongest, other = ranked[0], ranked[1 + int(site.rng.integers(count - 2))]
    first, second = share * either_sign(site), 0.5 * share * either_sign(site)
    size = min(1.0, 4.0 * float(site.peak_torque[joint]) / float(site.peak_torque[strongest]))

    def sense(time: np.ndarray, reading: np.ndarray) -> np.ndarray:
        out = reading.copy()
        out[:, joint] += size * (first * reading[:, strongest] + second * reading[:, other])
        return out

    return Injection({"share": Quantity(first * size, "1")}, lambda hooks, rng: hooks.sensor.append(sense))


def _playback_wobble(site: Site, form: str, severity: float) -> Injection:
    """A command that is played back by a clock that runs fast and slow, twice as quickly in parts."""
    size, seconds = quantile(severity, 0.006, 0.04), between(site, 0.8, 1.6)
    phase = between(site, -math.pi, math.pi)

    def shaped(command: JointSignal) -> JointSignal:
        wave = np.sin(2 * np.pi * command.time / seconds + phase) - math.sin(phase)
        at = command.time + size * wave
        pace = 1.0 + size * 2 * np.pi / seconds * np.cos(2 * np.pi * command.time / seconds + phase)

        def played(values: np.ndarray | None) -> np.ndarray | None:
            if values is None:
                return None
            return np.stack([np.interp(at, command.time, column) for column in values.T], axis=1)

        velocity = played(command.velocity)
        return replace(
            command,
            position=played(command.position),
            velocity=None if velocity is None else velocity * pace[:, None],
        )

    return Injection({"size": Quantity(size, "s")}, lambda hooks, rng: hooks.command.append(shaped))


_Make = Callable[[Site, str, float], Injection]


def _outside(
    name: str, place: str, make: _Make, shows_in: str, reverses: bool = False, first_joint: int = 0
) -> Disturbance:
    return Disturbance(
        name, place, make, shows_in, outside=True, needs_reversal=reverses, first_joint=first_joint
    )


FAMILIES = (
    _outside("encoder_creep", "joint", _encoder_creep, "encoder", first_joint=1),
    _outside("brake_grabs", "joint", _brake_grabs, "drive"),
    _outside("amplifier_dead_band", "joint", _dead_band, "drive", reverses=True),
    _outside("amplifier_resonance", "joint", _resonance, "drive"),
    _outside("spinning_wheel", "arm", _spinning_wheel, "link"),
    _outside("draught", "arm", _draught, "link"),
    _outside("magnet", "arm", _magnet, "link"),
    _outside("supply_sag", "arm", _supply_sag, "drive"),
    _outside("sensor_crosstalk", "joint", _crosstalk, "drive"),
    _outside("playback_wobble", "arm", _playback_wobble, "either"),
)
