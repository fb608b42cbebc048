"""An MJCF of a model that was no MJCF, so that a URDF's user can run the correction in MuJoCo too."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.export.correction import BODY, Correction
from samrl_core.diagnosis.export.to_mjcf import MjcfWriter, write_bodies
from samrl_core.diagnosis.export.xml_edit import XmlText
from samrl_core.diagnosis.nominal_model.from_mjcf import compiled, load_mujoco
from samrl_core.diagnosis.simulation.plant_arrays import ten_to_frame
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

STEP_S = 0.001  # largest time step that is written


def generated_mjcf(correction: Correction) -> str:
    """The nominal URDF by MuJoCo's own importer: no shapes, but rotors, the tool, the controller's step.

    Raises:
        InputError: MuJoCo does not take the URDF.
    """
    c, mujoco = correction, load_mujoco()
    root = ElementTree.fromstring(c.urdf)
    for link in root.findall("link"):
        for part in [child for child in link if child.tag in ("visual", "collision")]:
            link.remove(part)
    extension = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(
        extension, "compiler", fusestatic="false", discardvisual="false", balanceinertia="true"
    )
    try:
        spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    except ValueError as error:
        raise InputError(f"MuJoCo does not read the URDF: {error}; mend it, or give an MJCF") from error
    by_name = {joint.name: joint for joint in spec.joints}
    for j, name in enumerate(c.joints):
        joint = by_name[name]
        joint.armature = float(c.armature[j])
        joint.frictionloss = float(c.friction[j])
        joint.damping = np.array([float(c.damping[j]), 0.0, 0.0])
    if c.law is not None:
        spec.option.timestep = min(c.law.period_s, STEP_S)
        spec.option.gravity = np.array(c.law.gravity)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    try:
        spec.compile()
        text = str(spec.to_xml())
    except ValueError as error:
        raise InputError(f"MuJoCo does not compile the URDF: {error}; mend it, or give an MJCF") from error
    return text if c.tool is None else _with_tool(c, text)


def _with_tool(c: Correction, text: str) -> str:
    assert c.tool is not None
    rigid = RigidArm(ArmDescription("tool_arm", c.joints, c.urdf, None))
    mass, center = float(c.tool["mass"]), np.array(c.tool["center_of_mass"])
    about = np.array(c.tool["inertia"]) + mass * (center @ center * np.eye(3) - np.outer(center, center))
    ten = np.concatenate([[mass], mass * center, about[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])
    delta = np.zeros((len(c.joints), 10))
    delta[-1] = ten_to_frame(rigid.flange_in_joint.rotation, rigid.flange_in_joint.translation) @ ten
    only = Correction(
        c.effects, c.joints, {BODY: delta}, (), c.urdf, c.friction, c.damping, c.armature, c.law, None, {}
    )
    writer = MjcfWriter(only, XmlText(text), compiled(text, None), load_mujoco())
    write_bodies(writer)
    return writer.text.result()
