"""A machine that is off its description by no more than is tolerated."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters


def sample_plant(trial: Trial, rng: np.random.Generator) -> PlantParameters:
    """A nominal arm within its tolerances, uniformly."""
    rigid, arm = trial.rigid, trial.recording.arm
    assert rigid is not None
    tolerances, joints = arm.tolerances, trial.joints

    def within(values: float | tuple[float, ...], unit: np.ndarray | float) -> np.ndarray:
        return np.asarray(values) * unit * rng.uniform(-1, 1, size=joints)

    delta = np.zeros((joints, 10))
    for link, p in enumerate(rigid.inertial_parameters):
        mass = max(float(p[0]), 1e-6)
        delta[link] = p * tolerances.mass * rng.uniform(-1, 1)
        delta[link, 1:4] += mass * tolerances.center_of_mass * rng.uniform(-1, 1, size=3)
        # Along the nominal inertia, so that it stays one that a body can have.
        delta[link, 4:] += p[4:] * tolerances.inertia * rng.uniform(-1, 1)
    scale = trial.scale
    tilt = tolerances.base_tilt * rng.uniform(-1, 1, size=2)
    gravity = rigid.gravity_vector
    return PlantParameters(
        inertial_delta=delta,
        torque_offset=within(tolerances.torque_offset, scale),
        sensor_bias=within(tolerances.torque_offset, scale),
        coulomb=np.abs(within(tolerances.coulomb_friction, scale)),
        viscous=np.abs(within(tolerances.viscous_friction, scale / trial.speed_scale)),
        rotor_inertia=within(tolerances.armature, trial.rotor),
        gravity=gravity - np.cross(np.array([tilt[0], tilt[1], 0.0]), gravity),
    )
