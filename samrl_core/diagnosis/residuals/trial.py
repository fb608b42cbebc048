"""One recording as the effects see it: residual equations, and what several formulas share, made once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from scipy import signal

from samrl_core.cell.robots.joint_dynamics import joint_dynamics
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis.residuals.equations import (
    UNITS,
    Columns,
    Equations,
    armature,
    drive_channel,
    form_equations,
    nominal_friction,
    settled,
)
from samrl_core.diagnosis.residuals.laws.driving_quantities import quantities_of
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.phases import phases_of_motion
from samrl_core.diagnosis.residuals.ranges import find_ranges
from samrl_core.diagnosis.residuals.signals.noise_color import NoiseColor
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from samrl_core.diagnosis.simulation.sprung_link import sprung_link

ROTOR_HZ = 13.0  # up to which every joint's accelerations tell a rotor from noise
SWINGS = 60.0  # times the variance of noise: beyond, they do so up to the band
FINE_HZ = 40.0  # of torques whose turning points count


class Trial(Observed):
    """An arm's recording with its residuals, and the places where effects put their columns."""

    kind = "arm"

    def __init__(self, recording: ArmRecording, rigid: RigidArm | None, start_s: float = 0.0) -> None:
        """Bring the recording to one clock and form the equations."""
        self.recording, self.rigid = recording, rigid
        self.motion = RecordedMotion(recording, rigid, start_s)
        self.equations: Equations = form_equations(self.motion)
        self.channels = self.equations.channels
        self.joints = self.motion.joints
        self.share_ranges([self])
        self.cached: dict[tuple[str, str], Any] = {}
        self._phases: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.motion)

    def share_ranges(self, fitted: Sequence[Trial]) -> None:
        """Take what is typical of the arm from all fitted recordings: a slow one alone knows no range.

        A tolerance or a prior that is a share of an effort or a speed is the same in every recording,
        whichever of them comes first; so are the ranges that are searched.
        """
        ranges = find_ranges([trial.motion for trial in fitted])
        self.scale, self.speed_scale = ranges.effort, ranges.speed
        self.fastest, self.strongest, self.travel = ranges.fastest, ranges.strongest, ranges.travel
        self.effort_lag, self.torque_lag = ranges.effort_lag, ranges.torque_lag

    # -- what any recording tells ----------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Of the recording."""
        return self.recording.name

    @property
    def places(self) -> tuple[str, ...]:
        """The joints."""
        return tuple(f"joint:{name}" for name in self.recording.arm.joints)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each channel."""
        return UNITS

    @property
    def residual(self) -> dict[str, np.ndarray]:
        """Per channel (N, J)."""
        return self.equations.residual

    @property
    def sigma(self) -> dict[str, np.ndarray]:
        """Per channel (N, J)."""
        return self.equations.sigma

    @property
    def color(self) -> dict[str, NoiseColor]:
        """Per channel whose noise is not white."""
        return self.equations.color

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.motion.time[-1] - self.motion.time[0])

    def elapsed(self, channel: str) -> np.ndarray:
        """Times (N,) since the recording began [s], the same for all channels."""
        return self.motion.t - self.motion.time[0]

    def spacing(self, channel: str) -> float:
        """Time between samples [s]."""
        return self.motion.dt

    def phases(self, channel: str) -> np.ndarray:
        """Phase (N, J) of each sample."""
        if self._phases is None:
            self._phases = phases_of_motion(self.motion.dq, self.motion.dt)
        return self._phases

    def drivers(self, channel: str, row: int) -> dict[str, np.ndarray]:
        """Quantities (N,) of a joint's motion and effort."""
        return quantities_of(self.motion, self._weighed_effort, row)

    @cached_property
    def _weighed_effort(self) -> np.ndarray | None:
        """Effort (N, J) [N m] that laws are compared along: as commanded, or the model's if computed.

        A computed one holds the residual's own noise. Samples where it is large are those that were misread
        one way, and any law would seem to be larger there than elsewhere.
        """
        if not self.motion.computed or self.rigid is None or not self.motion.dynamic:
            return self.motion.u
        return self.motion.reduce(self.delivered_torque)

    def names_of(self, kind: str) -> tuple[str, ...]:
        """Joints, the arm, or links but the last: a mass there and one in the gripper are the same."""
        if kind == "joint":
            return self.places
        if kind == "arm":
            return (f"arm:{self.recording.arm.role}",)
        assert self.rigid is not None
        return tuple(f"link:{name}" for name in self.rigid.links[:-1])

    # -- where columns go ------------------------------------------------------------------------------

    def drive(self, joint: int, full: np.ndarray) -> Columns:
        """Columns (p, F) at full rate that act between commanded effort and torque sensor of a joint."""
        channel = drive_channel(self.channels)
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
        by_law = self.motion.computed and drive_channel(self.channels) in self.channels
        return "controller" in self.channels or by_law

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
        return self.rigid.position_derivative(self.motion.q, self.motion.dq, self.motion.sure_ddq)

    @cached_property
    def regressor(self) -> np.ndarray:
        """Inertial regressor (N, J, J links, 10)."""
        assert self.rigid is not None
        return self.rigid.regressor(self.motion.q, self.motion.dq, self.motion.sure_ddq)

    @cached_property
    def tilt(self) -> np.ndarray:
        """Inverse dynamics (2, N, J) per radian of base tilt about the base's x and y axes."""
        assert self.rigid is not None
        g = self.rigid.gravity_vector
        q, zero = self.motion.q, np.zeros_like(self.motion.q)
        axes = np.eye(3)[:2]
        # Gravity seen from a base rotated by a small angle about an axis: g - angle * axis x g. Gravity
        # torques are linear in gravity, so a unit angle is evaluated exactly.
        turned = [self.rigid.inverse_dynamics(q, zero, zero, -np.cross(axis, g)) for axis in axes]
        return np.stack(turned) - self.rigid.spring_torque(q)

    @cached_property
    def model_torque(self) -> np.ndarray:
        """Link-side torque of the nominal model along the measured motion (N, J)."""
        motion = self.motion
        if self.equations.model is not None and motion.sure_ddq is motion.ddq:
            return self.equations.model
        assert self.rigid is not None
        return self.rigid.inverse_dynamics(motion.q, motion.dq, motion.sure_ddq)

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
        calm, swings = self._slow_torque
        return np.where(swings, self.motion.sure_torque, calm)

    @cached_property
    def _slow_torque(self) -> tuple[np.ndarray, np.ndarray]:
        """Motors' torque (F, J) below `ROTOR_HZ`, and which joints' fast torque is more than noise, (J,)."""
        motion, torque = self.motion, self.motion.sure_torque
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
        friction = nominal_friction(self.recording.arm, motion.sure_velocity)
        return self.rotor * self.sure_acceleration + friction

    @cached_property
    def sure_acceleration(self) -> np.ndarray:
        """Accelerations (F, J) at full rate, their fast parts only where they are more than noise.

        The noise of measured accelerations is in the link residual too: twisted through a spring it comes
        back with the sign of a resonance, and a rigid joint would seem to give. Only where a joint swings
        well above that noise are its fast accelerations used.
        """
        motion = self.motion
        acceleration = motion.sure_acceleration
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
        torque = motion.sure_torque - self.rotor_share
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
            motion.full_position, motion.full_velocity, motion.sure_acceleration
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
        return self.rigid.base_reaction(self.motion.q, self.motion.dq, self.motion.sure_ddq)

    @cached_property
    def rotor(self) -> np.ndarray:
        """Nominal rotor inertia (J,)."""
        return armature(self.recording.arm)

    @cached_property
    def lost_to_speed(self) -> np.ndarray:
        """Torque per speed (J,) that the equations take off by what was read: damping and back-EMF."""
        motion, stated = self.motion, joint_dynamics(self.recording.arm).damping
        law = None if motion.controller is None else motion.controller.law
        if law is None or (law.after_back_emf and self.recording.commanded_effort is not None):
            return stated
        return stated + law.of_joints("back_emf", self.joints)

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


def as_arms(trials: Sequence[Observed]) -> list[Trial]:
    """The trials of what can only be an arm's: laws, plants, excitation."""
    arms = [t for t in trials if isinstance(t, Trial)]
    assert len(arms) == len(trials), "recordings of another kind reached a computation of arms"
    return arms


def add(*parts: Columns) -> Columns:
    """Sum of columns that share their parameters."""
    out: Columns = {}
    for part in parts:
        for key, value in part.items():
            out[key] = out[key] + value if key in out else value
    return out
