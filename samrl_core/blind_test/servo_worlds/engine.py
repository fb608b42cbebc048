"""The servo worlds' engine: drives, rotors, transmissions and a mechanism's equations, stepped together.

Velocities are solved for implicitly, linearised about the step's end: (M + dt C) v' = M v + dt (a - h).
Friction comes as a secant, springs and back-EMF by their slope. Rotors of elastic axes are unknowns of
their own. Positions then move with the new velocity (semi-implicit Euler).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from samrl_core.blind_test.servo_worlds.drives import ServoDrive, rotors
from samrl_core.blind_test.servo_worlds.links import Link
from samrl_core.blind_test.servo_worlds.mechanisms import Mechanism
from samrl_core.blind_test.servo_worlds.stiction import hold_or_slip
from samrl_core.common.errors import InputError

SETTLE_S = 1.0  # under the first command, before the log begins
_SMOOTH = 0.01  # [rad/s] of the friction floor's sign
_FASTEST = 60.0

Law = Callable[[float, float, float], float]  # (t, position, velocity) -> torque against the motion
Torques = Callable[[float, list[float], list[float]], list[float]]


@dataclass(frozen=True)
class GearSpring:
    """Torque and its slope over the twist, and a damping."""

    torque: Callable[[float], tuple[float, float]]
    damping: float  # [N m s/rad]


@dataclass
class Machine:
    """A real machine: what differs from its description has been written into it. Lists (n,)."""

    links: tuple[Link, ...]
    drive: dict[str, Any]
    gravity: np.ndarray  # (3,)
    rotor: list[float]
    factor: list[float]  # of torque constants
    wider: list[float]  # half widths added to dead bands
    coulomb: list[float]  # friction floor
    viscous: list[float]
    dry: list[float]  # friction that holds a joint at rest
    friction: dict[int, list[Law]] = field(default_factory=dict)
    slip: dict[int, tuple[list[float], list[float], list[float]]] = field(
        default_factory=dict
    )  # k, most, bent
    spring: dict[int, GearSpring] = field(default_factory=dict)
    push: list[Torques] = field(default_factory=list)
    # (time (N,), asked (N, n)) -> as it reaches the drive
    asked: list[Callable[[np.ndarray, np.ndarray], np.ndarray]] = field(default_factory=list)
    given: list[Callable[[float, list[float]], list[float]]] = field(default_factory=list)  # to the motor
    # (t, position, velocity) -> as measured
    read: list[Callable[[float, list[float], list[float]], tuple[list[float], list[float]]]] = field(
        default_factory=list
    )


@dataclass(frozen=True, eq=False)
class Log:
    """Samples at the drive's ticks, (N,) and (N, n)."""

    time: np.ndarray
    position: np.ndarray  # as the encoder reads it, not yet in counts
    velocity: np.ndarray
    out: np.ndarray  # u, V, i or the position stepped to
    current: np.ndarray  # [A] of kinds with back-EMF, else zero


def nominal_machine(mechanism: Mechanism, drive: dict[str, Any]) -> Machine:
    """The machine as described."""
    n = len(mechanism.links)
    return Machine(
        mechanism.links, dict(drive), np.array([0.0, 0.0, -9.80665]), rotors(drive),
        [1.0] * n, [0.0] * n, [0.0] * n, [link.damping for link in mechanism.links],
        [link.friction for link in mechanism.links],
    )  # fmt: skip


def run_machine(
    mechanism: Mechanism, machine: Machine, time: np.ndarray, asked: np.ndarray, start: list[float],
    noise: tuple[float, float], rng: np.random.Generator,
) -> Log:  # fmt: skip
    """Log of what is asked (N, n) at the drive's period.

    Args:
        start: positions at rest.
        noise: standard deviations of the encoder's position and velocity.

    Raises:
        RanAwayError: it left all bounds.
    """
    period, n = float(machine.drive["period_s"]), len(machine.links)
    for change in machine.asked:
        asked = change(time, asked)
    rate = np.gradient(asked, time, axis=0)
    drive = ServoDrive(machine.drive, machine.factor, machine.wider)
    body = _Body(mechanism, machine, drive, start)
    steps = max(1, math.ceil(period / (0.00025 if machine.spring else 0.0005)))
    settle, count = round(SETTLE_S / period), len(time)
    sizes = np.array(noise)[:, None, None] * rng.normal(size=(2, settle + count, n))
    out = np.zeros((4, count, n))
    still = np.zeros(n)
    for k in range(-settle, count):
        t, row = k * period, max(k, 0)
        q, v = body.measured()
        for read in machine.read:
            q, v = read(t, q, v)
        q = [a + b for a, b in zip(q, sizes[0, k + settle].tolist(), strict=True)]
        v = [a + b for a, b in zip(v, sizes[1, k + settle].tolist(), strict=True)]
        if not sum(x * x for x in v) < _FASTEST**2:  # NaN fails as well
            raise RanAwayError(f"{mechanism.name} ran away at {t:.3f} s; narrow the disturbance's range")
        sent = drive.tick(asked[row].tolist(), (rate[row] if k >= 0 else still).tolist(), q, v)
        given = sent
        for stage in machine.given:
            given = stage(t, given)
        if k >= 0:
            out[0, k], out[1, k], out[2, k] = q, v, sent
            if "resistance" in machine.drive:
                out[3, k] = [drive.current(i, given[i], body.turning[i]) for i in range(n)]
        for _ in range(steps):
            body.step(t, given, period / steps)
    return Log(time, out[0], out[1], out[2], out[3])


class RanAwayError(InputError):
    """A servo world left all bounds; its ranges must be mended, not its seed."""


class _Body:
    """State of links and rotors."""

    def __init__(self, mechanism: Mechanism, machine: Machine, drive: ServoDrive, start: list[float]) -> None:
        self._m, self._drive, self._motion = machine, drive, mechanism.motion(machine.links)
        self._n = len(start)
        self._q, self._v = list(start), [0.0] * self._n
        self._elastic = sorted(machine.spring)
        self._theta, self.turning = list(start), [0.0] * self._n  # of rotors
        self._passes = 2 if machine.friction or machine.slip or machine.spring else 1
        self._held = [0.0] * self._n  # torque of dry friction
        self._at_link = machine.drive.get("encoder") == "link"

    def measured(self) -> tuple[list[float], list[float]]:
        """Position and velocity where the encoders sit."""
        if self._at_link:
            return list(self._q), list(self._v)
        return list(self._theta), list(self.turning)

    def step(self, t: float, given: list[float], dt: float) -> None:
        """Advance by dt under held outputs."""
        m, n, elastic = self._m, self._n, self._elastic
        mass, bias = self._motion(self._q, self._v, m.gravity)
        load = [-b for b in bias]
        for push in m.push:
            load = [a + b for a, b in zip(load, push(t, self._q, self._v), strict=True)]
        size = n + len(elastic)
        link, turning = self._v, self.turning
        end = np.zeros(size)
        for _ in range(self._passes):
            left, right = np.zeros((size, size)), np.zeros(size)
            for i in range(n):
                for j in range(n):
                    left[i, j] = mass[i][j]
                    right[i] += mass[i][j] * self._v[j]
                right[i] += dt * load[i]
                row = n + elastic.index(i) if i in m.spring else i
                a, c = self._motor(t, i, given[i], turning[i], dt)
                left[row, row] += m.rotor[i] + dt * c
                right[row] += m.rotor[i] * self.turning[i] + dt * a
                if i in m.spring:
                    self._couple(i, row, link[i], turning[i], dt, left, right)
            end = self._rub(left, right, dt) if any(m.dry) else np.linalg.solve(left, right)
            link = end[:n].tolist()
            turning = [float(end[n + elastic.index(i)]) if i in m.spring else link[i] for i in range(n)]
        self._v, self.turning = link, turning
        self._q = [q + dt * v for q, v in zip(self._q, link, strict=True)]
        self._theta = [q + dt * v for q, v in zip(self._theta, turning, strict=True)]
        for i, (_, most, bent) in m.slip.items():
            bent[:] = [min(max(b + dt * turning[i], -x), x) for b, x in zip(bent, most, strict=True)]

    def _rub(self, left: np.ndarray, right: np.ndarray, dt: float) -> np.ndarray:
        """Velocities at the step's end with dry friction, at each axis where its motor is."""
        rows = [self._n + self._elastic.index(i) if i in self._elastic else i for i in range(self._n)]
        inverse = np.linalg.inv(left)
        free = (inverse @ right)[rows]
        self._held = hold_or_slip(free, dt * inverse[np.ix_(rows, rows)], self._m.dry, self._held)
        push = right.copy()
        push[rows] -= dt * np.array(self._held)
        return inverse @ push

    def _motor(self, t: float, i: int, given: float, guess: float, dt: float) -> tuple[float, float]:
        """(a, c) of motor torque less friction."""
        m = self._m
        a, c = self._drive.torque(i, given, self._theta[i], dt)
        speed = guess if abs(guess) > 1e-6 else math.copysign(1e-6, guess)
        c += m.viscous[i] + m.coulomb[i] * math.tanh(speed / _SMOOTH) / speed
        for law in m.friction.get(i, ()):
            c += max(law(t, self._theta[i], speed) / speed, 0.0)
        if i in m.slip:
            for k, most, bent in zip(*m.slip[i], strict=True):
                at = bent + guess * dt
                if abs(at) < most:
                    a, c = a - k * bent, c + k * dt
                else:
                    a -= k * math.copysign(most, at)
        return a, c

    def _couple(
        self, i: int, row: int, link: float, rotor: float, dt: float, left: np.ndarray, right: np.ndarray
    ) -> None:
        """A spring between link i and its rotor, by its slope at the twist that is expected."""
        spring, rate = self._m.spring[i], rotor - link
        torque, slope = spring.torque(self._theta[i] - self._q[i] + dt * rate)
        fixed, stiff = torque - slope * dt * rate, slope * dt + spring.damping
        right[i] += dt * fixed
        right[row] -= dt * fixed
        left[i, i] += dt * stiff
        left[row, row] += dt * stiff
        left[i, row] -= dt * stiff
        left[row, i] -= dt * stiff
