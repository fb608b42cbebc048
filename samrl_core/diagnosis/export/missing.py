"""What no robot simulator's model file has, and what to do there instead."""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np

from samrl_core.diagnosis.export.correction import Correction
from samrl_core.diagnosis.export.statement import CONTROLLER, MISSING, Statement

WORDS: dict[str, tuple[str, Callable[[Correction, int], str]]] = {
    "harmonic_amplitude": (MISSING, lambda c, j: (
        f"torque that ripples with the position: apply {c.at('harmonic_amplitude', j):.3g} N m"
        f" sin({c.at('harmonic_order', j):.4g} q + {c.at('harmonic_phase', j):.3g}) in your step function")),
    "joint_stiffness": (MISSING, lambda c, j: (
        f"a spring of {c.at('joint_stiffness', j):.4g} N m/rad between motor and link needs a"
        " second joint, which"
        " changes the number of coordinates; slow motion comes near with that stiffness in"
        " series with a servo's")),
    "backlash": (MISSING, lambda c, j: (
        f"a gap of +-{c.at('backlash', j):.3g} rad between motor and link needs a second joint with limits")),
    "hysteresis_amplitude": (MISSING, lambda c, j: (
        f"the reading is wound up by +-{c.at('hysteresis_amplitude', j):.3g} rad with the"
        " torque's turning points")),
    "presliding_stiffness": (MISSING, lambda c, j: (
        f"friction begins as a bristle of {c.at('presliding_stiffness', j):.3g} N m/rad; its"
        " level alone is written")),
    "encoder_amplitude": (MISSING, lambda c, j: (
        f"add {c.at('encoder_amplitude', j):.3g} rad sin(q + {c.at('encoder_phase', j):.3g}) to"
        " the reading")),
    "sensor_gain": (MISSING, lambda c, j: (
        f"nothing moves differently: multiply torque readings by {1 + c.at('sensor_gain', j):.4g}")),
    "sensor_bias": (MISSING, lambda c, j: (
        f"nothing moves differently: add {c.at('sensor_bias', j):.3g} N m to torque readings")),
    "sensor_drift": (MISSING, lambda c, j: (
        f"nothing moves differently: add {c.at('sensor_drift', j):.3g} N m/s times time to torque readings")),
    "rotor_inertia": (MISSING, lambda c, j: (
        f"a rotor of {c.at('rotor_inertia', j):.3g} kg m2 at the joint has no place in the file")),
    "cable_stiffness": (MISSING, lambda c, j: (
        f"a spring of {c.at('cable_stiffness', j):.3g} N m/rad about {c.at('cable_rest', j):.3g}"
        " rad: apply its torque")),
    "encoder_offset": (MISSING, lambda c, j: f"add {c.at('encoder_offset', j):.4g} rad to the reading"),
    "actuator_gain": (CONTROLLER, lambda c, j: f"multiply the effort by {1 + c.at('actuator_gain', j):.4g}"),
    "torque_offset": (CONTROLLER, lambda c, j: f"add {c.at('torque_offset', j):.4g} N m to the effort"),
    "dead_band": (CONTROLLER, lambda c, j: (
        f"widen the dead band of the controller by +-{c.at('dead_band', j):.3g} rad")),
    "stiffness_scale": (CONTROLLER, lambda c, j: (
        f"multiply the stiffness by {c.at('stiffness_scale', j):.4g}")),
    "damping_scale": (CONTROLLER, lambda c, j: f"multiply the damping by {c.at('damping_scale', j):.4g}"),
    "command_delay": (CONTROLLER, lambda c, j: (
        f"delay the command by {c.at('command_delay', j) * 1e3:.3g} ms")),
    "effort_delay": (CONTROLLER, lambda c, j: f"delay the effort by {c.at('effort_delay', j) * 1e3:.3g} ms"),
    "command_cutoff": (CONTROLLER, lambda c, j: (
        f"filter the command by a first-order low-pass of {c.at('command_cutoff', j):.4g} Hz")),
    "effort_cutoff": (CONTROLLER, lambda c, j: (
        f"filter the effort by a first-order low-pass of {c.at('effort_cutoff', j):.4g} Hz")),
    "effort_rate_limit": (CONTROLLER, lambda c, j: (
        f"let the effort change by at most {c.at('effort_rate_limit', j):.4g} N m/s")),
    "effort_limit": (CONTROLLER, lambda c, j: f"clip the effort to +-{c.at('effort_limit', j):.4g} N m"),
    "hold_probability": (CONTROLLER, lambda c, j: (
        f"keep the last effort with a chance of {c.at('hold_probability', j):.3g} in each period")),
}  # fmt: skip


def in_words(correction: Correction, name: str, joint: int) -> tuple[str, str]:
    """How a change stands where a file has no place for it, and what to do."""
    how, words = WORDS[name]
    return how, words(correction, joint)


def say_missing(correction: Correction, known: Collection[str], simulator: str) -> list[Statement]:
    """A statement for each change that the writer has not taken."""
    c, out = correction, []
    for name in c.fields:
        if name in known or name not in WORDS:
            continue
        for j, joint in enumerate(c.joints):
            if c.changes(name, j):
                out.append(Statement(f"joint:{joint}", name, *in_words(c, name, j)))
    if "gravity" in c.fields and "gravity" not in known:
        said = (
            f"set gravity in the base's frame to {np.round(c.fields['gravity'], 4).tolist()}"
            " m/s2, or tilt the base"
        )
        out.append(Statement("cell", "gravity", CONTROLLER, said))
    if "mount_stiffness" in c.fields:
        said = (
            f"the base on a spring of {float(c.fields['mount_stiffness']):.4g} N m/rad needs"
            " two joints below it"
        )
        out.append(Statement("cell", "mount_stiffness", MISSING, said))
    out += [
        Statement(
            "cell", name, MISSING, f"no simulation of it is known here, so none is written for {simulator}"
        )
        for name in c.unsimulated
    ]
    return out
