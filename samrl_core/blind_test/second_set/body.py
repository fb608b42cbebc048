"""Loads, bodies and mounts: five families.

Sources: textbook rigid bodies; a tool in a soft grip as a mass on springs (Den Hartog 1956, ch. 3); hoses
that stiffen and rub (Bittencourt and Axelsson 2014 name them as a load).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import (
    Disturbance,
    Injection,
    Quantity,
    Site,
    log_quantile,
    quantile,
)
from samrl_core.blind_test.engines.arm_body import (
    ArmBody,
    MovingLink,
    join_mass,
    read_arm_body,
    scaled_inertia,
)
from samrl_core.blind_test.engines.hooks import Hooks, MountSpring
from samrl_core.blind_test.second_set.friction import slip_elements
from samrl_core.blind_test.second_set.sizes import between, either_sign, friction_share, moved
from samrl_core.cell.types.pose import Pose

_IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
_G = 9.80665


class SwingingMass:
    """A point mass held at a point of the flange by three damped springs; it pushes back on the arm."""

    def __init__(self, site: Site, mass: float, grip: np.ndarray, frequency: float, damping: float) -> None:
        """Of a mass [kg] gripped at `grip` (3,) in the flange frame [m]."""
        self._site, self._mass, self._grip = site, mass, grip
        omega = 2.0 * math.pi * frequency
        self._k, self._d = mass * omega**2, 2.0 * damping * mass * omega
        self._at = self._velocity = np.zeros(3)
        self._last: float | None = None

    def push(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Torques (J,) on the links."""
        origin, rotation, jacobian = self._site.model.flange_and_jacobian(q)
        arm = rotation @ self._grip
        grip, moving = origin + arm, jacobian @ v
        grip_velocity = moving[:3] + np.cross(moving[3:], arm)
        weight = np.array([0.0, 0.0, -self._mass * _G])
        if self._last is None:  # hanging at rest
            self._at, self._velocity = grip + weight / self._k, grip_velocity
        elif (dt := t - self._last) > 0.0:  # once per period, however finely the arm is stepped
            pull = self._k * (grip - self._at) + self._d * (grip_velocity - self._velocity)
            self._velocity = self._velocity + dt * (pull + weight) / self._mass
            self._at = self._at + dt * self._velocity
        self._last = t
        force = self._k * (self._at - grip) + self._d * (self._velocity - grip_velocity)
        return jacobian.T @ np.concatenate([force, np.cross(arm, force)])


def _payload(site: Site, form: str, severity: float) -> Injection:
    """A load in a soft grip: its weight and its point are a payload's, and it swings at some hertz."""
    mass = quantile(severity, 0.05, 1.0)
    grip = np.append(site.rng.uniform(-0.03, 0.03, size=2), between(site, 0.03, 0.09))
    frequency, damping = between(site, 7.0, 14.0), between(site, 0.15, 0.4)

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        if mass > 0:
            hooks.external.append(SwingingMass(site, mass, grip, frequency, damping).push)

    parameters = {
        "mass": Quantity(mass, "kg"),
        **{f"com_{axis}": Quantity(float(c), "m") for axis, c in zip("xyz", grip, strict=True)},
        "swing": Quantity(frequency, "Hz"),
    }
    return Injection(parameters, attach)


def _link_inertia(site: Site, form: str, severity: float) -> Injection:
    """A lump bolted to a link, or a link lighter than drawn; mass, centre and inertia go together."""
    error = quantile(severity, 0.04, 0.2)
    lighter = site.rng.random() < 0.3
    offset = site.rng.normal(size=3)
    offset *= between(site, 0.06, 0.11) / float(np.linalg.norm(offset))

    def alter(body: ArmBody) -> ArmBody:
        index = body.mount_joints + site.joint
        link = body.links[index]
        if lighter:
            inertia = scaled_inertia(link.inertia, np.full(3, 1.0 - error))
            moved_to = link.center_of_mass + 0.2 * error * offset
            changed = replace(link, mass=link.mass * (1 - error), inertia=inertia, center_of_mass=moved_to)
        else:
            lump = Pose(link.center_of_mass + offset, _IDENTITY)
            mass = error * link.mass
            changed = join_mass(link, mass, np.zeros(3), mass * 0.03**2 * 0.4 * np.eye(3), lump)
        return replace(body, links=(*body.links[:index], changed, *body.links[index + 1 :]))

    signed = -error if lighter else error
    return Injection({"mass_error": Quantity(signed, "1")}, lambda hooks, rng: hooks.body.append(alter))


def _tilt(site: Site, form: str, severity: float) -> Injection:
    """A base that leans: there is one formula, g' = R' g."""
    size, angle = log_quantile(severity, 0.0018, 0.035), between(site, -math.pi, math.pi)
    ax, ay = size * math.cos(angle), size * math.sin(angle)
    turn = Pose(np.zeros(3), np.append(_sine_part(ax, ay, size), math.cos(0.5 * size))).rotation

    def lean(t: float, gravity: np.ndarray) -> np.ndarray:
        return turn.T @ gravity

    parameters = {"ax": Quantity(ax, "rad"), "ay": Quantity(ay, "rad")}
    return Injection(parameters, lambda hooks, rng: hooks.gravity.append(lean))


def _sine_part(ax: float, ay: float, size: float) -> np.ndarray:
    return np.zeros(3) if size == 0 else math.sin(0.5 * size) * np.array([ax, ay, 0.0]) / size


def _mount(site: Site, form: str, severity: float) -> Injection:
    """A table that sways: two horizontal springs under it, unequal, and harder the more they are bent."""
    frequency = 300.0 if severity == 0 else 24.0 * (4.0 / 24.0) ** severity
    unequal, damping = between(site, 1.1, 1.4), between(site, 0.02, 0.06)
    table = between(site, 15.0, 40.0)  # [kg]

    def stand(body: ArmBody) -> ArmBody:
        first = MovingLink(
            "sway_x_link", "sway_x", Pose.identity(), np.array([1.0, 0, 0]), 0.5 * table, np.zeros(3),
            0.05 * table * np.eye(3), slides=True,
        )  # fmt: skip
        second = replace(first, name="sway_y_link", joint="sway_y", axis=np.array([0, 1.0, 0]))
        return replace(body, links=(first, second, *body.links), mount_joints=body.mount_joints + 2)

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.body.append(stand)
        total = table + read_arm_body(site.spec).mass
        for factor in (1.0, unequal):
            omega = 2.0 * math.pi * frequency * factor
            hooks.mount.append(MountSpring(total * omega**2, 2.0 * damping * total * omega, 2e3))

    parameters = {"frequency": Quantity(frequency, "Hz"), "damping": Quantity(damping, "1")}
    return Injection(parameters, attach)


class Hose:
    """A hose: a spring that stiffens with its stretch, and slip elements for its rubbing in a guide."""

    def __init__(self, joint: int, stiffness: float, middle: float, reach: float, loop: float) -> None:
        """Of k [N m/rad] about `middle` [rad], half stiffer at `reach` [rad], a loop's height [N m]."""
        ks, yields = slip_elements(max(loop, 1e-12) / 0.02, max(loop, 1e-12))
        self._joint, self._k, self._middle, self._reach = joint, stiffness, middle, reach
        self._ks, self._most = ks, yields / ks
        self._bent, self._q = np.zeros(6), 0.0
        self._begun = False

    def push(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Torques (J,) on the links."""
        at = float(q[self._joint])
        step = at - self._q if self._begun else 0.0
        self._begun, self._q = True, at
        self._bent = np.clip(self._bent + step, -self._most, self._most)
        x = at - self._middle
        torque = np.zeros(len(q))
        spring = self._k * x * (1.0 + 0.5 * (x / self._reach) ** 2)
        torque[self._joint] = -spring - float(self._ks @ self._bent)
        return torque


def _cable(site: Site, form: str, severity: float) -> Injection:
    """A hose that stiffens as it is stretched, with a loop from rubbing."""
    stiffness = quantile(severity, 0.2, 2.5) * friction_share(site)
    middle, half = moved(site)
    slack = middle + either_sign(site) * between(site, 0.2, 0.8) * max(half, 0.3)
    reach, loop = 2.0 * max(half, 0.3), 0.12 * stiffness

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.external.append(Hose(site.joint, stiffness, slack, reach, loop).push)

    parameters = {
        "k": Quantity(stiffness, "N m/rad"),
        "q0": Quantity(slack, "rad"),
        "h": Quantity(loop, "N m"),
    }
    return Injection(parameters, attach)


FAMILIES = (
    Disturbance("payload", "arm", _payload, "link"),
    Disturbance("link_inertia", "link", _link_inertia, "link", first_joint=1),
    Disturbance("base_tilt", "arm", _tilt, "link"),
    Disturbance("mount_compliance", "arm", _mount, "link"),
    Disturbance("cable", "joint", _cable, "link"),
)
