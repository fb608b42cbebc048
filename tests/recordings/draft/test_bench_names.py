"""Names of small benches' logs: a microcontroller's clock and duty cycle, a voltage called `Vm`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.io import savemat

from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.column_names import is_time, meaning
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.joints.motor_input import TORQUE_CONSTANT
from samrl_ros.log_import.foreign import read_runs
from samrl_ros.log_import.importer import import_recording
from samrl_ros.log_import.mapping import parse_mapping
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.tables import read_table
from tests.recordings.logs.columns import TIME, TURNED, WAVE, write


def questions_of(draft: Draft, key: str) -> str:
    return "\n".join(guess.question for guess in draft.of(key))


@pytest.mark.parametrize(
    ("name", "unit"),
    [("millis", "ms"), ("micros", "us"), ("ticks_ms", "ms"), ("ticks_us", "us"), ("t_msec", "ms")],
)
def test_a_microcontrollers_clock_is_one_by_its_name(name: str, unit: str, tmp_path: Path) -> None:
    """It said `no column is a clock` and asked for the rate."""
    times = 812 + np.round(TIME * {"ms": 1e3, "us": 1e6}[unit])
    draft = draft_any([write(tmp_path / "a.csv", **{name: times, "q_rad": WAVE})], None, None)
    assert draft.sources["states"]["time"] == {"column": name, "unit": unit}
    assert not questions_of(draft, "sources.states.time")


def test_ticks_of_no_unit_of_time_are_an_encoders() -> None:
    assert not is_time("ticks") and not is_time("left_ticks") and not is_time("ticks_per_ms")
    assert meaning("ticks").quantity == meaning("enc_ticks").quantity == "position"


def bench(path: Path, target: bool = True, **drive: np.ndarray) -> Path:
    """A driven joint with an encoder and what its motor was given."""
    goal = {"target": np.round(520.0 * WAVE)} if target else {}
    return write(path, millis=1e3 * TIME, enc=np.round(500.0 * WAVE), **drive, **goal)


@pytest.mark.parametrize("target", [True, False])
@pytest.mark.parametrize(("largest", "full"), [(73, "255"), (600, "1023"), (0.7, "1")])
def test_a_duty_cycle_is_asked_for_its_volts(target: bool, largest: float, full: str, tmp_path: Path) -> None:
    """Beside a command it was left out without a question, without one it was taken for volts."""
    duty = largest * TURNED if largest < 1 else np.round(largest * TURNED)
    draft = draft_any([bench(tmp_path / "a.csv", target, pwm=duty)], None, None)
    effort = draft.channels["commanded_effort"]["effort"]
    assert effort == {"formula": [f"12.0 / {full} * pwm_1"], "unit": "V"}
    assert "how many volts" in questions_of(draft, "channels.commanded_effort.effort")
    assert "resistance [ohm]" in questions_of(draft, "controller")
    assert ("voltage_servo" in questions_of(draft, "controller")) == target
    content = {key: value for key, value in draft.as_mapping().items() if key != "questions"}
    mapping = parse_mapping(yaml.safe_dump(content), tmp_path / "m.yaml")
    made = import_recording(mapping.recordings[0], mapping, tmp_path).recording
    assert made.commanded_effort is not None and made.commanded_effort.effort is not None
    np.testing.assert_allclose(made.commanded_effort.effort[:, 0], 12.0 / float(full) * duty, atol=1e-5)


def test_a_duty_cycle_in_per_cent(tmp_path: Path) -> None:
    draft = draft_any([bench(tmp_path / "a.csv", **{"duty[%]": np.round(60.0 * TURNED)})], None, None)
    assert draft.channels["commanded_effort"]["effort"]["formula"] == ["12.0 / 100 * duty_1"]


@pytest.mark.parametrize("drive", [{"pwm": 1500.0 + 80.0 * WAVE}, {"battery_V": 12.0 + 0.1 * WAVE}])
def test_what_has_one_sign_drives_no_motor(drive: dict[str, np.ndarray], tmp_path: Path) -> None:
    draft = draft_any([bench(tmp_path / "a.csv", **drive)], None, None)
    assert "commanded_effort" not in draft.channels and not draft.controller


def test_volts_beside_a_command_are_left_out_aloud_where_nobody_answers(tmp_path: Path) -> None:
    log = write(tmp_path / "a.csv", time_s=TIME, q_rad=WAVE, q_cmd_rad=1.01 * WAVE, Vm=3.0 * TURNED)
    drafted = draft_any([log], None, None)
    assert drafted.channels["commanded_effort"]["effort"]["unit"] == "V"
    assert any(guess.asks == TORQUE_CONSTANT for guess in drafted.guesses)
    (recording,), notes = read_runs(log, None, None, Effort.ask)
    assert recording.commanded_effort is None
    assert any("left out" in note and "Vm" in note for note in notes)


@pytest.mark.parametrize(("name", "quantity"), [("Vm", "voltage"), ("V_mot", "voltage"), ("I_m", "current")])
def test_letters_of_a_motors_volts_and_amperes(name: str, quantity: str) -> None:
    assert meaning(name).quantity == quantity
    assert meaning(name.lower()).quantity == ""  # a measured speed, as often


def controllers_log(path: Path, **torques: np.ndarray) -> Draft:
    """A joint with a commanded position and these torques."""
    columns = {"time_s": TIME, "pos_meas_rad": WAVE, "pos_des_rad": 1.01 * WAVE}
    return draft_any([write(path, **columns, **torques)], None, None)


def used_torque(draft: Draft) -> str:
    (formula,) = draft.channels["commanded_effort"]["effort"]["formula"]
    return draft.sources["states"]["columns"][formula]


def test_a_torque_that_is_zero_throughout_drives_nothing(tmp_path: Path) -> None:
    """The zeros of a trajectory without feed-forward were taken for what the drives were asked for."""
    torques = {"tau_meas": 2.0 * TURNED, "tau_des": 0.0 * TIME}
    draft = controllers_log(tmp_path / "a.csv", **torques, tau_con=2.1 * TURNED)
    assert used_torque(draft) == "tau_con"
    assert "a.csv: tau_des: zero throughout: it drives nothing" in draft.unused
    assert used_torque(controllers_log(tmp_path / "b.csv", **torques)) == "tau_meas"
    alone = controllers_log(tmp_path / "c.csv", tau_des=0.0 * TIME)
    assert used_torque(alone) == "tau_des"


def test_which_of_two_commanded_torques_is_asked(tmp_path: Path) -> None:
    draft = controllers_log(tmp_path / "a.csv", tau_des=1.9 * TURNED, tau_con=2.1 * TURNED)
    assert "and not a.csv: tau_con?" in questions_of(draft, "channels.commanded_effort.effort")


TWO = """<robot name="w"><link name="base"/><link name="rod_link"/><link name="disc"/>
<joint name="rod" type="continuous"><parent link="base"/><child link="rod_link"/><axis xyz="0 1 0"/></joint>
<joint name="wheel" type="continuous"><parent link="rod_link"/><child link="disc"/><axis xyz="0 1 0"/></joint>
</robot>"""


def test_a_wheels_speed_alone_is_told_with_its_formula(tmp_path: Path) -> None:
    """It was called `n_{}[rpm]`, and the question was of ['']."""
    columns = {"t[ms]": 1e3 * TIME, "phi[deg]": 40.0 * WAVE, "phi_dot[deg/s]": 80.0 * TURNED}
    log = write(tmp_path / "a.csv", **columns, **{"n_wheel[rpm]": 300.0 * WAVE, "i_mot[mA]": 900.0 * TURNED})
    draft = draft_any([log], TWO, "w.urdf")
    assert "the log has a.csv: phi[deg], the URDF moves rod, wheel" in questions_of(draft, "joints")
    (told,) = [each for each in draft.unused if "n_wheel[rpm]" in each]
    assert "a speed without a position" in told and "6 * integral(x, time)" in told and "(deg)" in told


def test_rows_of_units_that_repeat_their_key(tmp_path: Path) -> None:
    """Simulink's Data Inspector: `theta_arm [Type: double]` was a name, and its unit was lost."""
    names = ["time", "theta_arm", "theta_dot", "Vm"]
    above = [",".join(names)]
    above += [",Type: double,Type: double,Type: double", ",Unit: deg,Unit: deg/s,Unit: V"]
    above += [",Interp: linear,Interp: linear,Interp: zoh"]
    log = write(tmp_path / "a.csv", a=TIME, b=40.0 * WAVE, c=80.0 * TURNED, d=3.0 * TURNED)
    log.write_text("\n".join([*above, *log.read_text().splitlines()[1:]]))
    draft = draft_any([log], None, None)
    assert draft.sources["states"]["csv"]["header"] == [
        "time",
        "theta_arm [deg]",
        "theta_dot [deg/s]",
        "Vm [V]",
    ]
    assert draft.channels["states"]["position"]["unit"] == "deg"
    assert draft.channels["states"]["velocity"]["unit"] == "deg/s"
    assert draft.channels["commanded_effort"]["effort"]["unit"] == "V"


def control_desk(path: Path, signals: list[tuple[str, str, np.ndarray]]) -> Path:
    """As dSPACE ControlDesk exports a measurement: a struct called as the file is."""
    kind = [(part, object) for part in ("Name", "Unit", "Data")]
    made = [np.array([each], dtype=kind) for each in (("Time", "s", TIME[None]), *signals)]
    savemat(path, {path.stem: {"X": made[0], "Y": np.concatenate(made[1:])}})
    return path


def test_signals_of_control_desk_are_called_as_the_file_names_them(tmp_path: Path) -> None:
    """They were `run1.Y(1).Data`, and the draft was refused."""
    signals = [("theta", "rad", WAVE[None]), ("omega", "rad/s", 2.0 * TURNED[None]), ("k", "-", TIME[None])]
    logs = [control_desk(tmp_path / f"run{k}.mat", signals) for k in (1, 2)]
    draft = draft_any(logs, None, None)
    assert draft.sources["states"]["time"] == {"column": "Time [s]", "unit": "s"}
    assert set(draft.sources["states"]["columns"].values()) == {"theta [rad]", "omega [rad/s]"}
    assert [each["name"] for each in draft.recordings] == ["run1", "run2"]
    twice = control_desk(tmp_path / "run3.mat", [*signals, *signals])
    assert "run3.Y(1).Data" in read_table(twice, CsvOptions(), "log").columns


@pytest.mark.parametrize("names", [("theta_rod", "phi_whe"), ("theta_rod", "phi_wheel")])
def test_columns_with_letters_of_their_own_are_joints_of_one_kind(
    names: tuple[str, str], tmp_path: Path
) -> None:
    """Only the first was a position, and the other was left out."""
    columns = {"time": TIME, names[0]: 40.0 * WAVE, names[1]: 30.0 * TURNED}
    rates = {"theta_dot": 80.0 * TURNED, "phi_dot": -60.0 * WAVE}
    log = write(tmp_path / "a.csv", **columns, **rates, Vm=3.0 * TURNED, theta_ref=41.0 * WAVE)
    draft = draft_any([log], TWO, "w.urdf")
    if names[1] == "phi_whe":  # three letters may be another word's
        assert draft.joints == ["rod"]
        return
    told, states = draft.sources["states"]["columns"], draft.channels["states"]
    assert draft.joints == ["rod", "wheel"]
    assert [told[name] for name in states["position"]["formula"]] == list(names)
    assert [told[name] for name in states["velocity"]["formula"]] == list(rates)
    assert "theta_rod is rod, phi_wheel is wheel?" in questions_of(draft, "joints")
    assert "does a.csv: Vm drive rod, and nothing wheel" in questions_of(draft, "controller")
