"""Mappings of every kind refuse a source, a file or a column that is not there, by its key path."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from samrl_core.common.errors import InputError
from samrl_ros.log_import.body_specs import BodyRecordingSpec
from samrl_ros.log_import.pose_specs import PoseRecordingSpec
from samrl_ros.log_import.reading_importer import ReadingRecordingSpec
from samrl_ros.log_import.specs import LoggedSpec, RecordingSpec

TRACK = {"position": ["x", "y", "z"], "quaternion": ["x", "y", "z", "w"]}
KINDS: dict[str, tuple[type[LoggedSpec], dict[str, Any]]] = {
    "channels.states": (
        RecordingSpec,
        {"joints": ["a"], "channels": {"states": {"position": "x"}}},
    ),
    "poses.camera_arm.flange": (
        PoseRecordingSpec,
        {"poses": {"target_in_camera": {"source": "log", **TRACK}, "camera_arm": {"flange": {**TRACK}}}},
    ),
    "bodies.track": (BodyRecordingSpec, {"bodies": {"track": {**TRACK}}}),
    "readings": (
        ReadingRecordingSpec,
        {"readings": {"quantity": "depth", "reading": "x", "reference": "y"}},
    ),
}


def content(reader: str) -> dict[str, Any]:
    """A mapping's entry of that kind, complete but for the reader's source."""
    columns = {name: name for name in "xyzw"}
    return copy.deepcopy({"name": "a", "sources": {"log": {"file": "a.csv", "columns": columns}}}) | (
        copy.deepcopy(KINDS[reader][1])
    )


def refusal(reader: str, entry: dict[str, Any]) -> str:
    with pytest.raises(InputError) as caught:
        KINDS[reader][0].read(entry, "mapping.yaml: recordings[0]")
    return str(caught.value).removeprefix("mapping.yaml: recordings[0].")


@pytest.mark.parametrize("reader", KINDS)
class TestEveryKind:
    def test_what_is_there_is_taken(self, reader: str) -> None:
        entry = content(reader)
        entry["files"], entry["parts"] = {"log": ["b.csv", "{name}.csv"]}, {"log": "samples"}
        entry["sources"]["log"]["columns"]["w"] = {"column": "w", "file": 1}
        spec = KINDS[reader][0].read(entry, "")
        assert spec.files_of("log") == ["b.csv", "a.csv"] and spec.part_of("log") == "samples"
        assert spec.source_of(spec.readers()[reader]) == "log"

    @pytest.mark.parametrize("key", ["files", "parts"])
    def test_an_unknown_source(self, reader: str, key: str) -> None:
        entry = {**content(reader), key: {"lgo": "b.csv"}}
        assert refusal(reader, entry) == f"{key}: no source ['lgo']; there are ['log']"

    def test_a_reader_of_no_source(self, reader: str) -> None:
        entry = content(reader)
        place = entry
        for step in reader.split("."):
            place = place[step]
        place["source"] = "lgo"
        assert refusal(reader, entry) == f"{reader}.source is 'lgo'; sources are ['log']"

    def test_two_sources_and_none_named(self, reader: str) -> None:
        entry = content(reader)
        entry["sources"]["second"] = copy.deepcopy(entry["sources"]["log"])
        assert refusal(reader, entry) == f"{reader}.source is None; sources are ['log', 'second']"

    def test_a_source_without_files(self, reader: str) -> None:
        entry = content(reader)
        del entry["sources"]["log"]["file"]
        assert refusal(reader, entry) == "sources.log.file is missing; name a path or a list of paths"

    def test_a_column_of_a_file_that_is_not_there(self, reader: str) -> None:
        entry = content(reader)
        entry["sources"]["log"]["columns"]["y"] = {"column": "y", "file": 1}
        text = "sources.log.columns.y.file is 1, the source has 1 files (from 0)"
        assert refusal(reader, entry) == text
