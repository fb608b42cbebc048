"""One correction in every simulator's words: attributes, statements, the gap closed by other engines."""

from __future__ import annotations

import json
import runpy
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.export.correction import BODY, Correction, read_correction, write_correction
from samrl_core.diagnosis.export.export import TARGETS, write_export
from samrl_core.diagnosis.export.generated_mjcf import generated_mjcf
from samrl_core.diagnosis.export.missing import WORDS
from samrl_core.diagnosis.export.nearest import BEYOND, PLAIN, level_and_slope
from samrl_core.diagnosis.export.randomise import SCRIPT
from samrl_core.diagnosis.export.to_mjcf import IN_ACTUATOR, to_mjcf
from samrl_core.diagnosis.export.to_urdf import to_urdf
from samrl_core.diagnosis.simulation.plant_parameters import joint_fields
from tests.diagnosis import worlds
from tests.diagnosis.worlds import ARMATURE, LIFT

mujoco: Any = pytest.importorskip("mujoco")


@pytest.fixture(scope="module")
def found() -> Correction:
    """Of an arm with friction at its lifting joint."""
    a, b, c = worlds.world(5, coulomb={LIFT: 1.6})
    _, far = diagnose([a, b], [c], DiagnosisSettings(library={"coulomb_friction", "payload"}))
    assert isinstance(far.correction, Correction)
    return far.correction


def changed(found: Correction, **fields: Any) -> Correction:
    """The same with other fields; per-joint ones as {joint: value}."""
    values = {
        name: np.asarray(worlds.spread(name, v) if isinstance(v, dict) else v, dtype=float)
        for name, v in fields.items()
    }
    return replace(found, fields=values, samples={})


def joint_of(text: str, name: str) -> ElementTree.Element:
    """A joint's element."""
    found = [e for e in ElementTree.fromstring(text).iter("joint") if e.get("name") == name]
    return found[0]


def test_a_correction_survives_its_files(found: Correction, tmp_path: Path) -> None:
    write_correction(found, tmp_path)
    again = read_correction(tmp_path)
    assert again.effects == ("coulomb_friction@joint:lift",) and again.law == found.law
    assert again.promise["shrink"] == pytest.approx(found.promise["shrink"])
    for name, value in found.fields.items():
        assert np.array_equal(again.fields[name], value)
    assert np.array_equal(again.held_out[0]["measured_position"], found.held_out[0]["measured_position"])
    with pytest.raises(InputError, match=r"has no correction\.json.*diagnose again"):
        read_correction(tmp_path / "nowhere")


# PyBullet has no rotors: the link carries them, and joints with parallel axes feel it.
@pytest.mark.parametrize("target, share", [("mujoco", 0.9), ("pybullet", 0.8)])
def test_another_engine_closes_the_gap_that_was_promised(
    found: Correction, target: str, share: float, tmp_path: Path
) -> None:
    done = write_export(found, target, tmp_path / target, randomise=True)
    assert done.resimulated is not None
    assert done.resimulated["shrink"] > share * found.promise["shrink"], done.resimulated
    drawn = json.loads((tmp_path / target / "randomise.json").read_text())
    entry = next(e for e in drawn["draw"] if e["field"] == "coulomb")
    assert entry["range95"][0] < 1.6 < entry["range95"][1] and entry["place"] == "joint:lift"
    assert [e["field"] for e in drawn["draw"]] == ["coulomb"]  # what is neutral is not drawn
    assert np.shape(drawn["covariance"]) == (1, 1)
    page = (tmp_path / target / "export.html").read_text()
    assert "friction" in page and "data:image/png" in page


def test_draws_do_not_pile_up_at_the_ends_of_their_ranges(tmp_path: Path) -> None:
    """One in twenty of each number was cut to an end, which no posterior has there."""
    covariance = np.array([[1.0, 0.9], [0.9, 1.0]])
    entries = [{"mean": 0.0, "range95": [-1.96, 1.96]} for _ in covariance]
    (tmp_path / "randomise.json").write_text(json.dumps({"draw": entries, "covariance": covariance.tolist()}))
    (tmp_path / "randomise.py").write_text(SCRIPT)
    script = runpy.run_path(str(tmp_path / "randomise.py"))
    rng = np.random.default_rng(0)
    values = np.array([[value for _, value in script["draw"](rng)] for _ in range(400)])
    assert np.all(np.abs(values) < 1.96) and np.abs(values).max() > 1.8
    assert np.corrcoef(values.T)[0, 1] > 0.8


@pytest.mark.parametrize("target", TARGETS)
def test_every_target_has_a_changed_model_a_diff_and_a_page(
    found: Correction, target: str, tmp_path: Path
) -> None:
    done = write_export(found, target, tmp_path / "out", resimulate=False)
    names = {f.name for f in done.files}
    assert {"changes.diff", "export.html", "export.json"} <= names
    assert [s.how for s in done.statements if s.place == "joint:lift" and s.what == "friction"] == ["exact"]
    diff = (tmp_path / "out" / "changes.diff").read_text()
    assert "+" in diff and "friction" in diff
    if target == "isaaclab":
        code = (tmp_path / "out" / "actuators.py").read_text()
        compile(code, "actuators.py", "exec")
        assert '"lift": ImplicitActuatorCfg' in code and "armature=0.06" in code
    with pytest.raises(InputError, match="exists already"):
        write_export(found, target, tmp_path / "out")


def test_a_diff_holds_the_changed_lines_alone(found: Correction) -> None:
    text, _ = to_urdf(changed(found, viscous={LIFT: 0.5}), worlds.URDF)
    old, new = worlds.URDF.splitlines(), text.splitlines()
    assert [line for line in new if line not in old] == ['  <dynamics damping="0.5" friction="0"/>'] or len(
        new
    ) > len(old)
    assert set(old) - set(new) == set() or len(set(old) - set(new)) == 1


def test_stribeck_is_the_best_level_and_slope_with_its_error(found: Correction) -> None:
    falling = changed(found, coulomb={LIFT: 0.5}, stribeck_drop={LIFT: 0.8}, stribeck_velocity={LIFT: 0.1})
    near = level_and_slope(falling, LIFT)
    assert 0.5 < near.friction < 1.3 and 0.05 < near.error < 0.6
    _, said = to_mjcf(falling, generated_mjcf(falling), None)
    (one,) = [s for s in said if s.place == "joint:lift"]
    assert one.how == "nearest" and one.error == pytest.approx(near.error) and "rad/s" in one.said


def test_a_generated_mjcf_is_the_nominal_arm(found: Correction) -> None:
    model = mujoco.MjModel.from_xml_string(generated_mjcf(found))
    index = [model.joint(name).dofadr[0] for name in found.joints]
    assert np.allclose(model.dof_armature[index], ARMATURE)
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    rigid = worlds.loop(1.0).model.rigid
    q, v, a = rng.normal(size=(3, 3))
    data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
    model.dof_damping[:] = model.dof_frictionloss[:] = 0
    mujoco.mj_inverse(model, data)
    assert np.allclose(data.qfrc_inverse, rigid.inverse_dynamics(q[None], v[None], a[None])[0] + ARMATURE * a)


def test_a_body_that_became_heavier_is_the_same_in_mujoco_and_urdf(found: Correction) -> None:
    delta = np.zeros((3, 10))
    delta[2] = [0.5, 0.1, 0.0, 0.02, 0.002, 0.0, 0.022, -0.004, 0.0, 0.02]
    heavier = changed(found, **{BODY: delta})
    text, said = to_mjcf(heavier, generated_mjcf(heavier), None)
    assert [s.how for s in said] == ["exact"], said
    rigid = worlds.loop(1.0).model.rigid
    model = mujoco.MjModel.from_xml_string(text)
    urdf, _ = to_urdf(heavier, worlds.URDF)
    other = mujoco.MjModel.from_xml_string(generated_mjcf(replace(heavier, urdf=urdf)))
    q = np.array([0.3, -0.5, 0.9])
    wanted = rigid.gravity(q[None])[0] + np.einsum(
        "jk,k->j", rigid.regressor(q[None], 0 * q[None], 0 * q[None])[0][:, 2], delta[2]
    )
    for one in (model, other):
        data = mujoco.MjData(one)
        data.qpos[:] = q
        mujoco.mj_forward(one, data)
        assert np.allclose(data.qfrc_bias, wanted, atol=1e-6)


def test_an_encoders_offset_turns_the_zero(found: Correction) -> None:
    """The links stand at the reading less the offset."""
    shifted = changed(found, encoder_offset={LIFT: 0.2})
    q = np.array([0.3, -0.5, 0.9])
    true = q - np.array([0.0, 0.2, 0.0])
    wanted = worlds.loop(1.0).model.rigid.gravity(true[None])[0]
    text, _ = to_mjcf(shifted, generated_mjcf(shifted), None)
    urdf, _ = to_urdf(shifted, worlds.URDF)
    for model in (text, generated_mjcf(replace(shifted, urdf=urdf))):
        one = mujoco.MjModel.from_xml_string(model)
        data = mujoco.MjData(one)
        data.qpos[:] = q
        mujoco.mj_forward(one, data)
        assert np.allclose(data.qfrc_bias, wanted, atol=1e-6)


SERVO = """<mujoco>
  <worldbody>
    <body>
      <joint name="turn" axis="0 0 1"/> <!-- kept -->
      <geom size="0.1"/>
    </body>
  </worldbody>
  <actuator>
    <position joint="turn" kp="300" kv="24"/>
  </actuator>
</mujoco>
"""


def test_a_servos_gain_bias_delay_and_filter_are_in_its_actuator(found: Correction) -> None:
    one = replace(
        found, joints=("turn",), friction=np.zeros(1), damping=np.zeros(1), armature=np.zeros(1), samples={}
    )

    def written(**fields: float) -> tuple[Any, str, list[str]]:
        text, said = to_mjcf(replace(one, fields={k: np.array([v]) for k, v in fields.items()}), SERVO, None)
        return mujoco.MjModel.from_xml_string(text), text, [s.how for s in said]

    model, text, hows = written(stiffness_scale=0.8, damping_scale=0.5, actuator_gain=-0.1)
    assert model.actuator_gainprm[0, 0] == pytest.approx(216) and hows == ["exact"] * 3
    assert model.actuator_biasprm[0, :3].tolist() == pytest.approx([0, -216, -10.8])
    assert "<!-- kept -->" in text and '<position joint="turn" kp="216" kv="10.8"/>' in text
    model, text, _ = written(torque_offset=1.5)
    assert model.actuator_biasprm[0, :3].tolist() == pytest.approx([1.5, -300, -24]) and "<general" in text
    model, _, _ = written(command_delay=0.01)
    assert float(np.ravel(model.actuator_delay[0])[0]) == pytest.approx(0.01)
    model, text, _ = written(command_cutoff=10.0)
    assert model.na == 1 and model.actuator_gainprm[0, 0] == pytest.approx(300)
    assert model.actuator_dynprm[0, 0] == pytest.approx(1 / (2 * np.pi * 10))


def test_a_spring_and_what_it_lacked_are_one(found: Correction) -> None:
    softer = changed(found, cable_stiffness={LIFT: -1.0}, cable_rest={LIFT: 0.5})
    text = generated_mjcf(softer).replace('name="lift"', 'name="lift" stiffness="4" springref="0.2"', 1)
    model = mujoco.MjModel.from_xml_string(to_mjcf(softer, text, None)[0])
    j = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, "lift")
    # 4 (q - 0.2) - (q - 0.5) = 3 (q - 0.1)
    assert model.jnt_stiffness[j] == pytest.approx(3.0) and model.qpos_spring[j] == pytest.approx(0.1)


def test_every_field_is_written_or_spoken_of(found: Correction) -> None:
    known = {
        *PLAIN,
        *BEYOND,
        *IN_ACTUATOR,
        "rotor_inertia",
        "encoder_offset",
        "cable_stiffness",
        "effort_limit",
    }
    of_another_field = {  # spoken of with the field that they belong to
        "coulomb_velocity", "stribeck_velocity", "stribeck_exponent", "friction_harmonic_order",
        "friction_harmonic_phase",
        "thermal_time", "thermal_offset", "cable_rest", "encoder_phase", "joint_damping", "hysteresis_torque",
        "harmonic_order", "harmonic_phase", "encoder_resolution",
    }  # fmt: skip
    assert not set(joint_fields()) - of_another_field - set(WORDS) - known
    gravity = np.array([0.1, 0.0, -9.8])
    everything = {name: {LIFT: 0.5} for name in joint_fields() if name not in ("joint_stiffness",)}
    all_of_it = changed(found, **everything, gravity=gravity, mount_stiffness=np.array(800.0))
    for dialect in ("urdf", "gazebo", "pybullet"):
        _, said = to_urdf(all_of_it, worlds.URDF, dialect)
        spoken = " ".join(s.what for s in said)
        assert all(
            name in spoken
            for name in ("harmonic_amplitude", "backlash", "gravity", "mount_stiffness", "sensor_gain")
        )
