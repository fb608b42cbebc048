"""Re-simulates held-out recordings in PyBullet, original and changed model: numpy and pybullet alone.

    python resimulate.py [FOLDER]

FOLDER (default: where this file lies) holds original.urdf, changed.urdf, law.json and held_out.npz.
Written there: resimulated.npz, and resimulated.json with the gap before and after, and its shrink.

PyBullet knows joint damping from the file; friction is its velocity motor of zero speed with that much
force. Per control period: the command, interpolated; the law of law.json; PyBullet's steps. Other joints are
held at zero.
"""

from __future__ import annotations

import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pybullet
from held_out_comparison import QUANTITIES, compare, effort_on_its_way, impedance

MOST_STEP = 1e-3  # [s]


class BulletArm:
    """One URDF under the controller."""

    def __init__(self, path, law, gains):
        self.law, self.gains = law, gains
        root = ElementTree.parse(path).getroot()
        for link in root.findall("link"):
            for part in [c for c in link if c.tag in ("visual", "collision")]:
                link.remove(part)
        for joint in root.findall("joint"):
            if (
                joint.get("type") in ("revolute", "continuous", "prismatic")
                and joint.get("name") not in law["joints"]
            ):
                joint.set("type", "fixed")
        self.client = pybullet.connect(pybullet.DIRECT)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "arm.urdf"
            file.write_bytes(ElementTree.tostring(root))
            flags = pybullet.URDF_USE_INERTIA_FROM_FILE
            self.body = pybullet.loadURDF(
                str(file), useFixedBase=True, flags=flags, physicsClientId=self.client
            )
        pybullet.setGravity(*law["gravity"], physicsClientId=self.client)
        names = {}
        for i in range(pybullet.getNumJoints(self.body, physicsClientId=self.client)):
            info = pybullet.getJointInfo(self.body, i, physicsClientId=self.client)
            names[info[1].decode()] = i
            pybullet.changeDynamics(
                self.body,
                i,
                linearDamping=0,
                angularDamping=0,
                jointLowerLimit=-1e4,
                jointUpperLimit=1e4,
                maxJointVelocity=1e4,
                physicsClientId=self.client,
            )
        self.joints = [names[name] for name in law["joints"]]
        stated = {j.get("name"): d.attrib for j in root.findall("joint") for d in j.findall("dynamics")}
        dynamics = [stated.get(name, {}) for name in law["joints"]]
        self.friction = [float(d.get("friction", 0)) for d in dynamics]
        self.damping = np.array([float(d.get("damping", 0)) for d in dynamics])
        for i, d in zip(self.joints, self.damping, strict=True):
            pybullet.changeDynamics(self.body, i, jointDamping=float(d), physicsClientId=self.client)
        self.limit = np.array([np.inf if x is None else x for x in law["effort_limit"]])

    def inverse(self, q, v, a):
        """Torques without friction and damping."""
        return np.array(
            pybullet.calculateInverseDynamics(
                self.body, list(q), list(v), list(a), physicsClientId=self.client
            )
        )

    def run(self, held, nominal):
        """Simulate one recording's command; quantities (N, J) at the recording's times."""
        law, gains, client = self.law, self.gains, self.client
        period = law["period_s"]
        inner = max(1, int(np.ceil(period / MOST_STEP - 1e-9)))
        step = period / inner
        pybullet.setTimeStep(step, physicsClientId=client)
        time = held["time"]
        count = round(float(time[-1] - time[0]) / period) + 1
        clock = np.arange(count) * period
        asked = impedance(held, gains, clock, period)
        for i, q, v in zip(self.joints, held["start_position"], held["start_velocity"], strict=True):
            pybullet.resetJointState(self.body, i, q, v, physicsClientId=client)
        soft = 1.0 - np.exp(-2 * np.pi * period * gains["effort_cutoff"])
        out = {name: np.zeros((count, len(self.joints))) for name in QUANTITIES}
        sent, drive = [], None
        for k in range(count):
            q, v = self.state()
            u = asked(k, q, v)
            if law["gravity_compensation"]:
                u = u + nominal.inverse(q, 0 * q, 0 * q)
            u = np.clip(u, -self.limit, self.limit)
            sent.append(u)
            out["position"][k], out["velocity"][k], out["commanded_effort"][k] = q, v, u
            drive = effort_on_its_way(gains, sent, k, period, drive, soft)
            for n in range(inner):
                for i, friction in zip(self.joints, self.friction, strict=True):
                    pybullet.setJointMotorControl2(
                        self.body,
                        i,
                        pybullet.VELOCITY_CONTROL,
                        targetVelocity=0.0,
                        force=friction,
                        physicsClientId=client,
                    )
                pybullet.setJointMotorControlArray(
                    self.body,
                    self.joints,
                    pybullet.TORQUE_CONTROL,
                    forces=drive.tolist(),
                    physicsClientId=client,
                )
                pybullet.stepSimulation(physicsClientId=client)
                if n == 0:
                    _, after = self.state()
                    acceleration = (after - v) / step
                    out["effort"][k] = self.inverse(q, v, acceleration) - gains["rotor"] * acceleration
        grid = time - time[0]
        return {n: np.stack([np.interp(grid, clock, c) for c in x.T], 1) for n, x in out.items()}

    def state(self):
        """Positions and velocities."""
        states = pybullet.getJointStates(self.body, self.joints, physicsClientId=self.client)
        return np.array([s[0] for s in states]), np.array([s[1] for s in states])


def main(folder):
    """Both models on all recordings."""

    def simulate(name, law, gains, held):
        nominal = BulletArm(folder / "original.urdf", law, gains["original"])
        return [BulletArm(folder / f"{name}.urdf", law, gains[name]).run(one, nominal) for one in held]

    compare(folder, f"pybullet {pybullet.getAPIVersion()}", simulate)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent)
