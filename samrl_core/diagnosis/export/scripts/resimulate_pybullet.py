"""Re-simulates held-out recordings in PyBullet, original and changed model: numpy and pybullet alone.

    python resimulate.py [FOLDER]

FOLDER (default: where this file lies) holds original.urdf, changed.urdf, law.json and held_out.npz.
Written there: resimulated.npz, and resimulated.json with the gap before and after, and its shrink.

PyBullet knows joint damping from the file; friction is its velocity motor of zero speed with that much
force. Per control period: the command, interpolated; the law of law.json; PyBullet's steps. Other joints are
held at zero.
"""

# pyright: reportAttributeAccessIssue=false, reportOptionalMemberAccess=false
from __future__ import annotations

import json
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pybullet

QUANTITIES = ("position", "velocity", "effort", "commanded_effort")
MOST_STEP = 1e-3  # [s]


class Arm:
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
        found = {j.get("name"): j.find("dynamics") for j in root.findall("joint")}
        self.friction = [
            0.0 if found[n] is None else float(found[n].get("friction", 0)) for n in law["joints"]
        ]
        self.damping = np.array(
            [0.0 if found[n] is None else float(found[n].get("damping", 0)) for n in law["joints"]]
        )
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
        late = clock - gains["command_delay"][:, None]
        wanted = np.stack(
            [
                np.interp(t, held["command_time"], c)
                for t, c in zip(late, held["command_position"].T, strict=True)
            ],
            1,
        )
        speed = np.stack(
            [
                np.interp(t, held["command_time"], c)
                for t, c in zip(late, held["command_velocity"].T, strict=True)
            ],
            1,
        )
        forward = np.stack([np.interp(clock, held["command_time"], c) for c in held["command_effort"].T], 1)
        for i, q, v in zip(self.joints, held["start_position"], held["start_velocity"], strict=True):
            pybullet.resetJointState(self.body, i, q, v, physicsClientId=client)
        stiffness = held["stiffness"] * gains["stiffness_scale"]
        damping = held["damping"] * gains["damping_scale"]
        blend = 1.0 - np.exp(-2 * np.pi * period * gains["command_cutoff"])
        soft = 1.0 - np.exp(-2 * np.pi * period * gains["effort_cutoff"])
        out = {name: np.zeros((count, len(self.joints))) for name in QUANTITIES}
        filtered, filtered_speed = wanted[0].copy(), speed[0].copy()
        sent, drive = [], None
        for k in range(count):
            q, v = self.state()
            filtered += blend * (wanted[k] - filtered)
            filtered_speed += blend * (speed[k] - filtered_speed)
            u = stiffness * (filtered - q) + damping * (filtered_speed - v) + forward[k]
            if law["gravity_compensation"]:
                u = u + nominal.inverse(q, 0 * q, 0 * q)
            u = np.clip(u, -self.limit, self.limit)
            sent.append(u)
            out["position"][k], out["velocity"][k], out["commanded_effort"][k] = q, v, u
            drive = self.through(sent, k, period, drive, soft)
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

    def through(self, sent, k, period, last, soft):
        """Effort on its way to the drive, as the controller's code would have it."""
        gains = self.gains
        u = np.empty(len(self.joints))
        for j, delay in enumerate(gains["effort_delay"]):
            at = max(k - delay / period, 0.0)
            low = int(at)
            high = min(low + 1, k)
            u[j] = sent[low][j] * (1 - (at - low)) + sent[high][j] * (at - low)
        if last is not None:
            u = last + soft * (u - last) if np.isfinite(gains["effort_cutoff"]).any() else u
            most = gains["effort_rate_limit"] * period
            u = np.clip(u, last - most, last + most)
        u = np.clip(u, -gains["effort_limit"], gains["effort_limit"])
        return u * (1.0 + gains["actuator_gain"]) + gains["torque_offset"]


def gap(runs, held):
    """Root mean square of (measured - simulated) / scale over everything, and per quantity."""
    squares, parts = [], {}
    for run, one in zip(runs, held, strict=True):
        rows = []
        for name in QUANTITIES:
            if "measured_" + name in one:
                error = ((one["measured_" + name] - run[name]) / one["scale_" + name]) ** 2
                rows.append(error)
                parts.setdefault(name, []).append(error.mean())
        squares.append(np.concatenate(rows, axis=1).mean(axis=1))
    return float(np.sqrt(np.concatenate(squares).mean())), {
        n: float(np.sqrt(np.mean(p))) for n, p in parts.items()
    }


def main(folder):
    """Simulate, compare, write."""
    law = json.loads((folder / "law.json").read_text())
    arrays = np.load(folder / "held_out.npz")
    held = [
        {name.split(".", 1)[1]: arrays[name] for name in arrays.files if name.startswith(f"{k}.")}
        for k in range(law["recordings"])
    ]
    gaps, parts, kept = {}, {}, {}
    for name in ("original", "changed"):
        gains = {k: np.array([np.inf if x is None else x for x in v]) for k, v in law[name].items()}
        neutral = {k: np.array([np.inf if x is None else x for x in v]) for k, v in law["original"].items()}
        nominal = Arm(folder / "original.urdf", law, neutral)
        runs = [Arm(folder / f"{name}.urdf", law, gains).run(one, nominal) for one in held]
        gaps[name], parts[name] = gap(runs, held)
        for k, run in enumerate(runs):
            kept |= {f"{k}.{name}.{quantity}": values for quantity, values in run.items()}
    np.savez_compressed(folder / "resimulated.npz", **kept)
    result = {
        "engine": f"pybullet {pybullet.getAPIVersion()}",
        "before": gaps["original"],
        "after": gaps["changed"],
        "shrink": 1.0 - gaps["changed"] / gaps["original"],
        "quantities": {
            q: {"before": parts["original"][q], "after": parts["changed"][q]} for q in parts["changed"]
        },
    }
    (folder / "resimulated.json").write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent)
