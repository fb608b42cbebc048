"""Re-simulates held-out recordings in MuJoCo, original and changed model: numpy and mujoco alone.

    python resimulate.py [FOLDER]

FOLDER (default: where this file lies) holds original.xml, changed.xml, law.json and held_out.npz.
Written there: resimulated.npz, and resimulated.json with the gap before and after, and its shrink.

Per control period: the command, interpolated; the law of law.json, or the model's own position actuators
where these are the controller; MuJoCo's steps. Other joints are held at zero. Contacts are off.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import mujoco
import numpy as np
from held_out_comparison import QUANTITIES, compare, effort_on_its_way, impedance

HEAVY = 1e9  # rotor inertia of joints that are held [kg m2]


def load(path):
    """The model; shapes whose files are missing are left out, they do not matter here."""
    spec = mujoco.MjSpec.from_string(path.read_text())
    base = Path(json.loads((path.parent / "law.json").read_text()).get("assets") or path.parent)
    spec.modelfiledir = str(base)
    folder = base / (spec.meshdir or "")
    gone = {m.name for m in spec.meshes if m.file and not (folder / m.file).exists()}
    for body in spec.bodies:
        for geom in list(body.geoms):
            if geom.meshname in gone:
                spec.delete(geom)
            else:
                geom.material = ""
    for site in spec.sites:
        site.material = ""
    for kind in (spec.materials, spec.textures, [m for m in spec.meshes if m.name in gone]):
        for item in list(kind):
            spec.delete(item)
    if gone:
        for pair in [*spec.pairs, *spec.excludes]:
            spec.delete(pair)
    model = spec.compile()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    return model


class MujocoArm:
    """One model under the controller."""

    def __init__(self, model, law, reference, gains):
        """`reference` is the original model: its gains are those that the controller knows."""
        self.model, self.data, self.law = model, mujoco.MjData(model), law
        self.reference, self.still = reference, mujoco.MjData(reference)
        ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in law["joints"]]
        self.q, self.v = model.jnt_qposadr[ids], model.jnt_dofadr[ids]
        others = np.setdiff1d(np.arange(model.nv), self.v)
        self.others = others
        model.dof_armature[others] = HEAVY
        model.dof_damping[others] = model.dof_frictionloss[others] = 0.0
        self.gains = gains
        limit = law["effort_limit"]
        self.limit = np.array([np.inf if x is None else x for x in limit])
        self.actuator = [self._actuator(i) for i in ids]
        self.in_model = law["in_model"]
        self.unit = np.ones(len(ids))
        for k, a in enumerate(self.actuator):
            if a is None or self.in_model:
                continue
            if (
                model.actuator_biasprm[a, 1] or model.actuator_biasprm[a, 2]
            ):  # a servo that is not the controller
                model.actuator_gainprm[a] = model.actuator_biasprm[a] = 0.0
                self.actuator[k] = None
            else:
                self.unit[k] = reference.actuator_gainprm[a, 0] * reference.actuator_gear[a, 0]

    def _actuator(self, joint):
        found = [a for a in range(self.model.nu) if self.model.actuator_trnid[a, 0] == joint]
        return found[0] if len(found) == 1 else None

    def gravity(self, q):
        """Gravity torques of the original model, which stands still."""
        self.still.qpos[self.q] = q
        mujoco.mj_fwdPosition(self.reference, self.still)
        mujoco.mj_fwdVelocity(self.reference, self.still)
        return self.still.qfrc_bias[self.v].copy()

    def run(self, held):
        """Simulate one recording's command; quantities (N, J) at the recording's times."""
        model, data, law, gains = self.model, self.data, self.law, self.gains
        mujoco.mj_resetData(model, data)
        time = held["time"]
        data.qpos[self.q], data.qvel[self.v] = held["start_position"], held["start_velocity"]
        step = model.opt.timestep
        inner = 1 if self.in_model else max(1, round(law["period_s"] / step))
        period = inner * step
        count = round(float(time[-1] - time[0]) / period) + 1
        clock = np.arange(count) * period
        asked = impedance(held, gains, clock, period)
        plain = np.stack([np.interp(clock, held["command_time"], c) for c in held["command_position"].T], 1)
        out = {name: np.zeros((count, len(self.q))) for name in QUANTITIES}
        self.fill(plain[0], held["start_position"], held["start_velocity"])
        sent, drive = [], None
        soft = 1.0 - np.exp(-2 * np.pi * period * gains["effort_cutoff"])
        for k in range(count):
            q, v = data.qpos[self.q].copy(), data.qvel[self.v].copy()
            u = asked(k, q, v)
            if law["gravity_compensation"]:
                u = u + self.gravity(q)
            u = np.clip(u, -self.limit, self.limit)
            out["position"][k], out["velocity"][k], out["commanded_effort"][k] = q, v, u
            sent.append(u)
            if self.in_model:
                for j, a in enumerate(self.actuator):
                    data.ctrl[a] = plain[k, j] * model.actuator_gear[a, 0]
                applied = np.zeros(len(self.q))
            else:
                applied = effort_on_its_way(gains, sent, k, period, drive, soft)
                drive = applied
            for _ in range(inner):
                data.qvel[self.others] = 0.0
                if not self.in_model:
                    for j, a in enumerate(self.actuator):
                        if a is None:
                            data.qfrc_applied[self.v[j]] = applied[j]
                        else:
                            data.ctrl[a] = applied[j] / self.unit[j]
                mujoco.mj_step(model, data)
                if _ == 0:
                    out["effort"][k] = self._link_side()
        grid = time - time[0]
        return {n: np.stack([np.interp(grid, clock, c) for c in x.T], 1) for n, x in out.items()}

    def fill(self, command, position, velocity):
        """A delayed actuator begins with a history of zeros: let it hold the first command instead."""
        model, data = self.model, self.data
        if not self.in_model or not np.any(model.actuator_delay):
            return
        for _ in range(int(np.max(model.actuator_delay) / model.opt.timestep) + 3):
            for j, a in enumerate(self.actuator):
                data.ctrl[a] = command[j] * model.actuator_gear[a, 0]
            mujoco.mj_step(model, data)
            data.qpos[self.q], data.qvel[self.v] = position, velocity

    def _link_side(self):
        """Torque behind drive friction and rotor."""
        m, d = self.model, self.data
        friction = np.zeros(m.nv)
        kind = np.asarray(d.efc_type[: d.nefc])
        for i in np.flatnonzero(kind == int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF)):
            friction[d.efc_id[i]] += d.efc_force[i]
        tau = d.qfrc_actuator + d.qfrc_applied + friction - m.dof_damping * d.qvel - m.dof_armature * d.qacc
        return tau[self.v]


def main(folder):
    """Both models on all recordings."""
    reference = load(folder / "original.xml")

    def simulate(name, law, gains, held):
        file = folder / f"{name}.xml"
        return [MujocoArm(load(file), law, reference, gains[name]).run(one) for one in held]

    compare(folder, f"mujoco {mujoco.__version__}", simulate)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent)
