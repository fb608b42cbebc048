"""The correction in an MJCF: the user's own text with changed attributes.

What MuJoCo has: `frictionloss`, `damping`, `armature`, `ref`, `stiffness`, `actuatorfrcrange` of a joint;
gains, bias, delay and first-order filters of an actuator; `inertial` of a body; gravity. New values are the
compiled ones plus the change, so that defaults and classes are counted in.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.export.bodies import RigidBody, body_of, moved, ten_of
from samrl_core.diagnosis.export.correction import BODY, Correction
from samrl_core.diagnosis.export.missing import in_words, say_missing
from samrl_core.diagnosis.export.nearest import BEYOND, PLAIN, level_and_slope
from samrl_core.diagnosis.export.statement import CONTROLLER, EXACT, MISSING, NEAREST, Statement
from samrl_core.diagnosis.export.xml_edit import XmlElement, XmlText
from samrl_core.diagnosis.nominal_model.from_mjcf import compiled, load_mujoco

IN_ACTUATOR = (
    "actuator_gain", "stiffness_scale", "damping_scale", "torque_offset", "command_delay", "effort_delay",
    "command_cutoff", "effort_cutoff",
)  # fmt: skip
_ACTUATORS = ("general", "motor", "position", "velocity")


@dataclass
class MjcfWriter:
    """Collects changes of one text; `done` holds what was said of them."""

    correction: Correction
    text: XmlText
    model: Any  # mujoco.MjModel of the same text
    mujoco: Any
    done: list[Statement] = field(default_factory=list)

    def joint(self, j: int) -> tuple[XmlElement, int]:
        """A joint's element and index in the compiled model."""
        name = self.correction.joints[j]
        element = self.text.find("joint", name=name)
        index = self.mujoco.mj_name2id(self.model, self.mujoco.mjtObj.mjOBJ_JOINT, name)
        if element is None or index < 0:
            raise InputError(
                f"the MJCF has no joint named {name!r}, which the recordings have; give the model"
                " that was diagnosed"
            )
        return element, index

    def say(self, j: int | None, what: str, how: str, said: str, error: float | None = None) -> None:
        """Note what became of a change."""
        place = "cell" if j is None else f"joint:{self.correction.joints[j]}"
        self.done.append(Statement(place, what, how, said, error))


def to_mjcf(correction: Correction, source: str, path: Path | None) -> tuple[str, list[Statement]]:
    """The changed text, and what it says of each change.

    Args:
        correction: what to change.
        source: the MJCF, included files written out.
        path: of the file, where meshes are looked for beside it.

    Raises:
        InputError: MuJoCo refuses the model, or it lacks a joint.
    """
    writer = MjcfWriter(correction, XmlText(source), compiled(source, path), load_mujoco())
    for j in range(len(correction.joints)):
        _joint(writer, j)
        _actuator(writer, j)
    write_bodies(writer)
    _gravity(writer)
    known = {
        *PLAIN,
        *BEYOND,
        "rotor_inertia",
        "encoder_offset",
        "cable_stiffness",
        "effort_limit",
        *IN_ACTUATOR,
        BODY,
    }
    writer.done += say_missing(correction, {*known, "gravity"}, "MuJoCo")
    return writer.text.result(), writer.done


def _joint(w: MjcfWriter, j: int) -> None:
    c, m = w.correction, w.model
    if not any(
        c.changes(n, j)
        for n in (*PLAIN, *BEYOND, "rotor_inertia", "encoder_offset", "cable_stiffness", "effort_limit")
    ):
        return
    element, index = w.joint(j)
    dof = int(m.jnt_dofadr[index])
    if any(c.changes(name, j) for name in (*PLAIN, *BEYOND)):
        near = level_and_slope(c, j)
        for key, value, before in (
            ("frictionloss", near.friction, float(m.dof_frictionloss[dof])),
            ("damping", near.damping, float(m.dof_damping[dof])),
        ):
            if abs(value - before) > 1e-12:
                w.text.set(element, {key: number(value)})
        beyond = [name for name in BEYOND if c.changes(name, j)]
        said = f"frictionloss {near.friction:.4g} N m, damping {near.damping:.4g} N m s/rad"
        if near.friction > 0:
            # MuJoCo's friction turns ahead of the velocity, by a time that the default makes 9 ms.
            w.text.set(element, {"solreffriction": f"{number(2 * float(m.opt.timestep))} 1"})
            said += ", solreffriction of two steps: with a longer one friction turns ahead of the velocity"
        if not beyond:
            w.say(j, "friction", EXACT, said)
        else:
            low, high = near.speeds
            w.say(
                j, ", ".join(beyond), NEAREST,
                f"{said}: the best level and slope from {low:.2g} to {high:.2g} rad/s as"
                " recorded", near.error,
            )  # fmt: skip
    if c.changes("rotor_inertia", j):
        value = float(m.dof_armature[dof]) + c.at("rotor_inertia", j)
        w.text.set(element, {"armature": number(value)})
        w.say(j, "rotor_inertia", EXACT, f"armature {value:.4g} kg m2")
    if c.changes("encoder_offset", j):
        value = float(m.qpos0[m.jnt_qposadr[index]]) + c.at("encoder_offset", j)
        angle = np.rad2deg(value) if _in_degrees(w) and int(m.jnt_type[index]) == 3 else value
        w.text.set(element, {"ref": number(angle)})
        w.say(
            j,
            "encoder_offset",
            EXACT,
            f"ref {value:.4g} rad: qpos is what the encoder reads; so are limits and keys",
        )
    if c.changes("cable_stiffness", j):
        spring, rest = c.at("cable_stiffness", j), c.at("cable_rest", j)
        stated, at = float(m.jnt_stiffness[index]), float(m.qpos_spring[m.jnt_qposadr[index]])
        if stated > 0:  # two springs at one joint are one
            spring, rest = stated + spring, (stated * at + spring * rest) / (stated + spring)
        angle = np.rad2deg(rest) if _in_degrees(w) and int(m.jnt_type[index]) == 3 else rest
        w.text.set(element, {"stiffness": number(spring), "springref": number(angle)})
        w.say(j, "cable_stiffness", EXACT, f"stiffness {spring:.4g} N m/rad about springref {rest:.4g} rad")
    if c.changes("effort_limit", j):
        limit = c.at("effort_limit", j)
        w.text.set(
            element, {"actuatorfrcrange": f"{number(-limit)} {number(limit)}", "actuatorfrclimited": "true"}
        )
        w.say(j, "effort_limit", EXACT, f"actuatorfrcrange +-{limit:.4g} N m")


def _in_degrees(w: MjcfWriter) -> bool:
    compiler = w.text.find("compiler")
    return compiler is None or compiler.attributes.get("angle", "degree") == "degree"


def _actuator(w: MjcfWriter, j: int) -> None:
    c, m = w.correction, w.model
    changed = [name for name in IN_ACTUATOR if c.changes(name, j)]
    if not changed:
        return
    found = [a for a in w.text.elements if a.tag in _ACTUATORS and a.attributes.get("joint") == c.joints[j]]
    found = [a for a in found if a.parent is not None and a.parent.tag == "actuator"]
    if len(found) != 1:
        for name in changed:
            said = f"{len(found) or 'no'} actuators drive the joint: {in_words(c, name, j)[1]}"
            w.say(j, name, CONTROLLER, said)
        return
    (element,) = found
    siblings = [a for a in w.text.elements if a.parent is element.parent]
    i = siblings.index(element)
    gear = float(m.actuator_gear[i, 0])
    gain = float(m.actuator_gainprm[i, 0])
    bias = [float(x) for x in m.actuator_biasprm[i, :3]] if int(m.actuator_biastype[i]) else [0.0] * 3
    servo = bias[1] < 0 or bias[2] < 0
    drive = 1.0 + c.at("actuator_gain", j)
    stiff, damp = c.at("stiffness_scale", j), c.at("damping_scale", j)
    if not servo:
        for name in ("stiffness_scale", "damping_scale", "command_delay", "command_cutoff"):
            if name in changed:
                w.say(j, name, *in_words(c, name, j))
    new_bias = [bias[0] * drive + c.at("torque_offset", j) / gear, bias[1] * drive, bias[2] * drive]
    new_gain = gain * drive
    if servo:
        position = bias[1] < 0
        new_gain *= stiff if position else damp
        new_bias[1] *= stiff
        new_bias[2] *= damp
    if new_gain != gain or new_bias != bias:
        if servo and new_bias[0] == 0 and element.tag == "position":
            w.text.set(element, {"kp": number(new_gain), "kv": number(-new_bias[2]), "dampratio": None})
        elif servo and new_bias[0] == 0 and element.tag == "velocity":
            w.text.set(element, {"kv": number(new_gain)})
        else:
            w.text.set(
                element,
                {
                    "gaintype": "fixed", "gainprm": number(new_gain), "biastype": "affine",
                    "biasprm": numbers(new_bias), "kp": None, "kv": None, "dampratio": None,
                },
                tag="general",
            )  # fmt: skip
        for name in (
            "actuator_gain",
            "torque_offset",
            *(("stiffness_scale", "damping_scale") if servo else ()),
        ):
            if name in changed:
                w.say(
                    j,
                    name,
                    EXACT,
                    f"actuator with gain {new_gain:.4g} and bias {[round(b, 6) for b in new_bias]}",
                )
    _lag(w, j, element, servo, changed)


def _lag(w: MjcfWriter, j: int, element: XmlElement, servo: bool, changed: list[str]) -> None:
    """Delay and filter of an actuator's input: the command of a servo, the effort of a motor."""
    c, step = w.correction, float(w.model.opt.timestep)
    delay = c.at("effort_delay", j) + (c.at("command_delay", j) if servo else 0.0)
    if delay > 0:
        w.text.set(element, {"delay": number(delay), "nsample": str(int(np.ceil(delay / step)) + 1)})
        exact = not servo or "effort_delay" not in changed
        said = f"delay {delay * 1e3:.3g} ms of the actuator's input (zero until then: mj_initCtrlHistory)"
        what = "command_delay" if servo and "command_delay" in changed else "effort_delay"
        if exact:
            w.say(j, what, EXACT, said)
        else:
            w.say(
                j,
                "effort_delay",
                NEAREST,
                f"{said}; its feedback is not late with it, as the drive's would be",
            )
    for name in ("command_cutoff", "effort_cutoff"):
        if name in changed and (servo or name == "effort_cutoff"):
            time = 1.0 / (2 * np.pi * c.at(name, j))
            w.text.set(element, {"dyntype": "filterexact", "dynprm": number(time)}, tag="general")
            _as_general(w, element)
            own = name == ("command_cutoff" if servo else "effort_cutoff")
            said = (
                f"first-order filter of {time * 1e3:.3g} ms at the actuator's input (one more"
                " activation state)"
            )
            w.say(j, name, EXACT if own else NEAREST, said)


def _as_general(w: MjcfWriter, element: XmlElement) -> None:
    """A filter needs <general>; gains go with it."""
    siblings = [a for a in w.text.elements if a.parent is element.parent]
    i, m = siblings.index(element), w.model
    _, now = w.text.state(element)
    kp = now.pop("kp", None)
    kv = now.pop("kv", None)
    if "gainprm" in now:
        return
    bias = [float(x) for x in m.actuator_biasprm[i, :3]] if int(m.actuator_biastype[i]) else [0.0] * 3
    gain = float(m.actuator_gainprm[i, 0])
    if element.tag == "position":
        gain = float(kp) if kp is not None else gain
        bias = [bias[0], -gain, -float(kv) if kv is not None else bias[2]]
    w.text.set(
        element,
        {
            "kp": None, "kv": None, "dampratio": None, "gaintype": "fixed", "gainprm": number(gain),
            "biastype": "affine", "biasprm": " ".join(number(b) for b in bias),
        },
        tag="general",
    )  # fmt: skip


def write_bodies(w: MjcfWriter) -> None:
    """Write changed inertias of the bodies that the joints move."""
    c, m = w.correction, w.model
    if BODY not in c.fields:
        return
    by_body: dict[int, np.ndarray] = {}
    first: dict[int, int] = {}
    for j in range(len(c.joints)):
        delta = c.fields[BODY][j]
        if not np.any(delta):
            continue
        _, index = w.joint(j)
        body = int(m.jnt_bodyid[index])
        by_body[body] = by_body.get(body, np.zeros(10)) + moved(delta, np.array(m.jnt_pos[index]))
        first.setdefault(body, j)
    for body, delta in by_body.items():
        turn = np.zeros(9)
        w.mujoco.mju_quat2Mat(turn, m.body_iquat[body])
        turn = turn.reshape(3, 3)
        own = RigidBody(
            float(m.body_mass[body]),
            np.array(m.body_ipos[body]),
            turn @ np.diag(m.body_inertia[body]) @ turn.T,
        )
        new = body_of(ten_of(own) + delta)
        j = first[body]
        if not new.possible:
            w.say(j, "body", MISSING, f"its mass would be {new.mass:.3g} kg with moments that no body has")
            continue
        element = w.joint(j)[0].parent
        assert element is not None
        _write_inertial(w.text, element, new)
        said = (
            f"inertial of its body: {new.mass:.4g} kg (before {own.mass:.4g}), centre"
            f" {np.round(new.center, 4).tolist()} m"
        )
        w.say(j, "body", EXACT, said)


def _write_inertial(text: XmlText, body: XmlElement, new: RigidBody) -> None:
    i = new.inertia
    values: dict[str, str] = {
        "pos": numbers(new.center),
        "mass": number(new.mass),
        "fullinertia": numbers([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]),
    }
    there = body.child("inertial")
    if there is not None:
        gone = dict.fromkeys(("diaginertia", "quat", "euler", "axisangle", "xyaxes", "zaxis"))
        text.set(there, {**gone, **values})
        return
    text.add_first(body, "<inertial " + " ".join(f'{k}="{v}"' for k, v in values.items()) + "/>")


def _gravity(w: MjcfWriter) -> None:
    c = w.correction
    if "gravity" not in c.fields:
        return
    new = c.fields["gravity"]
    option = w.text.find("option")
    if option is not None:
        w.text.set(option, {"gravity": numbers(new)})
    else:
        root = w.text.elements[0]
        w.text.add_first(root, f'<option gravity="{numbers(new)}"/>')
    w.say(
        None,
        "gravity",
        EXACT,
        f"gravity {np.round(new, 4).tolist()} m/s2: the tilted base seen from the base",
    )


def in_model(correction: Correction, source: str, assets: str | None) -> bool:
    """Whether the model's own position actuators are the controller of all held-out recordings."""
    law = correction.law
    if law is None or law.gravity_compensation:
        return False
    mujoco, model = load_mujoco(), compiled(source, None if assets is None else Path(assets) / "model.xml")
    for j, name in enumerate(correction.joints):
        index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
        found = [a for a in range(model.nu) if int(model.actuator_trnid[a, 0]) == index]
        if len(found) != 1 or not int(model.actuator_biastype[found[0]]):
            return False
        gear = float(model.actuator_gear[found[0], 0])
        gains = -model.actuator_biasprm[found[0], 1:3] * gear**2
        held = [(run["stiffness"][j], run["damping"][j]) for run in correction.held_out]
        if not all(np.allclose(gains, these, rtol=1e-6) for these in held):
            return False
    return True


def number(value: float) -> str:
    """As it stands in the text."""
    return f"{float(value):.8g}"


def numbers(values: Any) -> str:
    """Several of them."""
    return " ".join(number(v) for v in values)
