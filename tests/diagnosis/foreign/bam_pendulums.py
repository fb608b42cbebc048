"""Logs of servos on a pendulum by another author's simulator: nothing of this project makes their motion.

BAM (Rhoban, Apache-2.0, https://github.com/Rhoban/bam; Duclusaud et al., "Extended Friction Models for the
Physics Simulation of Servo Actuators", ICRA 2025) has friction models M1 to M6 with parameters identified on
real servos, the control laws of their firmware, and the trajectories that it identifies them with. It needs
NumPy alone: `pip install --ignore-requires-python --no-deps better-actuator-models==1.0.2`.

    python -m tests.diagnosis.foreign.bam_pendulums FOLDER

writes a folder per case: logs as BAM's own recorder writes them (JSON), a URDF and a mapping.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

STEP_S = 0.0005  # of BAM's Euler integration
LOG_HZ = 150.0  # about what its recorder reaches over a serial bus; every gap varies by 10 %
COUNTS = 4096  # of the encoder, per revolution
SPEED_STEP = 0.229 * 2.0 * np.pi / 60.0  # of the velocity register [rad/s] (ROBOTIS e-manual, XL330)
ROLES = {"sin_time_square": "fit", "up_and_down": "fit", "lift_and_drop": "fit", "sin_sin": "held_out"}


@dataclass(frozen=True)
class Case:
    """A servo with one of BAM's friction models, and what its user knows and does not know."""

    servo: str
    friction: str  # m1 to m6: what the simulated servo has
    mass: float  # [kg] at the end, as described
    arm_mass: float  # [kg]
    length: float  # [m]
    gain: float  # of the firmware, as described
    stated: bool = False  # whether the URDF states Coulomb and viscous friction
    real_mass: float | None = None  # where it differs from the description
    real_gain: float | None = None
    real_volts: float | None = None
    told_held: bool = False  # whether the mapping says that a goal is held


CASES = {
    "nothing wrong": Case("mx106", "m1", 1.0, 0.1, 0.2, 32, stated=True),
    "nothing wrong, goals told as held": Case("mx106", "m1", 1.0, 0.1, 0.2, 32, stated=True, told_held=True),
    "friction not modelled": Case("mx106", "m1", 1.0, 0.1, 0.2, 32),
    "drop at low speed": Case("mx106", "m2", 1.0, 0.1, 0.2, 32, stated=True),
    "gears under load": Case("mx64", "m3", 1.0, 0.1, 0.15, 32, stated=True),
    "all of M6": Case("mx106", "m6", 1.0, 0.1, 0.2, 32),
    "heavier by a quarter": Case("mx106", "m1", 1.0, 0.1, 0.2, 32, stated=True, real_mass=1.25),
    "11.5 V for 15": Case("mx106", "m1", 1.0, 0.1, 0.2, 16, stated=True, real_volts=11.5),
    "gain 12 for 16": Case("mx106", "m1", 1.0, 0.1, 0.2, 16, stated=True, real_gain=12),
    "harmonic drive, M1": Case("erob80_50", "m1", 8.0, 1.0, 0.5, 100),
    "harmonic drive, M4": Case("erob80_50", "m4", 8.0, 1.0, 0.5, 100),
    "small servo, M4, zero off": Case("xl330", "m4", 0.12, 0.02, 0.1, 400),
    "speed limit in the firmware": Case("feetech_sts3215_7_4V", "m1", 0.4, 0.05, 0.12, 32),
}


def write_case(case: Case, folder: Path, seed: int = 0) -> None:
    """Logs, URDF and mapping of a case. Raises ImportError without BAM."""
    from bam.model import load_model
    from bam.trajectory import trajectories

    folder.mkdir(parents=True, exist_ok=True)
    model = load_model(motor_name=case.servo, model=case.friction)
    rng = np.random.default_rng(seed)
    about = {"mass": case.mass, "arm_mass": case.arm_mass, "length": case.length, "kp": case.gain}
    real = {**about, "mass": case.real_mass or case.mass, "kp": case.real_gain or case.gain}
    mapping, urdf = _mapping(case, model, about), _urdf(case, model)  # before the supply is another
    for name in ROLES:
        entries = list(_logged(model, real, case.real_volts, trajectories[name], rng))
        text = json.dumps({**about, "motor": case.servo, "trajectory": name, "entries": entries})
        (folder / f"{name}.json").write_text(text)
    (folder / "pendulum.urdf").write_text(urdf)
    (folder / "mapping.yaml").write_text(yaml.safe_dump(mapping, sort_keys=False))


def _logged(
    model: Any, log: dict[str, float], volts: float | None, trajectory: Any, rng: np.random.Generator
) -> Iterator[dict[str, Any]]:
    """Entries as BAM's recorder writes them: the goal is held from one entry to the next."""
    from bam.simulate import Simulator

    simulator, actuator = Simulator(model), model.actuator
    actuator.load_log(log)
    if volts is not None:
        actuator.vin = volts
    goal, enabled = trajectory(0.0)
    simulator.reset(goal, 0.0)
    steps, next_entry = round(trajectory.duration / STEP_S), 0.0
    for k in range(-round(1.0 / STEP_S), steps):  # a second to settle, as on the bench
        time = k * STEP_S
        if k >= 0 and time >= next_entry:
            goal, enabled = trajectory(time)
            yield {
                "position": _rounded(simulator.q, 2.0 * np.pi / COUNTS),
                "speed": _rounded(simulator.dq, SPEED_STEP),
                "timestamp": time,
                "goal_position": float(goal),
                "torque_enable": bool(enabled),
            }
            next_entry += (1.0 + 0.1 * rng.standard_normal()) / LOG_HZ
        control = actuator.compute_control(goal, simulator.q, simulator.dq, STEP_S)
        simulator.step(float(control), enabled, STEP_S)


def _rounded(value: float, step: float) -> float:
    return float(np.round(value / step) * step)


def _urdf(case: Case, model: Any) -> str:
    """A point mass at the end of a uniform rod, hanging at zero."""
    mass = case.mass + case.arm_mass
    center = (case.mass + 0.5 * case.arm_mass) * case.length / mass
    inertia = (case.mass + case.arm_mass / 3.0) * case.length**2 - mass * center**2
    dynamics, values, actuator = "", model.get_parameter_values(), model.actuator
    volts = actuator.max_volts if case.servo.startswith("erob") else actuator.vin
    stall, free = round(values["kt"] * volts / values["R"], 1), round(volts / values["kt"], 1)
    if case.stated:
        dynamics = f'<dynamics damping="{values["friction_viscous"]}" friction="{values["friction_base"]}"/>'
    return f"""<robot name="pendulum"><link name="base"/><link name="arm"><inertial>
<origin xyz="0 0 {-center}"/><mass value="{mass}"/>
<inertia ixx="{inertia}" iyy="{inertia}" izz="1e-6" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="servo" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 -1 0"/>
<limit lower="-6.3" upper="6.3" effort="{stall}" velocity="{free}"/>{dynamics}</joint></robot>
"""


def _mapping(case: Case, model: Any, log: dict[str, float]) -> dict[str, Any]:
    actuator, motor = model.actuator, model.get_parameter_values()
    actuator.load_log(log)
    if case.servo.startswith("erob"):  # a current loop: torque per error
        controller = {
            "type": "position_servo",
            "stiffness": [motor["kt"] * case.gain],
            "damping": [float(motor["kt"] * actuator.damping * np.sqrt(case.gain))],
            "effort_limit": [motor["kt"] * actuator.max_amps],
            "armature": [motor["armature"]],
        }
    else:
        controller = {
            "type": "voltage_servo",
            "proportional": [actuator.vin * case.gain * actuator.error_gain],
            "voltage_limit": [actuator.vin * actuator.max_pwm],
            "torque_constant": [motor["kt"]],
            "resistance": [motor["R"]],
            "rotor_inertia": [motor["armature"]],
        }
    if case.told_held:
        controller["between_commands"] = "held"
    columns = {"position": "position", "speed": "speed", "goal": "goal_position", "powered": "torque_enable"}
    source = {"file": "{name}.json", "part": "entries", "time": {"column": "timestamp", "unit": "s"}}
    return {
        "joints": ["servo"],
        "urdf": "pendulum.urdf",
        "controller": {key: _plain(value) for key, value in controller.items()},
        "tolerances": {"mass": 0.02},
        "sources": {"log": {**source, "columns": columns}},
        "channels": {
            "states": {"position": {"formula": ["position"]}, "velocity": {"formula": ["speed"]}},
            "command": {"position": {"formula": ["goal"]}},
            "torque_enabled": {"enabled": ["powered"]},
        },
        "recordings": [{"name": name, "role": role} for name, role in ROLES.items()],
    }


def _plain(value: Any) -> Any:
    return [float(x) for x in value] if isinstance(value, list) else value


if __name__ == "__main__":
    for name, case in CASES.items():
        write_case(case, Path(sys.argv[1]) / name.replace(" ", "_"))
