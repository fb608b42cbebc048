"""What stands between command and torque beside two gains: the common form of every kind of controller.

All numbers are seen from the joint, so one formula holds for a servo in N m/rad and for a motor on volts:

    e = q_d - q, q_d rounded to command_step;  dz(e) = e less the dead band, zero within it
    spring = K dz(e) + punch sgn(dz(e)),  or K/p sin(p e) where the torque repeats with the pole pitch
    damper = D (velocity_share dq_d - dq),  dq as a low-pass of time constant velocity_lag reports it
    I' = integral dz(e) + velocity_integral (velocity_share dq_d - dq), held while the limit is met
    u = clip(spring + damper + I + feed-forward + g(q)),  torque = u - back_emf dq

K and D are those of `ArmController`. u is the torque at standstill. While torque is switched off u is zero.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from samrl_core.common.errors import InputError

PerJoint = float | np.ndarray


@dataclass(frozen=True, eq=False)
class DriveLaw:
    """One number for all joints, or one per joint (J,). For sliding joints read m for rad and N for N m."""

    velocity_share: PerJoint = 1.0  # of the commanded velocity that damping compares with
    velocity_lag: PerJoint = 0.0  # of the measured one: time constant of its first-order low-pass [s]
    integral: PerJoint = 0.0  # of the position error [N m/(rad s)]
    velocity_integral: PerJoint = 0.0  # of the velocity error [N m/rad]
    cascaded: bool = False  # the position gain stands before the integral as well
    dead_band: PerJoint = 0.0  # half width of the error that is ignored [rad]
    punch: PerJoint = 0.0  # torque that sets in beyond the dead band [N m]
    command_step: PerJoint = 0.0  # the command is rounded to multiples; 0 is off [rad]
    pole_pitch: PerJoint = 0.0  # p of a torque that repeats with the angle; 0 is a straight spring [1/rad]
    back_emf: PerJoint = 0.0  # torque lost per speed while powered [N m s/rad]
    braked: bool = False  # switched off, the windings are shorted: back_emf goes on acting
    open_loop: bool = False  # the recorded commanded effort is the input; there is no command
    after_back_emf: bool = False  # recorded efforts are those of the current, back-EMF taken off
    encoder: str = "motor"  # side of the transmission that is read: motor or link
    torque_per_volt: PerJoint = 0.0  # [N m/V] at standstill; 0 is unknown
    torque_per_ampere: PerJoint = 0.0  # [N m/A]; 0 is unknown
    most_volt: PerJoint = 0.0  # voltage at full duty [V]; 0 is unknown

    def of_joints(self, name: str, joints: int) -> np.ndarray:
        """A number as (J,).

        Raises:
            InputError: it has another number of joints.
        """
        value = np.asarray(getattr(self, name), dtype=float)
        if value.shape not in ((), (joints,)):
            raise InputError(f"the controller's {name} has shape {value.shape}; it must be ({joints},)")
        return np.broadcast_to(value, (joints,)).astype(float)


PER_JOINT = tuple(f.name for f in fields(DriveLaw) if f.type == "PerJoint")
