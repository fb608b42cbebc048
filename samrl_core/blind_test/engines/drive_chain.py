"""From drive torque to joint torque, one step at a time: rotors, friction, transmissions, mount, engine.

Plain floats and lists all through: with seven joints, an array costs more than what is reckoned with it.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg.lapack import dposv  # ty: ignore[missing-module-member]

from samrl_core.blind_test.engines.dry_friction import DryFriction
from samrl_core.blind_test.engines.engine import Engine
from samrl_core.blind_test.engines.hooks import Hooks


class DriveChain:
    """Friction and contact are integrated implicitly, linearised about the end of the step."""

    def __init__(
        self,
        engine: Engine,
        hooks: Hooks,
        mount_joints: int,
        rotor: np.ndarray,
        coulomb: np.ndarray,
        viscous: np.ndarray,
        stribeck_velocity: float,
        start: np.ndarray,
        load: np.ndarray,
        dry: np.ndarray,
    ) -> None:
        """An arm at rest at `start` (J,) that carries `load` (J,).

        Args:
            engine: placed at `start`, the mount unbent.
            hooks: of the recording.
            mount_joints: how many joints stand before the arm's.
            rotor: inertias (J,) [kg m2].
            coulomb, viscous: friction floor (J,) that the engine does not take itself.
            stribeck_velocity: at which the floor's sign is smoothed [rad/s].
            start: joint positions [rad].
            load: link-side torques at rest [N m].
            dry: friction (J,) that holds joints at rest, beside that floor; (0,) without any [N m].
        """
        self._engine, self._hooks, self._mount = engine, hooks, mount_joints
        self._dt, self._joints = engine.timestep, len(start)
        self._elastic = sorted(hooks.transmission)
        self._rotor = rotor.tolist()
        rigid = [0.0 if i in hooks.transmission else r for i, r in enumerate(self._rotor)]
        self._rigid_rotor = [0.0] * mount_joints + rigid
        self._viscous = viscous.tolist()
        self._coulomb_gradient = (coulomb / stribeck_velocity).tolist() if coulomb.any() else None
        self._stribeck_velocity = stribeck_velocity
        self._friction = list(hooks.friction.items())
        self._dry = DryFriction(dry)
        self._rigid = [i for i in range(self._joints) if i not in hooks.transmission]
        self._springs = list(enumerate(hooks.mount))
        self._passes = 2 if self._friction or self._elastic else 1  # the floor alone is smooth enough for one
        self._theta, self._omega = (
            start.tolist(),
            [0.0] * self._joints,
        )  # of rotors; stored for elastic joints
        self._load = load.tolist()
        for i in self._elastic:
            self._theta[i] += hooks.transmission[i].rest_twist(self._load[i])
        self._guess = [0.0] * self._joints  # of rotor velocity at the step's end
        self._link_guess = [0.0] * (mount_joints + self._joints)

    def rotors(self) -> tuple[list[float], list[float]]:
        """Position and velocity of the rotors, where the encoders sit."""
        position, velocity = self._engine.position[self._mount :], self._engine.velocity[self._mount :]
        for i in self._elastic:
            position[i], velocity[i] = self._theta[i], self._omega[i]
        return position, velocity

    def step(self, t: float, drive: np.ndarray, effort: np.ndarray) -> list[float]:
        """Advance one step of the engine under `drive` (J,); returns the torques that the links got [N m].

        `effort` (J,) is what was commanded, for disturbances that depend on it.
        """
        mount, dt, engine = self._mount, self._dt, self._engine
        mass, bias = engine.dynamics()
        diagonal = mass.ravel()[:: len(bias) + 1]
        bare = diagonal.copy()
        velocity = engine.velocity
        q_rotor, v_rotor = self.rotors()
        for more in self._hooks.rotor_torque:
            drive = drive + more(t, np.array(q_rotor), np.array(v_rotor), effort)
        turning = drive.tolist()
        beside = self._beside(t)
        a: list[float] = []
        c: list[float] = []
        acceleration: list[float] = []
        for _ in range(self._passes):
            a, c, solved = self._linear(t, q_rotor, turning)
            diagonal[:] = bare + [r + dt * x for r, x in zip(self._rigid_rotor, c, strict=True)]
            push = a if beside is None else [x + y for x, y in zip(a, beside, strict=True)]
            free = [p - b - x * v for p, b, x, v in zip(push, bias, c, velocity, strict=True)]
            # Positive definite: LAPACK straight, a third of numpy's time for such small systems.
            acceleration = dposv(mass, free)[1].tolist()
            self._link_guess = [v + dt * x for v, x in zip(velocity, acceleration, strict=True)]
            self._guess = self._link_guess[mount:]
            for i, a_spring, c_spring, stiff, freely in solved:
                push = freely - a_spring + c_spring * self._link_guess[mount + i]
                if self._dry:
                    push = self._dry.stop(i, push + self._dry.torque[i])
                self._guess[i] = push / stiff
        rubbed = self._rub(mass, velocity, acceleration) if self._dry else None
        applied = [x - y * v for x, y, v in zip(a, c, self._link_guess, strict=True)]
        if rubbed is not None:
            applied = [x - y for x, y in zip(applied, rubbed, strict=True)]
        if beside is not None:
            applied = [x + y for x, y in zip(applied, beside, strict=True)]
        self._commit(t, q_rotor)
        passed = engine.step(applied, self._rigid_rotor, acceleration)
        if beside is not None:
            passed = [x - y for x, y in zip(passed, beside, strict=True)]
        self._load = passed[mount:]
        return self._load

    def _rub(self, mass: np.ndarray, velocity: list[float], acceleration: list[float]) -> list[float]:
        """Dry friction (n,) of rigid joints; the step's accelerations and guesses are changed by it."""
        rows = [self._mount + i for i in self._rigid]
        inverse = np.linalg.inv(mass)
        free = np.array([velocity[r] + self._dt * acceleration[r] for r in rows])
        held = self._dry.stop_together(self._rigid, free, self._dt * inverse[np.ix_(rows, rows)])
        taken = inverse[:, rows] @ held
        torques = [0.0] * len(velocity)
        for row, torque in zip(rows, held.tolist(), strict=True):
            torques[row] = torque
        for row, less in enumerate(taken.tolist()):
            acceleration[row] -= less
            self._link_guess[row] -= self._dt * less
        for i in self._rigid:
            self._guess[i] = self._link_guess[self._mount + i]
        return torques

    def _beside(self, t: float) -> list[float] | None:
        """Torques on the links past the sensors, mount included; None without any."""
        if not self._hooks.external:
            return None
        position = np.array(self._engine.position[self._mount :])
        velocity = np.array(self._engine.velocity[self._mount :])
        total = np.zeros(self._joints)
        for push in self._hooks.external:
            total = total + push(t, position, velocity)
        return [0.0] * self._mount + total.tolist()

    def _friction_gradient(self) -> list[float]:
        """Secant gradient of the friction torque at the guessed velocities [N m s/rad]."""
        if self._coulomb_gradient is None:
            return self._viscous.copy()
        gradients = []
        for c, d, v in zip(self._coulomb_gradient, self._viscous, self._guess, strict=True):
            ratio = max(abs(v) / self._stribeck_velocity, 1e-6)
            gradients.append(c * math.tanh(ratio) / ratio + d)
        return gradients

    def _linear(
        self, t: float, q_rotor: list[float], turning: list[float]
    ) -> tuple[list[float], list[float], list[tuple[int, float, float, float, float]]]:
        """Effort of all joints as a - c v' of the end velocity v', and what gives elastic rotors theirs."""
        mount, dt, guess = self._mount, self._dt, self._guess
        gradient = self._friction_gradient()
        driven = turning.copy()
        for i, elements in self._friction:
            for element in elements:
                a_friction, c_friction = element.linear(t, q_rotor[i], guess[i], self._load[i], dt)
                driven[i] -= a_friction
                gradient[i] += c_friction
        a, c = [0.0] * mount + driven, [0.0] * mount + gradient
        position = self._engine.position
        solved = []
        for i in self._elastic:
            twist = self._theta[i] - position[mount + i]
            rate = guess[i] - self._link_guess[mount + i]
            a_spring, c_spring = self._hooks.transmission[i].linear(t, twist, rate, dt)
            inertia = self._rotor[i] / dt
            stiff = inertia + gradient[i] + c_spring
            freely = inertia * self._omega[i] + driven[i] - (self._dry.torque[i] if self._dry else 0.0)
            solved.append((i, a_spring, c_spring, stiff, freely))
            a[mount + i] = a_spring + c_spring * (freely - a_spring) / stiff
            c[mount + i] = c_spring * (1.0 - c_spring / stiff)
        for i, spring in self._springs:
            hard = spring.stiffness * (1.0 + spring.hardening * position[i] ** 2)
            a[i] = -hard * position[i]
            c[i] = spring.damping + dt * hard
        return a, c, solved

    def _commit(self, t: float, q_rotor: list[float]) -> None:
        """The step is decided: friction, transmissions and elastic rotors move on."""
        dt = self._dt
        for i, elements in self._friction:
            for element in elements:
                element.commit(t, q_rotor[i], self._guess[i], self._load[i], dt)
        for i in self._elastic:
            rate = self._guess[i] - self._link_guess[self._mount + i]
            twist = self._theta[i] - self._engine.position[self._mount + i]
            self._hooks.transmission[i].commit(t, twist, rate, dt)
            self._omega[i] = self._guess[i]
            self._theta[i] += dt * self._omega[i]
