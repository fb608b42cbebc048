"""Franka Panda: limits, joint impedance and home.

Limits: frankaemika/docs control-parameters-joint-panda.csv (Apache-2.0).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from samrl_core.cell.robots.robot import ImpedanceGains, JointLimits, RobotSpec

PANDA = RobotSpec(
    name="panda",
    urdf=Path(__file__).parent / "panda.urdf",
    joint_names=tuple(f"panda_joint{i}" for i in range(1, 8)),
    base_link="panda_link0",
    flange="panda_link8",
    limits=JointLimits(
        lower=np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]),
        upper=np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]),
        velocity=np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61]),
        acceleration=np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
        jerk=np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]),
        effort=np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0]),
        effort_rate=np.full(7, 1000.0),
    ),
    # ASSUMPTION. libfranka's joint_impedance_control example has K = (600 x4, 250, 150, 50) and
    # D = (50 x4, 30, 25, 15). Without rotor inertia (below) that damping is unstable at 1 kHz: where
    # axes 1, 3 and 5 are parallel, turning one against the other moves only 0.036 kg m2. Joints 1, 3, 5
    # and 7 are softer here; 2 and 4, which carry the weight, keep K = 600 and near-critical D.
    # tests/cell/robots/test_specs.py checks that the sampled law is stable all over the joint range.
    controller=ImpedanceGains(
        stiffness=np.array([150.0, 600.0, 150.0, 600.0, 50.0, 150.0, 20.0]),
        damping=np.array([18.0, 60.0, 16.0, 45.0, 2.0, 5.0, 0.8]),
        period_s=0.001,
    ),
    # Flange at (0.5, 0, 0.3034) m in the base, axes diag(1, -1, -1): a tip 0.1634 m along the flange's z
    # stands at (0.5, 0, 0.14). By `solve_ik`; tested.
    home=np.array([0.0, 0.045898, 0.0, -2.376290, 0.0, 2.422188, 0.0]),
    # The simulated cell has no rotor inertia: PyBullet's multibodies offer none.
    armature=np.zeros(7),
    # As PyBullet's wheel carries them (Apache-2.0); links 0 and 7 have a collision mesh alone there.
    meshes={
        f"panda_link{i}": f"package://franka_panda/meshes/{kind}/link{i}.obj"
        for i, kind in enumerate(("collision", *["visual"] * 6, "collision"))
    },
)
