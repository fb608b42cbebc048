"""Flexiv Rizon 4: limits, joint impedance and home.

Position, velocity and torque limits: flexiv_rdk flexiv_Rizon4_kinematics.urdf (Apache-2.0).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from samrl_core.cell.robots.robot import ImpedanceGains, JointLimits, RobotSpec

RIZON4 = RobotSpec(
    name="rizon4",
    urdf=Path(__file__).parent / "rizon4.urdf",
    joint_names=tuple(f"rizon_joint{i}" for i in range(1, 8)),
    base_link="rizon_base_link",
    flange="rizon_flange",
    limits=JointLimits(
        lower=np.array([-2.8798, -2.3562, -3.0543, -1.9548, -3.0543, -1.4835, -3.0543]),
        upper=np.array([2.8798, 2.3562, 3.0543, 2.7751, 3.0543, 4.6251, 3.0543]),
        velocity=np.array([2.0944, 2.0944, 2.4435, 2.4435, 4.8869, 4.8869, 4.8869]),
        acceleration=np.full(7, 10.0),  # ASSUMPTION: not published
        jerk=np.full(7, 5000.0),  # ASSUMPTION: not published
        effort=np.array([123.0, 123.0, 64.0, 64.0, 39.0, 39.0, 39.0]),
        effort_rate=np.full(7, 1000.0),  # ASSUMPTION: not published; as for the Panda
    ),
    # ASSUMPTION: not published per joint. As stiff as an arm without rotor inertia can be held at 1 kHz
    # (see panda/spec.py; joint 7 turns 0.001 kg m2); tests/cell/robots/test_specs.py checks stability.
    controller=ImpedanceGains(
        stiffness=np.array([200.0, 600.0, 100.0, 400.0, 30.0, 100.0, 10.0]),
        damping=np.array([14.0, 45.0, 6.0, 30.0, 1.2, 4.0, 0.2]),
        period_s=0.001,
    ),
    # In the default cell the camera stands 0.40 m from (0.5, 0, 0.03), elevation 55 deg, azimuth 60 deg,
    # image upright: to the side of the own base, since straight ahead (azimuth 0) the arm folds up and is
    # near-singular. By `solve_ik` from many seeds, the one farthest from limits, singularity and the
    # other arm; tested.
    home=np.array([-1.173269, -1.186332, -1.754686, -1.204229, -0.595784, 2.835623, 0.419808]),
    # menagerie has 3.17 (joints 1-2), 1.38 (3-4) and 0.13 kg m2 (5-7), but PyBullet's multibodies offer
    # no rotor inertia: zero is what the simulated cell has.
    armature=np.zeros(7),
)
