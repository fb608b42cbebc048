"""The correction for Isaac Lab: a changed URDF, and a configuration of actuators with the numbers.

Fields are those of `isaaclab.actuators.ActuatorBaseCfg` of Isaac Lab 2.3: friction (static),
dynamic_friction and viscous_friction [N m, N m s/rad], armature, effort_limit_sim, stiffness, damping;
`DelayedPDActuatorCfg` has a delay in physics steps. Nothing here was run in Isaac Lab.
"""

from __future__ import annotations

import math

from samrl_core.diagnosis.export.correction import Correction
from samrl_core.diagnosis.export.missing import say_missing
from samrl_core.diagnosis.export.nearest import BEYOND, PLAIN, level_and_slope
from samrl_core.diagnosis.export.statement import EXACT, NEAREST, Statement
from samrl_core.diagnosis.export.to_urdf import KNOWN, to_urdf

CONFIG = '''"""Actuators of the diagnosed arm: put CORRECTED into ArticulationCfg(actuators=...)."""

from isaaclab.actuators import DelayedPDActuatorCfg, ImplicitActuatorCfg

PHYSICS_STEP_S = {step}  # of your SimulationCfg; delays are counted in it

CORRECTED = {{
{groups}
}}
'''


def to_isaaclab(correction: Correction, source: str) -> tuple[str, str, list[Statement]]:
    """The changed URDF, the configuration, and what they say of each change.

    Raises:
        InputError: as `to_urdf`.
    """
    c = correction
    urdf, done = to_urdf(c, source)
    kept = [s for s in done if s.what in ("body", "encoder_offset")]
    step = c.law.period_s if c.law is not None else 0.005
    groups = []
    for j, name in enumerate(c.joints):
        near = level_and_slope(c, j)
        delay = c.at("command_delay", j) + c.at("effort_delay", j)
        values: dict[str, float] = {
            "friction": near.friction,
            "dynamic_friction": near.friction,
            "viscous_friction": near.damping,
            "armature": float(c.armature[j]) + c.at("rotor_inertia", j),
        }
        gain = 1.0 + c.at("actuator_gain", j)
        if c.law is not None:
            values["stiffness"] = c.law.stiffness[j] * c.at("stiffness_scale", j) * gain
            values["damping"] = c.law.damping[j] * c.at("damping_scale", j) * gain
            limit = min(c.law.effort_limit[j], c.at("effort_limit", j))
        else:
            limit = c.at("effort_limit", j)
        if math.isfinite(limit):
            values["effort_limit_sim"] = limit
        lines = [f"{key}={value:.8g}," for key, value in values.items()]
        if c.law is None:
            lines.append("stiffness=0.0, damping=0.0,  # your controller's")
        kind = "ImplicitActuatorCfg"
        if delay > 0:
            kind = "DelayedPDActuatorCfg"
            steps = round(delay / step)
            lines.append(f"min_delay={steps}, max_delay={steps},  # {delay * 1e3:.3g} ms")
        body = "\n        ".join(lines)
        groups.append(f'    "{name}": {kind}(\n        joint_names_expr=["{name}"],\n        {body}\n    ),')
        kept += _spoken_of(c, j, near.friction, near.damping, near.error, values, delay)
    known = {
        *KNOWN,
        "rotor_inertia",
        "actuator_gain",
        "stiffness_scale",
        "damping_scale",
        "command_delay",
        "effort_delay",
    }
    kept += say_missing(c, known, "Isaac Lab")
    return urdf, CONFIG.format(step=f"{step:.6g}", groups="\n".join(groups)), kept


def _spoken_of(
    c: Correction,
    j: int,
    friction: float,
    damping: float,
    error: float,
    values: dict[str, float],
    delay: float,
) -> list[Statement]:
    place, out = f"joint:{c.joints[j]}", []
    beyond = [name for name in BEYOND if c.changes(name, j)]
    if beyond or any(c.changes(name, j) for name in PLAIN):
        said = f"friction {friction:.4g} N m, viscous_friction {damping:.4g} N m s/rad"
        out.append(
            Statement(
                place,
                ", ".join(beyond) or "friction",
                NEAREST if beyond else EXACT,
                said,
                error if beyond else None,
            )
        )
    if c.changes("rotor_inertia", j):
        out.append(Statement(place, "rotor_inertia", EXACT, f"armature {values['armature']:.4g} kg m2"))
    for name in ("stiffness_scale", "damping_scale", "actuator_gain"):
        if c.changes(name, j):
            said = (
                f"stiffness {values.get('stiffness', 0):.4g}, damping"
                f" {values.get('damping', 0):.4g} of the actuator"
            )
            if name == "actuator_gain":
                said += "; efforts that you send yourself must be multiplied in your code"
            out.append(Statement(place, name, EXACT if name != "actuator_gain" else NEAREST, said))
    if c.changes("effort_limit", j):
        out.append(
            Statement(place, "effort_limit", EXACT, f"effort_limit_sim {values['effort_limit_sim']:.4g} N m")
        )
    if delay > 0:
        out.append(Statement(place, "delay", NEAREST, f"{delay * 1e3:.3g} ms in whole physics steps"))
    return out
