"""One-axis machines with the drives that are sold, by a simulation of their own: plain NumPy alone.

A motor turns a pendulum through a gear. Heun's rule at 100 us on explicit laws; the product's simulator takes
implicit steps of a controller period. Controllers are written from the data sheets' formulas, in volts and
amperes, not from the product's common law. Many machines run side by side as arrays (B,).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.signal import lfilter

from samrl_core.cell.types.arm_description import ArmDescription, Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.cell.types.controllers import controller_from

Path = Callable[[np.ndarray], np.ndarray]
STEP_S = 1e-4
JOINT = "swing"
# names of the gains and of the limit
LOOPS = {
    "position_servo": ("stiffness", "damping", "integral", "effort_limit"),
    "voltage_servo": ("proportional", "derivative", "integral", "voltage_limit"),
}
COUNTS = 4096  # of the servos' encoder per revolution


@dataclass(frozen=True)
class Differs:
    """How a real machine differs from its description; neutral by default."""

    viscous: float = 0.0  # [N m s/rad]
    coulomb: float = 0.0  # [N m]
    dead_band: float = 0.0  # added half width [rad]
    backlash: float = 0.0  # half width [rad]
    gain: float = 0.0  # of the drive's torque, relative
    supply: float = 0.0  # of the voltage that a duty cycle stands for, relative
    proportional: float = 0.0  # of the position loop, relative
    delay: float = 0.0  # of the command [s]
    cutoff: float = np.inf  # of a filter of first order on the command [Hz]
    tight: tuple[float, float, float] = (0.0, 1.0, 0.01)  # spots: friction [N m], order [1/rad], turn [rad/s]


@dataclass(frozen=True)
class Machine:
    """A described machine; `about` is its controller's text."""

    about: dict[str, Any]
    mass: float  # [kg] at the arm's end
    arm: float  # [m]
    inertia: float  # of the link about its centre [kg m2]
    rotor: float  # at the joint [kg m2]
    effort: float  # limit in the URDF [N m]
    rate: float  # of the log [Hz]
    paths: dict[str, Path]
    resolution: float = 0.0  # of the encoder [rad]
    records: str = ""  # effort that the log holds: torque at standstill, "current", or none
    speed_log: float = 0.0  # noise of a logged velocity [rad/s]; 0: none is logged
    off: tuple[float, float] = (np.inf, np.inf)  # torque is switched off between [s]
    tolerances: dict[str, float] = field(default_factory=dict)

    @property
    def open_loop(self) -> bool:
        """Whether its paths are signals to a motor, and no positions."""
        return self.about["type"] in ("voltage_motor", "current_motor")

    @property
    def urdf(self) -> str:
        """The nominal model: one link."""
        i = self.inertia
        return f"""<robot name="pendulum"><link name="base"/><link name="rod"><inertial>
<origin xyz="{self.arm} 0 0"/><mass value="{self.mass}"/>
<inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="{JOINT}" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="{self.effort}" velocity="10"/></joint></robot>"""

    def described(self) -> ArmDescription:
        """What the diagnosis is told."""
        tolerances = Tolerances.from_mapping(self.tolerances)
        about = {"joints": [JOINT], **self.about}
        return ArmDescription("tool_arm", (JOINT,), self.urdf, controller_from(about), None, tolerances)


class Drive:
    """Motor torque of B machines: called at every tick with what was read, and at every step with speeds."""

    def __init__(self, about: dict[str, Any], differs: Sequence[Differs]) -> None:
        self.about = about
        self.integral = np.zeros(len(differs))
        self.band = np.array([d.dead_band for d in differs])
        self.loop_gain = np.array([1.0 + d.proportional for d in differs])
        self.torque_gain = np.array([1.0 + d.gain for d in differs])
        self.supply = np.array([1.0 + d.supply for d in differs])
        self.ratio = self._one("gear_ratio", 1.0)

    def _one(self, name: str, default: float = 0.0) -> float:
        return float(self.about.get(name, [default])[0])

    def output(
        self, goal: np.ndarray, speed: np.ndarray, q: np.ndarray, dq: np.ndarray, dt: float
    ) -> np.ndarray:
        """Volts, amperes or torque that the loop asks for; `goal` is that signal where there is no loop."""
        kind, one = self.about["type"], self._one
        error = goal - q
        if kind in LOOPS:
            proportional, derivative, integral, limit = LOOPS[kind]
            wide = self.band + one("dead_band")
            error = np.where(np.abs(error) > wide, error - np.sign(error) * wide, 0.0)
            fixed = self.loop_gain * (one(proportional) * error + one("punch") * np.sign(error))
            fixed = fixed + one(derivative) * (one("velocity_feedforward") * speed - dq)
            return self._with_integral(fixed, one(integral) * error * dt, one(limit))
        if kind == "velocity_drive":
            wanted = (
                one("position_gain") * self.loop_gain * error + one("velocity_feedforward", 1.0) * speed - dq
            )
            step = one("integral") * wanted * dt
            return self._with_integral(one("velocity_gain") * wanted, step, one("effort_limit"))
        return goal

    def _with_integral(self, fixed: np.ndarray, step: np.ndarray, most: float) -> np.ndarray:
        ahead = fixed + self.integral + step
        winds = (np.abs(ahead) > most) & (ahead * step > 0)
        self.integral = np.where(winds, self.integral, self.integral + step)
        return np.clip(fixed + self.integral, -most, most)

    def torque(self, output: np.ndarray, q: np.ndarray, dq: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """At the joint, and what a current probe makes of it."""
        kind, one, n = self.about["type"], self._one, self.ratio
        if kind in ("voltage_servo", "voltage_motor"):
            constant = one("torque_constant")
            emf = one("back_emf_constant", constant)
            current = (self.supply * output - emf * n * dq) / one("resistance")
            return self.torque_gain * constant * n * current, constant * n * current
        if kind == "current_motor":
            torque = one("torque_constant") * n * output
            return self.torque_gain * torque, torque
        if kind == "stepper":
            full, micro = one("full_steps", 200.0), one("microsteps", 16.0)
            step = 2 * np.pi / (full * micro)
            rotor = np.round(output * n / step) * step - n * q
            torque = one("holding_torque") * n * np.sin(full / 4 * rotor)
            return self.torque_gain * torque - one("damping") * dq, torque
        return self.torque_gain * output, output

    def standstill(self, output: np.ndarray) -> np.ndarray:
        """The signal as torque at standstill: what a log of it is worth."""
        if self.about["type"] in ("voltage_servo", "voltage_motor"):
            return output * self._one("torque_constant") * self.ratio / self._one("resistance")
        if self.about["type"] == "current_motor":
            return output * self._one("torque_constant") * self.ratio
        return output


def worlds(
    machine: Machine, differs: Sequence[Differs], seed: int = 0, seconds: float = 10.0
) -> list[list[ArmRecording]]:
    """All paths of each real machine; the last path is the one to hold out."""
    rng = np.random.default_rng(seed)
    paths = list(machine.paths.values())
    many = [d for d in differs for _ in paths]
    time = np.arange(round(seconds / STEP_S)) * STEP_S
    real = RealMachines(machine, many, rng)
    late = [_filtered(path(np.maximum(time - d.delay, 0.0)), d.cutoff) for d in differs for path in paths]
    logged = real.run(np.stack(late, axis=1), rng)
    return [
        [
            _recording(machine, name, path, logged, i * len(paths) + k)
            for k, (name, path) in enumerate(machine.paths.items())
        ]
        for i in range(len(differs))
    ]


def _filtered(goals: np.ndarray, cutoff: float) -> np.ndarray:
    """Goals (steps,) behind a low-pass of first order, at rest on the first."""
    if not np.isfinite(cutoff):
        return goals
    keep = float(np.exp(-2 * np.pi * cutoff * STEP_S))
    return goals[0] + lfilter([1.0 - keep], [1.0, -keep], goals - goals[0])


class RealMachines:
    """B machines of one make, each with its own difference, mass and offset."""

    def __init__(self, machine: Machine, differs: Sequence[Differs], rng: np.random.Generator) -> None:
        count = len(differs)
        self.machine, self.drive = machine, Drive(machine.about, differs)
        self.viscous, self.coulomb, self.slack = (
            np.array([getattr(d, name) for d in differs]) for name in ("viscous", "coulomb", "backlash")
        )
        self.tight, self.order, self.turn = np.array([d.tight for d in differs]).T
        each = len(machine.paths)  # recordings of one real machine
        heavy = 1.0 + 0.005 * np.repeat(
            rng.uniform(-1, 1, count // each), each
        )  # within tolerance, and unknown
        self.offset = 0.001 * machine.effort * np.repeat(rng.uniform(-1, 1, count // each), each)
        self.link = machine.inertia + heavy * machine.mass * machine.arm**2
        self.weight = 9.81 * heavy * machine.mass * machine.arm
        self.teeth = 200.0 * machine.effort

    def accelerations(
        self, state: tuple[np.ndarray, ...], output: np.ndarray, on: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Of link and motor."""
        q, w, qm, wm = state
        rubs = self.viscous * wm + self.coulomb * np.tanh(wm / 0.01)
        rubs = rubs + self.tight * (0.15 + np.cos(0.5 * self.order * qm) ** 4) * np.tanh(wm / self.turn)
        torque = on * self.drive.torque(output, qm, wm)[0] + self.offset - rubs
        load = self.weight * np.cos(q)  # level at zero, hanging at a quarter turn
        together = (torque + load) / (self.machine.rotor + self.link)
        if not np.any(self.slack > 0):
            return together, together
        twist = qm - q
        touching = np.abs(twist) > self.slack
        spring = self.teeth * (twist - np.clip(twist, -self.slack, self.slack))
        spring = spring + np.where(touching, 0.002 * self.teeth * (wm - w), 0.0)
        apart = self.slack > 0
        return (
            np.where(apart, (spring + load) / self.link, together),
            np.where(apart, (torque - spring) / self.machine.rotor, together),
        )

    def run(self, goals: np.ndarray, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """Logged position, velocity and effort (T, B) under goals (steps, B)."""
        machine, drive, h = self.machine, self.drive, STEP_S
        rates = np.gradient(goals, h, axis=0)
        at_once = machine.about["type"] == "stepper"
        every = 1 if at_once else round(machine.about.get("period_s", 0.001) / h)
        log = round(1.0 / machine.rate / h)
        q = np.full(goals.shape[1], np.pi / 2) if machine.open_loop else goals[0].copy()
        state = (q, np.zeros_like(q), q, np.zeros_like(q))
        output, rows = np.zeros_like(q), []
        for k in range(len(goals)):
            on = 0.0 if machine.off[0] <= k * h < machine.off[1] else 1.0
            if k % every == 0:
                output = drive.output(goals[k], rates[k], self._read(state[2]), state[3], every * h)
                drive.integral = on * drive.integral
            if k % log == 0:
                known = (
                    drive.torque(output, state[2], state[3])[1]
                    if machine.records == "current"
                    else drive.standstill(output)
                )
                rows.append((self._read(state[2]), state[3], on * known))
            a, am = self.accelerations(state, output, on)
            q, w, qm, wm = state
            middle = (q + h * w, w + h * a, qm + h * wm, wm + h * am)
            b, bm = self.accelerations(middle, output, on)
            w_next, wm_next = w + 0.5 * h * (a + b), wm + 0.5 * h * (am + bm)
            state = (q + 0.5 * h * (w + w_next), w_next, qm + 0.5 * h * (wm + wm_next), wm_next)
        position, velocity, effort = (np.array(x) for x in zip(*rows, strict=True))
        shape = position.shape
        return {
            "position": position if machine.resolution else position + 2e-5 * rng.standard_normal(shape),
            "velocity": velocity + machine.speed_log * rng.standard_normal(shape),
            "effort": effort + 0.002 * machine.effort * rng.standard_normal(shape),
        }

    def _read(self, position: np.ndarray) -> np.ndarray:
        step = self.machine.resolution
        return np.round(position / step) * step if step else position


def _recording(
    machine: Machine, name: str, path: Path, logged: dict[str, np.ndarray], k: int
) -> ArmRecording:
    time = np.arange(len(logged["position"])) / machine.rate
    q, v, u = (logged[key][:, [k]] for key in ("position", "velocity", "effort"))
    goal = path(time)[:, None]
    command = JointSignal(time, goal, np.gradient(goal, 1.0 / machine.rate, axis=0))
    flags = None
    if np.isfinite(machine.off[0]):
        flags = JointSignal(np.array([0.0, *machine.off]), effort=np.array([[1.0], [0.0], [1.0]]))
    return ArmRecording(
        name, f"{name}.mcap", "0" * 64, machine.described(),
        JointSignal(time, q, v if machine.speed_log else None),
        None if machine.open_loop else command,
        JointSignal(time, effort=u) if machine.records else None,
        torque_enabled=flags,
    )  # fmt: skip
