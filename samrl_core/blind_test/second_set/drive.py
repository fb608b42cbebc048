"""What happens to commands and torques before the gears: nine families.

Sources: Gilbert 1960 and Elliott 1963 (losses come in bursts); Butterworth 1930; Spong and Vidyasagar 1989
(drives).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.signal import butter, sosfilt

from samrl_core.blind_test.disturbances.disturbance import (
    Disturbance,
    Injection,
    Quantity,
    Site,
    log_quantile,
    quantile,
)
from samrl_core.blind_test.engines.hooks import Hooks, Law
from samrl_core.blind_test.second_set.sizes import between, either_sign, friction_share
from samrl_core.cell.types.arm_recording import JointSignal

_PERIOD = 0.001  # [s] of the cell's controllers


def _chosen(site: Site) -> np.ndarray:
    """Joints (J,) that are meant; all where the place is the arm."""
    joints = np.arange(len(site.armature))
    return np.full(len(joints), True) if site.joint < 0 else joints == site.joint


def _ripple(site: Site, form: str, severity: float) -> Injection:
    """Two teeth's harmonics, the second a third as high, growing with the load that the teeth carry."""
    amplitude = quantile(severity, 0.1, 1.0) * friction_share(site)
    order = float(2 * site.rng.integers(30, 111))
    phase, second = between(site, -math.pi, math.pi), between(site, -math.pi, math.pi)
    usual, joint = max(float(site.peak_torque[site.joint]), 0.1), site.joint

    def push(t: float, q: np.ndarray, v: np.ndarray, effort: np.ndarray) -> np.ndarray:
        angle = order * q[joint]
        wave = math.sin(angle + phase) + math.sin(2.0 * angle + second) / 3.0
        torque = np.zeros(len(q))
        torque[joint] = amplitude * wave * (0.85 + 0.3 * min(abs(effort[joint]) / usual, 1.0))
        return torque

    parameters = {
        "amplitude": Quantity(amplitude, "N m"),
        "order": Quantity(order, "1/rad"),
        "phase": Quantity(phase, "rad"),
    }
    return Injection(parameters, lambda hooks, rng: hooks.rotor_torque.append(push))


def _reflected_inertia(site: Site, form: str, severity: float) -> Injection:
    """More rotor: there is one formula."""
    usual = float(site.armature[site.joint])
    more = np.zeros(len(site.armature))
    more[site.joint] = log_quantile(severity, 0.3 * usual, 4.0 * usual)
    parameters = {"Ja": Quantity(float(more[site.joint]), "kg m2")}
    return Injection(parameters, lambda hooks, rng: hooks.rotor_inertia.append(more))


def _gain(site: Site, form: str, severity: float) -> Injection:
    """A wrong torque constant, too large or too small: there is one formula."""
    error = either_sign(site) * quantile(severity, 0.02, 0.12)
    factors = np.ones(len(site.armature))
    factors[site.joint] += error
    return Injection(
        {"e": Quantity(error, "1")}, lambda hooks, rng: hooks.drive.append(lambda t, effort: factors * effort)
    )


def _offset(site: Site, form: str, severity: float) -> Injection:
    """A current sensor's zero: there is one formula."""
    offset = np.zeros(len(site.armature))
    offset[site.joint] = either_sign(site) * quantile(severity, 0.4, 2.0) * site.size
    return Injection(
        {"b": Quantity(float(offset[site.joint]), "N m")},
        lambda hooks, rng: hooks.drive.append(lambda t, effort: effort + offset),
    )


def _saturation(site: Site, form: str, severity: float) -> Injection:
    """A magnetic circuit that saturates: u / (1 + |u / L|^8)^(1/8)."""
    peak, still = float(site.peak_torque[site.joint]), float(site.gravity_torque[site.joint])
    floor = max(1.08 * still, 0.3 * peak)  # it must go on carrying the arm
    limit = max(peak - (0.1 + 0.5 * severity) * (peak - floor), floor) if severity > 0 else 20.0 * peak
    joint = site.joint

    def stage(t: float, effort: np.ndarray) -> np.ndarray:
        out = effort.copy()
        out[joint] = effort[joint] / (1.0 + abs(effort[joint] / limit) ** 8) ** 0.125
        return out

    return Injection({"L": Quantity(limit, "N m")}, lambda hooks, rng: hooks.drive.append(stage))


def _rate_limit(site: Site, form: str, severity: float) -> Injection:
    """A current loop short of voltage: it nears what is asked in 2 ms, but no quicker than R."""
    usual = float(site.peak_rate()[site.joint])
    rate = usual * (1.1 - 0.39 * severity) if severity > 0 else 1e6 * usual
    joint = site.joint

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        at: list[float] = []

        def stage(t: float, effort: np.ndarray) -> np.ndarray:
            asked = float(effort[joint])
            if not at:
                at.append(asked)
            step = rate * _PERIOD * math.tanh((asked - at[0]) / (rate * 0.002))
            at[0] = asked if severity == 0 else at[0] + step
            out = effort.copy()
            out[joint] = at[0]
            return out

        hooks.drive.append(stage)

    return Injection({"R": Quantity(rate, "N m/s")}, attach)


def _low_pass(site: Site, form: str, severity: float) -> Injection:
    """Second order, Butterworth, on what is commanded: position and velocity alike."""
    cutoff = 1e9 if severity == 0 else 100.0 * 0.03**severity
    chosen = _chosen(site)

    def shaped(command: JointSignal) -> JointSignal:
        if severity == 0:
            return command
        sections = butter(2, min(cutoff, 450.0), fs=1.0 / _PERIOD, output="sos")

        def through(values: np.ndarray | None) -> np.ndarray | None:
            if values is None:
                return None
            filtered = values[0] + np.asarray(sosfilt(sections, values - values[0], axis=0))
            return np.where(chosen, filtered, values)

        return replace(command, position=through(command.position), velocity=through(command.velocity))

    parameters = {"fc": Quantity(cutoff, "Hz"), "acts_on": Quantity("command", "channel")}
    return Injection(parameters, lambda hooks, rng: hooks.command.append(shaped))


def _delay(site: Site, form: str, severity: float) -> Injection:
    """A queue that is read between its entries: any delay, not whole periods alone."""
    delay, chosen = quantile(severity, 0.001, 0.025), _chosen(site)
    whole = int(delay / _PERIOD)
    part = delay / _PERIOD - whole

    def late(values: np.ndarray | None) -> np.ndarray | None:
        if values is None:
            return None
        queue = np.concatenate([np.repeat(values[:1], whole + 1, axis=0), values])
        count = len(values)
        read = (1.0 - part) * queue[1 : count + 1] + part * queue[:count]
        return np.where(chosen, read, values)

    def shaped(command: JointSignal) -> JointSignal:
        return replace(command, position=late(command.position), velocity=late(command.velocity))

    parameters = {"T": Quantity(delay, "s"), "acts_on": Quantity("command", "channel")}
    return Injection(parameters, lambda hooks, rng: hooks.command.append(shaped))


def _jitter(site: Site, form: str, severity: float) -> Injection:
    """A link with good and bad times (Gilbert, Elliott): in a bad one most packets are lost."""
    held = log_quantile(severity, 0.014, 0.25)
    lost, stay = 0.8, 1.0 - 1.0 / 6.0  # in bad times; these last 6 periods in the mean
    bad_share = min(held / lost, 0.5)
    enter = (1.0 - stay) * bad_share / (1.0 - bad_share)
    longest = 0.020  # [s] after which the drive asks again

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        state = {"bad": 0, "late": 0}
        last: list[np.ndarray] = []

        def stage(t: float, effort: np.ndarray) -> np.ndarray:
            first, second = rng.random(2)
            state["bad"] = int(first < (stay if state["bad"] else enter))
            missed = bool(last) and bool(state["bad"]) and second < lost
            late = state["late"] + 1 if missed else 0
            if missed and late * _PERIOD <= longest:
                state["late"] = late
                return last[0].copy()
            state["late"] = 0
            last[:] = [effort.copy()]
            return effort

        hooks.drive.append(stage)

    return Injection({"held": Quantity(held, "1"), "limit": Quantity(longest, "s")}, attach)


def _controller_gain(site: Site, form: str, severity: float) -> Injection:
    """Other gains than described, each with its own sign and size: there is one formula."""
    stiff = either_sign(site) * quantile(severity, 0.03, 0.3)
    damp = either_sign(site) * abs(stiff) * between(site, 0.4, 1.0)
    factors = np.ones((2, len(site.armature)))
    factors[:, site.joint] += (stiff, damp)

    def alter(law: Law, t: float) -> None:
        law.stiffness, law.damping = law.stiffness * factors[0], law.damping * factors[1]

    parameters = {"eK": Quantity(stiff, "1"), "eD": Quantity(damp, "1")}
    return Injection(parameters, lambda hooks, rng: hooks.law.append(alter))


FAMILIES = (
    Disturbance("gear_ripple", "joint", _ripple, "drive"),
    Disturbance("reflected_inertia", "joint", _reflected_inertia, "drive"),
    Disturbance("actuator_gain", "joint", _gain, "drive", onset=True),
    Disturbance("torque_saturation", "joint", _saturation, "drive", needs_reversal=True),
    Disturbance("torque_rate_limit", "joint", _rate_limit, "drive"),
    Disturbance("command_low_pass", "joint", _low_pass, "either", also_arm=True),
    Disturbance("command_delay", "joint", _delay, "either", also_arm=True),
    Disturbance("packet_jitter", "arm", _jitter, "drive"),
    Disturbance("controller_gain", "joint", _controller_gain, "controller", onset=True),
    Disturbance("torque_offset", "joint", _offset, "drive", onset=True),
)
