"""Several bags of one machine in a folder, with its model beside them: one draft, one diagnosis."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.nominal_model.read_model import read_model
from samrl_ros.cli.diagnosis.load import load
from samrl_ros.cli.diagnosis.options import DiagnoseOptions
from samrl_ros.log_import.any_importer import import_logs_by
from samrl_ros.log_import.devices import data_folder
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.bag_set import bags_in, bags_of
from samrl_ros.log_import.draft.guess import Effort
from samrl_ros.log_import.draft.writing import as_yaml
from tests.recordings.logs.made_logs import JOINTS, ros1_bag, ros2_bag, urdf_of

NAMES = ["friday", "monday", "tuesday"]


def folders(place: Path) -> Path:
    """A rosbag2 folder for each day."""
    place.mkdir(exist_ok=True)
    for k, name in enumerate(NAMES):
        ros2_bag(place, late=70 * k).rename(place / name)
        (place / name / "bag.mcap").rename(place / name / f"{name}.mcap")
        text = (place / name / "metadata.yaml").read_text()
        (place / name / "metadata.yaml").write_text(text.replace("bag.mcap", f"{name}.mcap"))
    return place


def files(place: Path) -> Path:
    """The .mcap files alone, as people copy them."""
    folders(place)
    for name in NAMES:
        (place / name / f"{name}.mcap").rename(place / f"{name}.mcap")
        shutil.rmtree(place / name)
    return place


def of_ros1(place: Path) -> Path:
    place.mkdir(exist_ok=True)
    for k, name in enumerate(NAMES):
        ros1_bag(place, late=70 * k).rename(place / f"{name}.bag")
    return place


@pytest.mark.parametrize("make", [folders, files, of_ros1])
def test_the_first_bag_is_drafted_for_all(make: Callable[[Path], Path], tmp_path: Path) -> None:
    place = make(tmp_path / "cell")
    (place / "arm.urdf").write_text(urdf_of(JOINTS))
    draft = draft_any([place], urdf_of(JOINTS), "arm.urdf", Effort.drive)
    assert not draft.questions
    roles = [(each["name"], each["role"]) for each in draft.recordings]
    assert roles == [("friday", "fit"), ("monday", "fit"), ("tuesday", "held_out")]
    assert any("monday" in guess.reason and guess.key == "recordings" for guess in draft.guesses)
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text(as_yaml(draft))
    made = import_logs_by(mapping, data_folder(draft, place), (), ()).made
    assert [(each.recording.name, each.role) for each in made] == roles
    assert all(len(each.recording.states.time) == 600 for each in made)


@pytest.mark.parametrize("make", [folders, of_ros1])
def test_one_step_takes_the_folder(make: Callable[[Path], Path], tmp_path: Path) -> None:
    place = make(tmp_path / "cell")
    (place / "arm.urdf").write_text(urdf_of(JOINTS))
    options = DiagnoseOptions((place,), urdf=place / "arm.urdf", effort=Effort.drive)
    fit, held_out, _ = load(options, read_model(place / "arm.urdf"))
    assert [each.name for each in fit] == NAMES[:2]
    assert [each.name for each in held_out] == NAMES[2:]


def test_a_refusal_names_the_folder_and_its_questions_once(tmp_path: Path) -> None:
    """The command that follows drafts all bags, not the one at which the diagnosis stopped."""
    place = folders(tmp_path / "cell")
    (tmp_path / "arm.urdf").write_text(urdf_of(JOINTS))
    options = DiagnoseOptions((place,), urdf=tmp_path / "arm.urdf")
    with pytest.raises(InputError, match=rf"`samrl bag draft {place} --urdf .*--data {place}`"):
        load(options, read_model(tmp_path / "arm.urdf"))


def test_bags_that_are_named_are_a_set_too(tmp_path: Path) -> None:
    place = folders(tmp_path / "cell")
    draft = draft_any([place / "monday", place / "friday"], None, None, Effort.drive)
    assert [(each["name"], each["role"]) for each in draft.recordings] == [
        ("monday", "fit"),
        ("friday", "held_out"),
    ]
    ros1_bag(place).rename(place / "zero.bag")  # of other topics: it may be of the same recording
    assert not bags_of([place / "monday", place / "zero.bag"])


def test_a_bag_without_the_topics_is_left_out_and_named(tmp_path: Path) -> None:
    place = folders(tmp_path / "cell")
    ros1_bag(place).rename(place / "zero.bag")  # no controller's state in it
    draft = draft_any([place], None, None, Effort.drive)
    assert [each["name"] for each in draft.recordings] == NAMES
    assert any(line.startswith("zero.bag: has no /arm_controller/controller_state") for line in draft.unused)


def test_notes_beside_bags_are_no_logs(tmp_path: Path) -> None:
    place = tmp_path / "cell"
    for name in NAMES:
        (place / name).mkdir(parents=True)
        (place / name / "metadata.yaml").touch()
    for note in ("README.txt", "settings.json", "arm.urdf", "tolerances.yaml"):
        (place / note).touch()
    assert [bag.name for bag in bags_in(place)] == NAMES
    (place / "recordings.json").touch()  # an import's: it names the bags and their roles
    assert not bags_in(place)


def test_one_bag_alone_is_no_set(tmp_path: Path) -> None:
    bag = ros2_bag(tmp_path)
    assert not bags_in(bag)
    (bag / "metadata.yaml").unlink()
    assert not bags_in(bag)
    assert bags_in(tmp_path) == [bag]
    draft = draft_any([tmp_path], urdf_of(JOINTS), "arm.urdf", Effort.drive)
    assert [each["role"] for each in draft.recordings] == ["fit"]
    assert draft.sources["states"]["file"] == "bag" and data_folder(draft, tmp_path) == tmp_path


def test_a_mapping_of_two_topics_reads_another_bag(tmp_path: Path) -> None:
    """Joint states and a controller's state are two sources of one file."""
    place = folders(tmp_path / "cell")
    draft = draft_any([place / "friday"], urdf_of(JOINTS), str(tmp_path / "arm.urdf"), Effort.drive)
    assert set(draft.sources) == {"states", "command"}
    (tmp_path / "arm.urdf").write_text(urdf_of(JOINTS))
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text(as_yaml(draft))
    made = import_logs_by(mapping, tmp_path, [place / "monday"], [place / "tuesday"]).made
    assert [(each.recording.name, each.role) for each in made] == [("monday", "fit"), ("tuesday", "held_out")]
    command = made[0].recording.command
    assert command is not None
    np.testing.assert_allclose(np.ptp(command.position, axis=0), [1.8, 1.2, 1.0], atol=0.01)
