"""Mismatch between a real arm and its nominal model in every world, scaled by the tolerances."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from samrl_core.blind_test.disturbances.load.base_tilt import tilted
from samrl_core.blind_test.engines.arm_body import ArmBody, scaled_inertia, with_tool
from samrl_core.blind_test.engines.simulate import Reality
from samrl_core.blind_test.worlds.stated_friction import StatedFriction, near
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.types.arm_description import STANDARD_GRAVITY, NominalTool, Tolerances


@dataclass(frozen=True, eq=False)
class Background:
    """A sampled arm; arrays (J,) unless noted. The label holds the values."""

    body: ArmBody  # with tool
    reality: Reality
    sensor_offset: np.ndarray  # of the torque sensors [N m]
    effort_noise: float  # standard deviation [N m]
    stamp_offsets: np.ndarray  # (3,) of states, command, commanded effort, constant in a world [s]
    stamp_jitter: float  # standard deviation of each stamp [s]
    label: dict


def _spread(value: float | tuple[float, ...], base: np.ndarray) -> np.ndarray:
    return np.asarray(value, dtype=float) * base


def sample_background(
    spec: RobotSpec,
    nominal_body: ArmBody,
    tool: NominalTool,
    armature: np.ndarray,
    tolerances: Tolerances,
    scale: float,
    rng: np.random.Generator,
    stated: StatedFriction,
) -> Background:
    """Sample an arm uniformly within `scale` times the tolerances.

    Link inertias keep positive second moments, so each is that of some body.
    """
    limits, joints = spec.limits, len(spec.joint_names)
    links, mass_errors, shifts = [], [], []
    for link in nominal_body.links:
        error = scale * tolerances.mass * rng.uniform(-1, 1)
        shift = scale * tolerances.center_of_mass * rng.uniform(-1, 1, size=3)
        # Second moments off by r make moments of inertia off by r at most.
        factors = 1.0 + scale * tolerances.inertia * rng.uniform(-1, 1, size=3)
        links.append(
            replace(
                link,
                mass=link.mass * (1 + error),
                center_of_mass=link.center_of_mass + shift,
                inertia=scaled_inertia(link.inertia, factors),
            )
        )
        mass_errors.append(error)
        shifts.append(shift.tolist())
    tool_error = scale * tolerances.tool_mass * rng.uniform(-1, 1)
    real_tool = NominalTool(
        tool.mass * (1 + tool_error), tool.center_of_mass, tool.inertia * (1 + tool_error)
    )
    body = with_tool(ArmBody(tuple(links), nominal_body.flange_in_last), real_tool)

    drive, sensor = (
        scale * _spread(tolerances.torque_offset, limits.effort) * rng.uniform(-1, 1, size=joints)
        for _ in range(2)
    )
    dry_width = scale * _spread(tolerances.coulomb_friction, limits.effort)
    wet_width = scale * _spread(tolerances.viscous_friction, limits.effort / limits.velocity)
    shares = rng.uniform(0, 1, size=joints), rng.uniform(0, 1, size=joints)
    coulomb, viscous, dry = dry_width * shares[0], wet_width * shares[1], np.zeros(0)
    if stated.any:
        dry, viscous = near(stated.dry, dry_width, shares[0]), near(stated.wet, wet_width, shares[1])
        coulomb = np.zeros(joints)
    tilt = scale * tolerances.base_tilt * rng.uniform(-1, 1, size=2)
    rotor = armature * (1 + scale * tolerances.armature * rng.uniform(-1, 1, size=joints))
    # A stamp's offset is against another channel: half of it on each side.
    stamps = 0.5 * scale * tolerances.stamp * rng.uniform(-1, 1, size=3)
    reality = Reality(
        armature=rotor,
        coulomb=coulomb,
        viscous=viscous,
        stribeck_velocity=float(rng.uniform(0.005, 0.03)),
        drive_offset=drive,
        gravity=tilted(np.array(STANDARD_GRAVITY), float(tilt[0]), float(tilt[1])),
        position_noise=float(rng.uniform(1e-5, 5e-5)),
        velocity_noise=float(rng.uniform(3e-4, 1.5e-3)),
        dry=dry,
    )
    if stated.any:  # encoders that round make the noise
        reality = replace(reality, position_noise=0.0, velocity_noise=0.0)
    effort_noise = float(rng.uniform(0.02, 0.08))
    jitter = float(rng.uniform(1e-5, 5e-5))
    label = {
        "scale": scale,
        "link_mass_error": mass_errors,
        "link_center_of_mass_error_m": shifts,
        "tool_mass_error": float(tool_error),
        "drive_offset_nm": drive.tolist(),
        "sensor_offset_nm": sensor.tolist(),
        "coulomb_nm": (dry if stated.any else coulomb).tolist(),
        "viscous_nms_rad": viscous.tolist(),
        "armature_kgm2": rotor.tolist(),
        "base_tilt_rad": tilt.tolist(),
        "stamp_offsets_s": stamps.tolist(),
        "stamp_jitter_s": jitter,
        "noise": {
            "position_rad": reality.position_noise,
            "velocity_rad_s": reality.velocity_noise,
            "effort_nm": effort_noise,
        },
    }
    return Background(body, reality, sensor, effort_noise, stamps, jitter, label)
