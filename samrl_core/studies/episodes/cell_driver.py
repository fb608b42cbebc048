"""What a study needs of a simulated cell: an observation, and an arm moved to a joint position."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, CellCorrection
from samrl_core.cell.robots.arm_model import ArmModel, nominal_payloads
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.observation import ArmCommand, Observation
from samrl_core.cell.types.scene import Tool
from samrl_core.cell.world.world import SimulatedWorld


class CellDriver:
    """Commands a world as a driver would, without ROS; reads nothing but sensors."""

    def __init__(
        self,
        world: SimulatedWorld,
        cell: CellSpec,
        tool: Tool,
        correction: CellCorrection = NO_CORRECTION,
    ) -> None:
        """The arms' models are the nominal ones with camera and tool as payloads; images are corrected."""
        self.world = world
        self._correction = correction
        self._cell = cell
        load = nominal_payloads(cell, tool)
        self._arms = {r: ArmModel(cell.arm(r), cell.base_in_world(r), load[r]) for r in ROLES}

    def observe(self) -> Observation:
        """Image and joints of this instant; the camera's pose is that of the measured joints."""
        tool, camera = self.world.read_arm("tool_arm"), self.world.read_arm("camera_arm")
        pose = self._arms["camera_arm"].flange_in_world(camera.position) @ self._cell.camera_in_flange
        frame = self._correction.frame(self.world.read_camera(), self._cell.intrinsics)
        return Observation(frame, Camera(self._cell.intrinsics, pose), tool, camera)

    def move(self, role: str, joint_position: np.ndarray, slowest_share: float = 0.5) -> float:
        """Straight in joint space along a quintic of minimal jerk, then 0.2 s of rest.

        Args:
            role: `tool_arm` or `camera_arm`; the other one holds still.
            joint_position: where to (J,) [rad].
            slowest_share: share of the velocity limits that the busiest joint uses.

        Returns:
            Time of the motion [s].
        """
        spec, arm = self._cell.arm(role), self._arms[role]
        start = self.world.read_arm(role).position
        way = np.asarray(joint_position) - start
        # Peak velocity of the quintic is 15/8 of the mean (Flash and Hogan 1985).
        duration = max(0.3, float(np.max(np.abs(way) / (slowest_share * spec.limits.velocity))) * 15 / 8)
        period = spec.controller.period_s
        for k in range(round((duration + 0.2) / period)):
            s = min(1.0, (k + 1) * period / duration)
            q = start + way * (10 * s**3 - 15 * s**4 + 6 * s**5)
            dq = way * (30 * s**2 - 60 * s**3 + 30 * s**4) / duration
            ddq = way * (60 * s - 180 * s**2 + 120 * s**3) / duration**2
            effort = arm.effort_without_gravity(q, dq, ddq)
            self.world.command(role, ArmCommand(self.world.time_ns, q, dq, ddq, effort))
            self.world.advance()
        return duration
