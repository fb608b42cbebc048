"""A pendulum that was let go: nothing drives it, and its bearing's friction is told by its swing alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.effects.description.model_scale import EFFECT as MODEL_SCALE
from samrl_core.diagnosis.effects.form import Place
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from samrl_ros.log_import.draft.guess import Effort
from samrl_ros.log_import.foreign import read_runs

MASS, LENGTH, G = 0.5, 0.6, 9.81
ABOUT_CENTER = MASS * LENGTH**2 / 12
URDF = (
    '<robot name="p"><link name="base"/><link name="rod"><inertial>'
    f'<origin xyz="0 0 {-LENGTH / 2}"/><mass value="{MASS}"/><inertia ixx="{ABOUT_CENTER}" ixy="0" ixz="0"'
    f' iyy="{ABOUT_CENTER}" iyz="0" izz="1e-5"/></inertial></link><joint name="pivot" type="continuous">'
    '<parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>'
)
FAMILIES = {"viscous_friction", "coulomb_friction", "load_dependent_friction", "payload", "base_tilt"}
TWO = URDF.replace(
    "</robot>",
    '<link name="end"><inertial><mass value="0.2"/><inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0"'
    ' izz="1e-3"/></inertial></link><joint name="elbow" type="continuous"><origin xyz="0 0 -0.6"/>'
    '<parent link="rod"/><child link="end"/><axis xyz="0 1 0"/></joint></robot>',
)
LIBRARY = DiagnosisSettings(library=FAMILIES)


def swing(path: Path, start: float, viscous: float, seed: int) -> ArmRecording:
    """A log in degrees as a potentiometer gives it."""
    inertia = MASS * LENGTH**2 / 3
    time = np.arange(0.0, 12.0, 0.01)

    def rate(_: float, y: np.ndarray) -> list[float]:
        return [y[1], (-0.5 * MASS * G * LENGTH * np.sin(y[0]) - viscous * y[1]) / inertia]

    angle = np.degrees(solve_ivp(rate, (0.0, 12.0), [start, 0.0], t_eval=time, rtol=1e-9, atol=1e-10).y[0])
    angle += 0.05 * np.random.default_rng(seed).standard_normal(len(time))
    rows = np.column_stack([time, angle])
    np.savetxt(path, rows, delimiter=",", header="time,angle_deg", comments="", fmt="%.4f")
    return read_runs(path, URDF, None, Effort.passive)[0][0]


@pytest.mark.thorough
@pytest.mark.parametrize("viscous", [0.0, 0.012])
def test_a_bearings_friction_is_told_by_the_swing(viscous: float, tmp_path: Path) -> None:
    fit = swing(tmp_path / "a.csv", np.radians(70.0), viscous, 1)
    held_out = swing(tmp_path / "b.csv", np.radians(-55.0), viscous, 2)
    diagnosis, _ = diagnose([fit], [held_out], LIBRARY)
    if not viscous:
        assert diagnosis.verdict == "no_gap", diagnosis.reasons
        return
    (effect,) = diagnosis.effects
    assert (effect.family, effect.place) == ("viscous_friction", "joint:pivot")
    assert effect.parameters["Fv"].value == pytest.approx(viscous, rel=0.1)


def swinging(folder: Path, urdf: str, joints: int) -> Trial:
    """Joints that swing by themselves, as somebody logs them; whether they obey the model does not matter."""
    time = np.arange(0.0, 6.0, 0.01)
    angles = [0.5 * np.cos((2.0 + i) * time) for i in range(joints)]
    header = ",".join(["time", *["pivot_rad", "elbow_rad"][:joints]])
    np.savetxt(folder / "a.csv", np.column_stack([time, *angles]), delimiter=",", header=header, comments="")
    recording = read_runs(folder / "a.csv", urdf, None, Effort.passive)[0][0]
    return Trial(recording, RigidArm(recording.arm))


@pytest.mark.parametrize(("urdf", "joints"), [(URDF, 1), (TWO, 2)])
def test_no_factor_is_sought_where_nothing_drives(urdf: str, joints: int, tmp_path: Path) -> None:
    """A double pendulum with nothing wrong had "torques 0.25", one with Coulomb friction "masses 0.63".

    Zero times a factor explains nothing, and lighter links with the stated friction swing as those with more.
    """
    trial = swinging(tmp_path, urdf, joints)
    assert MODEL_SCALE.forms(trial, Place.find(trial, "arm:tool_arm")) == ()
    assert "nothing drives" in (MODEL_SCALE.why_unobservable(trial) or "")
