"""MJCF to the normal form: MuJoCo compiles it, and its tree, inertias, losses and actuators are read off.

A body with several joints becomes as many links, the first ones without mass. MuJoCo's `ref` is the reading
in the pose of the file; a URDF's zero is a reading of zero, so the joint's frame is turned back by it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose import rpy_from_rotation
from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file
from samrl_core.diagnosis.nominal_model.nominal_model import JointActuator, NominalModel

REMEDY = "mend the model; `python -m mujoco.viewer --mjcf=FILE` shows whether MuJoCo takes it"
_SINGLE = {2: "prismatic", 3: "revolute"}  # mjtJoint: slide, hinge
_RELATIVE = 1e-6


def load_mujoco() -> Any:
    """The package, an optional one.

    Raises:
        InputError: it is not installed.
    """
    try:
        import mujoco
    except ImportError as error:
        raise InputError(
            "an MJCF model needs MuJoCo, which is not installed: pip install 'samrl[mujoco]', or give a URDF"
        ) from error
    return mujoco


def from_mjcf(path: Path, text: str) -> NominalModel:
    """Read an MJCF file whose text is known already.

    Raises:
        InputError: MuJoCo refuses it, or a body would have its mass from a mesh that is missing.
    """
    mujoco = load_mujoco()
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, OSError) as error:
        raise InputError(f"{path}: {_message_of(error)}; {REMEDY}") from error
    notes = _without_missing_files(mujoco, spec, path)
    model = _compiled(spec, path)
    tree = _Tree(mujoco, model, notes)
    urdf = tree.urdf(str(spec.modelname or "model"))
    gravity = tuple(float(x) for x in model.opt.gravity)
    compensated = bool(np.all(model.body_gravcomp[1:] == 1.0)) if model.nbody > 1 else False
    if not compensated and np.any(model.body_gravcomp > 0):
        notes.append("gravity is taken off some bodies only (gravcomp); the nominal model has it on all")
    return NominalModel(
        "mjcf", path, with_includes(path, text), urdf, tuple(tree.actuators), float(model.opt.timestep),
        (gravity[0], gravity[1], gravity[2]), compensated, tuple(dict.fromkeys(notes)),
    )  # fmt: skip


def compiled(text: str, path: Path | None) -> Any:
    """The MjModel of a text whose files lie beside `path`; shapes whose files are missing are left out.

    Raises:
        InputError: as `from_mjcf`.
    """
    mujoco, where = load_mujoco(), path or Path("the model")
    try:
        spec = mujoco.MjSpec.from_string(text)
    except (ValueError, OSError) as error:
        raise InputError(f"{where}: {_message_of(error)}; {REMEDY}") from error
    if path is not None:
        spec.modelfiledir = str(path.parent.resolve())
    _without_missing_files(mujoco, spec, where)
    return _compiled(spec, where)


def _compiled(spec: Any, where: Path) -> Any:
    try:
        return spec.compile()
    except (ValueError, OSError) as error:
        raise InputError(f"{where}: {_message_of(error)}; {REMEDY}") from error


def _message_of(error: Exception) -> str:
    return " ".join(str(error).removeprefix("XML Error: ").removeprefix("Error: ").split())


_INCLUDE = re.compile(r"<include\s[^>]*?file\s*=\s*[\"']([^\"']+)[\"'][^>]*?(?:/>|>\s*</include\s*>)")


def with_includes(path: Path, text: str, depth: int = 0) -> str:
    """The text with `<include>` replaced by what it names, so that one file holds the model."""
    if depth > 16:
        raise InputError(f"{path} includes itself; break the circle of <include>")

    def content(match: re.Match[str]) -> str:
        file = path.parent / match[1]
        if not is_file(file):
            return match[0]
        inner = with_includes(file, file.read_text(encoding="utf-8", errors="replace"), depth + 1)
        body = re.search(r"<\s*(mujoco\w*)\b[^>]*>(.*)</\s*\1\s*>", inner, re.DOTALL)
        return f"<!-- {match[1]} -->{body[2] if body else ''}"

    return _INCLUDE.sub(content, text)


def _without_missing_files(mujoco: Any, spec: Any, path: Path) -> list[str]:
    """Leave out geometry whose files are not there, and what refers to it; say so.

    Raises:
        InputError: a body has no inertia of its own and would take it from a missing mesh.
    """
    base = path.parent / (spec.meshdir or "")
    missing = {m.name: m.file for m in spec.meshes if m.file and not is_file(base / m.file)}
    missing |= {m.name: m.file for m in spec.hfields if m.file and not is_file(base / m.file)}
    gone = 0
    from_geometry = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    for body in spec.bodies:
        for geom in list(body.geoms):
            if geom.meshname not in missing and getattr(geom, "hfieldname", "") not in missing:
                continue
            if _moves(spec, body) and (from_geometry or not body.explicitinertial):
                raise InputError(
                    f"{path}: body {body.name!r} has its mass from the mesh {missing.get(geom.meshname)!r},"
                    f" which is not in {base}; put the file there, or give the body an <inertial>"
                )
            spec.delete(geom)
            gone += 1
    for kind in ("meshes", "hfields", "skins", "materials", "textures"):
        if kind in ("materials", "textures") or missing:
            for item in list(getattr(spec, kind)):
                if kind in ("materials", "textures") or item.name in missing or kind == "skins":
                    _drop(spec, kind, item)
    if not missing:
        return []
    for pair in [*spec.pairs, *spec.excludes]:
        spec.delete(pair)
    return [f"{len(missing)} files of shapes are missing, {gone} shapes are left out: dynamics need none"]


def _moves(spec: Any, body: Any) -> bool:
    """Whether a joint stands between a body and the world; what does not move needs no mass."""
    while body is not None and body.name != spec.worldbody.name:
        if body.joints:
            return True
        body = body.parent
    return False


def _drop(spec: Any, kind: str, item: Any) -> None:
    if kind == "materials":
        for geom in spec.geoms:
            geom.material = "" if geom.material == item.name else geom.material
        for site in spec.sites:
            site.material = "" if site.material == item.name else site.material
    spec.delete(item)


@dataclass
class _Tree:
    """Writes the compiled model as a URDF."""

    mujoco: Any
    model: Any
    notes: list[str]
    parts: list[str] = field(default_factory=list)
    actuators: list[JointActuator] = field(default_factory=list)
    limits: dict[int, float] = field(default_factory=dict)  # joint -> effort

    def name(self, kind: str, index: int) -> str:
        found = self.mujoco.mj_id2name(
            self.model, getattr(self.mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), index
        )
        return str(found) if found else f"{kind}_{index}"

    def urdf(self, name: str) -> str:
        self._read_actuators()
        m, free = self.model, set()
        link = {0: ("world", np.zeros(3))}  # body -> its link, and the body's origin in the link's frame
        self.parts = [f"<robot name={quoteattr(name)}>", '<link name="world"/>']
        for body in range(1, m.nbody):
            parent = int(m.body_parentid[body])
            joints = range(int(m.body_jntadr[body]), int(m.body_jntadr[body]) + int(m.body_jntnum[body]))
            if parent in free or any(int(m.jnt_type[j]) not in _SINGLE for j in joints):
                free.add(body)
                if parent not in free:
                    self.notes.append(f"body {self.name('body', body)} moves freely and is left out")
                continue
            link[body] = self._body(body, list(joints), *link[parent])
        self.parts.append("</robot>")
        if m.neq:
            self.notes.append(
                "constraints between joints or bodies (<equality>) are not in the nominal model"
            )
        return "\n".join(self.parts) + "\n"

    def _body(self, body: int, joints: list[int], parent: str, shift: np.ndarray) -> tuple[str, np.ndarray]:
        m, name = self.model, self.name("body", body)
        position = np.array(m.body_pos[body]) + shift
        turn = _rotation(m.body_quat[body])
        name = "world_" if name == "world" else name
        if not joints:
            self._joint(f"{name}_fixed", "fixed", parent, name, position, turn, None)
            self._link(name, body, np.zeros(3))
            return name, np.zeros(3)
        anchor_before = np.zeros(3)
        for k, j in enumerate(joints):
            last = k == len(joints) - 1
            child = name if last else f"{name}_{k}"
            anchor, axis = np.array(m.jnt_pos[j]), np.array(m.jnt_axis[j])
            ref = float(m.qpos0[m.jnt_qposadr[j]])
            kind = _SINGLE[int(m.jnt_type[j])]
            at = position + turn.apply(anchor - anchor_before)
            if kind == "revolute":
                turned = turn * Rotation.from_rotvec(-ref * axis)
            else:
                at, turned = at - ref * turn.apply(axis), turn
            self._joint(self.name("joint", j), kind, parent, child, at, turned, j)
            self._link(child, body if last else None, -anchor)
            parent, position, turn, anchor_before = child, np.zeros(3), Rotation.identity(), anchor
        return name, -anchor_before

    def _link(self, name: str, body: int | None, shift: np.ndarray) -> None:
        """A link; `shift` is the body's origin in the link's frame."""
        m = self.model
        self.parts.append(f"<link name={quoteattr(name)}>")
        if body is not None and m.body_mass[body] > 0:
            at = np.array(m.body_ipos[body]) + shift
            rotation = _rotation(m.body_iquat[body]).as_matrix()
            full = rotation @ np.diag(m.body_inertia[body]) @ rotation.T
            moments = " ".join(
                f'i{a}{b}="{_text(full["xyz".index(a), "xyz".index(b)])}"'
                for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")
            )
            self.parts.append(
                f'<inertial><origin xyz="{_text(at)}"/><mass value="{_text(m.body_mass[body])}"/>'
                f"<inertia {moments}/></inertial>"
            )
        self.parts.append("</link>")

    def _joint(
        self, name: str, kind: str, parent: str, child: str, at: np.ndarray, turn: Rotation, index: int | None
    ) -> None:
        m = self.model
        lines = [
            f"<parent link={quoteattr(parent)}/><child link={quoteattr(child)}/>",
            f'<origin xyz="{_text(at)}" rpy="{_text(rpy_from_rotation(turn.as_matrix()))}"/>',
        ]
        if index is not None:
            dof = int(m.jnt_dofadr[index])
            limited, effort = bool(m.jnt_limited[index]), self.limits.get(index, np.inf)
            low, high = (float(x) for x in m.jnt_range[index])
            if kind == "revolute" and not limited:
                kind = "continuous"
            span = f'lower="{_text(low)}" upper="{_text(high)}" ' if limited else ""
            span = span or ("" if kind == "continuous" else 'lower="-1e5" upper="1e5" ')
            lines += [
                f'<axis xyz="{_text(m.jnt_axis[index])}"/>',
                f'<limit {span}effort="{_text(effort if np.isfinite(effort) else 0.0)}" velocity="0"/>',
                f'<dynamics friction="{_text(m.dof_frictionloss[dof])}" damping="{_text(m.dof_damping[dof])}"'
                f' armature="{_text(m.dof_armature[dof])}" stiffness="{_text(m.jnt_stiffness[index])}"'
                f' springref="{_text(m.qpos_spring[m.jnt_qposadr[index]])}"/>',
            ]
            if np.any(m.dof_dampingpoly[dof]):
                self.notes.append(f"{name}: damping of higher order is not in the nominal model")
            if np.any(m.jnt_stiffnesspoly[index]):
                self.notes.append(f"{name}: stiffness of higher order is not in the nominal model")
        self.parts += [f'<joint name={quoteattr(name)} type="{kind}">', *lines, "</joint>"]

    def _read_actuators(self) -> None:
        m = self.model
        on_joint = (int(self.mujoco.mjtTrn.mjTRN_JOINT), int(self.mujoco.mjtTrn.mjTRN_JOINTINPARENT))
        for j in range(m.njnt):
            if m.jnt_actfrclimited[j]:
                self.limits[j] = float(np.abs(m.jnt_actfrcrange[j]).max())
        seen: dict[int, int] = {}
        for i in range(m.nu):
            if int(m.actuator_trntype[i]) not in on_joint:
                self.notes.append(
                    f"actuator {self.name('actuator', i)} drives no single joint and is left out"
                )
                continue
            seen[int(m.actuator_trnid[i, 0])] = seen.get(int(m.actuator_trnid[i, 0]), 0) + 1
        for i in range(m.nu):
            j = int(m.actuator_trnid[i, 0])
            if int(m.actuator_trntype[i]) in on_joint and int(m.jnt_type[j]) in _SINGLE:
                actuator = self._actuator(i, j)
                if seen[j] > 1:
                    self.notes.append(
                        f"{actuator.joint} has {seen[j]} actuators: its controller is not described"
                    )
                    actuator = JointActuator(actuator.joint, "other")
                else:
                    self.limits[j] = min(self.limits.get(j, np.inf), actuator.effort_limit)
                if all(a.joint != actuator.joint for a in self.actuators):
                    self.actuators.append(actuator)

    def _actuator(self, i: int, j: int) -> JointActuator:
        m, name = self.model, self.name("actuator", i)
        gear = float(m.actuator_gear[i, 0])
        gain, (offset, spring, damper) = float(m.actuator_gainprm[i, 0]), m.actuator_biasprm[i, :3]
        fixed = int(m.actuator_gaintype[i]) == 0 and int(m.actuator_biastype[i]) in (0, 1)
        if int(m.actuator_biastype[i]) == 0:
            offset = spring = damper = 0.0
        limit = np.inf
        if m.actuator_forcelimited[i]:
            limit = float(np.abs(m.actuator_forcerange[i]).max() * abs(gear))
        if not fixed:
            kind = "other"
        elif spring == 0 and damper == 0:
            kind = "motor"
            if m.actuator_ctrllimited[i]:
                limit = min(limit, float(np.abs(m.actuator_ctrlrange[i]).max() * gain * abs(gear)))
        elif spring < 0 and np.isclose(gain, -spring, rtol=_RELATIVE):
            kind = "position"
        elif spring == 0 and damper < 0 and np.isclose(gain, -damper, rtol=_RELATIVE):
            kind = "velocity"
        else:
            kind = "other"
        if kind == "other":
            self.notes.append(f"actuator {name} follows a law of its own: its controller is not described")
        if kind != "other" and offset != 0:
            self.notes.append(f"actuator {name} has a bias of {offset:g}, which is not in the nominal model")
        if int(m.actuator_dyntype[i]) != 0:
            self.notes.append(f"actuator {name} filters its input, which is not in the nominal model")
        if float(np.ravel(m.actuator_delay[i])[0]) > 0:
            self.notes.append(f"actuator {name} is delayed, which is not in the nominal model")
        dof = int(m.jnt_dofadr[j])
        m.dof_damping[dof] += gear**2 * float(np.ravel(m.actuator_damping[i])[0])
        m.dof_armature[dof] += gear**2 * float(np.ravel(m.actuator_armature[i])[0])
        stiffness, damping = (
            (-spring * gear**2, -damper * gear**2) if kind in ("position", "velocity") else (0.0, 0.0)
        )
        return JointActuator(self.name("joint", j), kind, float(stiffness), float(damping), limit)


def _rotation(quaternion_wxyz: Any) -> Rotation:
    return Rotation.from_quat(np.asarray(quaternion_wxyz, dtype=float), scalar_first=True)


def _text(values: Any) -> str:
    return " ".join(f"{float(v):.12g}" for v in np.atleast_1d(values))
