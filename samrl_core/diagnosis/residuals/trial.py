"""One recording as the effects see it: residual equations, and what several formulas share, made once."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from scipy import signal

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis.residuals.equations import (
    Columns,
    Equations,
    armature,
    form_equations,
    nominal_friction,
    scale_limits,
    settled,
)
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from samrl_core.diagnosis.simulation.sprung_link import sprung_link

ROTOR_HZ = 13.0  # up to which every joint's accelerations tell a rotor from noise
SWINGS = 60.0  # times the variance of noise: beyond, they do so up to the band
FINE_HZ = 40.0  # of torques whose turning points count


class Trial:
    """A recording with its residuals, and the places where effects put their columns."""

    def __init__(self, recording: ArmRecording, rigid: RigidArm | None, start_s: float = 0.0) -> None:
        """Bring the recording to one clock and form the equations."""
        self.recording, self.rigid = recording, rigid
        self.motion = RecordedMotion(recording, rigid, start_s)
        self.equations: Equations = form_equations(self.motion)
        self.scale = scale_limits(recording.arm, rigid, self.motion)
        self.channels = self.equations.channels
        self.joints = self.motion.joints
        self.cached: dict[tuple[str, str], Any] = {}  # what a form works out once per trial

    def __len__(self) -> int:
        return len(self.motion)

    # -- where columns go ------------------------------------------------------------------------------

    def drive(self, joint: int, full: np.ndarray) -> Columns:
        """Columns (p, F) at full rate that act between commanded effort and torque sensor of a joint."""
        channel = "drive" if "drive" in self.channels else "dynamics"
        if channel not in self.channels:
            return {}
        return {(channel, joint): self.motion.reduce(full.T).T}

    def controller(self, joint: int, full: np.ndarray) -> Columns:
        """Columns (p, F) at full rate that act between command and commanded effort of a joint.

        Where the effort is what the law says, the law's own error is found where torque meets motion.
        """
        if "controller" not in self.channels and not self.motion.computed:
            return {}
        full = full * self.motion.enabled[:, joint]
        if self.motion.computed:
            return self.drive(joint, full)
        return {("controller", joint): self.motion.reduce(full.T).T}

    @property
    def shows_controller(self) -> bool:
        """Whether what the controller does otherwise than described is seen in some channel."""
        return "controller" in self.channels or (self.motion.computed and "dynamics" in self.channels)

    def link(self, columns: np.ndarray) -> Columns:
        """Band-limited columns (p, N, J) that act behind the torque sensors."""
        channel = "link" if "link" in self.channels else "dynamics"
        if channel not in self.channels:
            return {}
        return {(channel, j): columns[:, :, j] for j in range(self.joints) if np.any(columns[:, :, j])}

    def tracking(self, joint: int, columns: np.ndarray) -> Columns:
        """Columns (p, N) of command minus position."""
        return {("tracking", joint): columns * self.settled[:, joint]} if "tracking" in self.channels else {}

    def sensor(self, joint: int, drive: np.ndarray, link: np.ndarray | None = None) -> Columns:
        """Columns (p, N) added to the effort reading of a joint: lost in the drive, found at the link."""
        out: Columns = {}
        if "drive" in self.channels:
            out["drive", joint] = -drive
        if "link" in self.channels:
            out["link", joint] = drive if link is None else link
        return out

    @cached_property
    def settled(self) -> np.ndarray:
        """(N, J) zero where a tracking error says nothing, else one."""
        return settled(self.motion)

    # -- shared quantities -----------------------------------------------------------------------------

    @cached_property
    def mass(self) -> np.ndarray:
        """Joint-space inertia (N, J, J)."""
        assert self.rigid is not None
        return self.rigid.mass_matrix(self.motion.q)

    @cached_property
    def stiffness(self) -> np.ndarray:
        """Derivative of inverse dynamics with respect to position (N, J, J)."""
        assert self.rigid is not None
        return self.rigid.position_derivative(self.motion.q, self.motion.dq, self.motion.ddq)

    @cached_property
    def regressor(self) -> np.ndarray:
        """Inertial regressor (N, J, J links, 10)."""
        assert self.rigid is not None
        return self.rigid.regressor(self.motion.q, self.motion.dq, self.motion.ddq)

    @cached_property
    def tilt(self) -> np.ndarray:
        """Inverse dynamics (2, N, J) per radian of base tilt about the base's x and y axes."""
        assert self.rigid is not None
        g = self.rigid.gravity_vector
        q, zero = self.motion.q, np.zeros_like(self.motion.q)
        axes = np.eye(3)[:2]
        # Gravity seen from a base rotated by a small angle about an axis: g - angle * axis x g. Gravity
        # torques are linear in gravity, so a unit angle is evaluated exactly.
        return np.stack([self.rigid.inverse_dynamics(q, zero, zero, -np.cross(axis, g)) for axis in axes])

    @cached_property
    def model_torque(self) -> np.ndarray:
        """Link-side torque of the nominal model along the measured motion (N, J)."""
        if self.equations.model is not None:
            return self.equations.model
        assert self.rigid is not None
        return self.rigid.inverse_dynamics(self.motion.q, self.motion.dq, self.motion.ddq)

    @cached_property
    def transmitted(self) -> np.ndarray:
        """Torque through the transmissions (N, J) as the drives know it, without the link-side sensor.

        Not the sensor's reading: its noise is in the link residual as well, and would seem to explain it.
        Not the model's: it misses the resonance that an elastic joint is recognised by.
        """
        if self.motion.u is None or self.motion.computed:  # a law multiplies the noise of what it reads
            return self.model_torque
        if self.motion.tau is not None:
            return self.motion.u - self.motion.reduce(self.rotor_share)
        return self.motion.reduce(self._calm_torque - self.rotor_share)

    @cached_property
    def _calm_torque(self) -> np.ndarray:
        """Motors' torque (F, J) without fast parts that are noise.

        Where it is the only torque, its noise is in the residual too: as with accelerations (`rotor_share`).
        """
        assert self.motion.raw_commanded is not None
        calm, swings = self._slow_torque
        return np.where(swings, self.motion.raw_commanded, calm)

    @cached_property
    def _slow_torque(self) -> tuple[np.ndarray, np.ndarray]:
        """Motors' torque (F, J) below `ROTOR_HZ`, and which joints' fast torque is more than noise, (J,)."""
        motion, torque = self.motion, self.motion.raw_commanded
        assert torque is not None
        low = min(ROTOR_HZ, 0.5 * motion.band)
        slow = signal.butter(3, low, fs=motion.rate, output="sos")
        calm = np.asarray(signal.sosfiltfilt(slow, torque, axis=0))
        fast = np.var(motion.reduce(torque - calm), axis=0)
        noise = motion.noise.commanded_effort**2 * 2.0 * (motion.band - low) / motion.rate
        return calm, fast > SWINGS * noise

    @cached_property
    def rotor_share(self) -> np.ndarray:
        """Nominal torque (F, J) of rotor and friction at full rate; of accelerations more than noise."""
        motion = self.motion
        friction = nominal_friction(self.recording.arm, motion.full_velocity)
        return self.rotor * self.sure_acceleration + friction

    @cached_property
    def sure_acceleration(self) -> np.ndarray:
        """Accelerations (F, J) at full rate, their fast parts only where they are more than noise.

        The noise of measured accelerations is in the link residual too: twisted through a spring it comes
        back with the sign of a resonance, and a rigid joint would seem to give. Only where a joint swings
        well above that noise are its fast accelerations used.
        """
        motion = self.motion
        acceleration = np.gradient(motion.full_velocity, 1.0 / motion.rate, axis=0)
        low = min(ROTOR_HZ, 0.5 * motion.band)
        slow = signal.butter(3, low, fs=motion.rate, output="sos")
        calm = np.asarray(signal.sosfiltfilt(slow, acceleration, axis=0))
        fast = np.var(motion.reduce(acceleration - calm), axis=0)
        swings = fast > SWINGS * motion.acceleration_noise(low, motion.band)
        return np.where(swings, acceleration, calm)

    @cached_property
    def transmitted_finely(self) -> np.ndarray | None:
        """`transmitted` (G, J) before the band, decimated: a loop is plotted by its turning points."""
        motion = self.motion
        if motion.raw_commanded is None or motion.rate < 4.0 * FINE_HZ:
            return None
        if motion.computed or (motion.tau is None and not np.all(self._slow_torque[1])):
            return None
        torque = motion.raw_commanded - self.rotor_share
        low = signal.butter(3, FINE_HZ, fs=motion.rate, output="sos")
        return np.asarray(signal.sosfiltfilt(low, torque, axis=0))[:: self._fine_step]

    def from_fine(self, x: np.ndarray) -> np.ndarray:
        """Band-limited (p, N) of what was computed from `transmitted_finely`, (p, G)."""
        time = self.motion.time
        full = [np.interp(time, time[:: self._fine_step], row) for row in x]
        return self.motion.reduce(np.stack(full, axis=1)).T

    @property
    def _fine_step(self) -> int:
        return max(1, int(self.motion.rate / (6.0 * FINE_HZ)))

    @cached_property
    def delivered_torque(self) -> np.ndarray:
        """Torque (F, J) that the motors must have delivered, by the nominal model along the motion."""
        return self.rigid_torque + self.rotor_share

    @cached_property
    def rigid_torque(self) -> np.ndarray:
        """Link-side torque (F, J) at full rate that the nominal model needs to follow the reading rigidly."""
        assert self.rigid is not None
        motion = self.motion
        return self.rigid.inverse_dynamics(
            motion.full_position, motion.full_velocity, motion.full_acceleration
        )

    def sprung(self, joint: int, stiffness: float, damping: float, gap: float) -> np.ndarray:
        """Deflection (F,) of a link hung on its motor by a spring behind a gap of half width `gap`.

        Every other joint moves as it was read, so the link is a single oscillator driven by the torque that
        it would take to follow rigidly: M d2delta/dt2 = rigid torque - spring - damper.
        """
        motion = self.motion
        inertia = np.interp(motion.time, motion.t, self.mass[:, joint, joint])
        torque = self.rigid_torque[:, joint]
        return sprung_link(torque, inertia, stiffness, damping, gap, 1.0 / motion.rate)

    @cached_property
    def base_reaction(self) -> tuple[np.ndarray, np.ndarray]:
        """Wrench (N, 6) of the arm on its mount, and joint torques (6, N, J) per unit base acceleration."""
        assert self.rigid is not None
        return self.rigid.base_reaction(self.motion.q, self.motion.dq, self.motion.ddq)

    @cached_property
    def rotor(self) -> np.ndarray:
        """Nominal rotor inertia (J,)."""
        return armature(self.recording.arm)

    def deflection(self, joint: int, delta: np.ndarray) -> np.ndarray:
        """Change (p, N, J) of the link residual when a joint's link trails its reading by delta (p, N).

        link = tau - RNEA(q): with the true link at q - delta, tau = RNEA(q - delta), so the residual is
        -(d RNEA/dq delta + M d2 delta/dt2) to first order.
        """
        second = np.stack([self.motion.second_derivative(d) for d in delta])
        return -(
            np.einsum("nj,pn->pnj", self.stiffness[:, :, joint], delta)
            + np.einsum("nj,pn->pnj", self.mass[:, :, joint], second)
        )


def add(*parts: Columns) -> Columns:
    """Sum of columns that share their parameters."""
    out: Columns = {}
    for part in parts:
        for key, value in part.items():
            out[key] = out[key] + value if key in out else value
    return out
