"""What is written, read back by other readers; and what is refused."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader

from samrl_core.common.errors import InputError
from samrl_ros.bags.qos_metadata import QoS, load_profiles
from samrl_ros.bags.reader import open_bag
from samrl_ros.bags.schemas import schema_text
from samrl_ros.bags.writer import BagWriter

STRING = "std_msgs/msg/String"
JOINTS = "sensor_msgs/msg/JointState"


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_read_back_by_mcap_ros2_support(small_bag, compression: str) -> None:
    folder = small_bag(compression=compression)
    with (folder / "small_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        found = list(reader.iter_decoded_messages())
    assert len(found) == 200
    joints = [m for m in found if m.channel.topic == "/cell/tool_arm/joint_states"]
    assert joints[0].decoded_message.position[0] == pytest.approx(0.01)
    assert joints[0].message.log_time == 2_000_000
    assert joints[0].message.publish_time == 2_000_000 - 500
    assert joints[0].channel.metadata["topic_type_hash"].startswith("RIHS01_a13ee3a330e346c9d87b5aa18d24e11")
    assert joints[0].schema is not None and joints[0].schema.data.decode() == schema_text(JOINTS)


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_read_back_by_rosbags(small_bag, typestore, compression: str) -> None:
    with Reader(small_bag(compression=compression)) as reader:
        assert reader.message_count == 200
        texts = [
            typestore.deserialize_cdr(data, connection.msgtype).data
            for connection, _, data in reader.messages()
            if connection.msgtype == STRING
        ]
        latched = next(c for c in reader.connections if c.topic == "/cell/tool_arm/tool")
        assert reader.ros_distro == "jazzy"
    assert texts[:2] == ["{}", "phase 10"]
    qos = latched.ext.offered_qos_profiles[0]
    assert qos.durability.name.lower() == "transient_local"


def test_metadata_version_9(small_bag) -> None:
    folder = small_bag()
    about = yaml.safe_load((folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert about["version"] == 9
    assert about["storage_identifier"] == "mcap"
    assert about["message_count"] == 200
    assert about["starting_time"] == {"nanoseconds_since_epoch": 1_000_000}
    assert about["duration"] == {"nanoseconds": 199_000_000}
    assert about["relative_file_paths"] == ["small_0.mcap"]
    assert about["files"][0]["message_count"] == 200
    assert about["compression_format"] == about["compression_mode"] == ""
    assert about["custom_data"] == {"task": "peg_insertion"}
    assert about["ros_distro"] == "jazzy"
    topics = {t["topic_metadata"]["name"]: t for t in about["topics_with_message_count"]}
    joints = topics["/cell/tool_arm/joint_states"]
    assert joints["message_count"] == 180
    assert joints["topic_metadata"]["serialization_format"] == "cdr"
    assert joints["topic_metadata"]["type_description_hash"].startswith("RIHS01_")
    profile = joints["topic_metadata"]["offered_qos_profiles"][0]
    assert profile["history"] == "keep_last" and profile["depth"] == 10
    assert profile["deadline"] == {"sec": 9223372036, "nsec": 854775807}
    with (folder / "small_0.mcap").open("rb") as stream:
        records = {m.name: m.metadata for m in make_reader(stream).iter_metadata()}
    inner = yaml.safe_load(records["rosbag2"]["serialized_metadata"])
    assert inner == about


def test_split_files_are_one_bag(tmp_path: Path, string_cdr) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/a", STRING)
        for part in range(12):
            writer.write("/a", part, string_cdr(str(part)))
            if part < 11:
                assert writer.split().name == f"bag_{part + 1}.mcap"
    bag = open_bag(tmp_path / "bag")
    assert len(bag.files) == 12
    assert [m.data for _, m in bag.decoded()] == [str(i) for i in range(12)]
    assert bag.topic("/a").count == 12
    with Reader(tmp_path / "bag") as reader:
        assert len(list(reader.messages())) == 12
    (tmp_path / "bag" / "metadata.yaml").unlink()
    assert [m.data for _, m in open_bag(tmp_path / "bag").decoded()] == [str(i) for i in range(12)]


def test_silent_topic_is_listed(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/a", STRING, QoS(depth=3))
    bag = open_bag(tmp_path / "bag")
    assert [(t.name, t.type, t.count, t.qos[0].depth) for t in bag.topics] == [("/a", STRING, 0, 3)]
    assert (bag.message_count, bag.start_ns, bag.end_ns, bag.truncated) == (0, 0, 0, False)


def test_close_twice_then_write_is_refused(tmp_path: Path, string_cdr) -> None:
    writer = BagWriter(tmp_path / "bag")
    writer.add_topic("/a", STRING)
    writer.close()
    before = (tmp_path / "bag" / "metadata.yaml").stat().st_mtime_ns
    writer.close()
    assert (tmp_path / "bag" / "metadata.yaml").stat().st_mtime_ns == before
    with pytest.raises(InputError, match="closed"):
        writer.write("/a", 1, string_cdr("x"))


def test_bad_input_is_refused(tmp_path: Path, string_cdr) -> None:
    with pytest.raises(InputError, match="zstd, lz4, none"):
        BagWriter(tmp_path / "x", compression="gzip")
    with pytest.raises(InputError, match="only evaluation"):
        BagWriter(tmp_path / "x", custom_data={"seed": "3"})
    with pytest.raises(InputError, match="must be text"):
        BagWriter(tmp_path / "x", custom_data={"schema": 1})
    assert not (tmp_path / "x").exists()
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/a", STRING)
        writer.add_topic("/a", STRING)
        with pytest.raises(InputError, match="one type"):
            writer.add_topic("/a", JOINTS)
        with pytest.raises(InputError, match="absolute"):
            writer.add_topic("a", STRING)
        with pytest.raises(InputError, match="present: /a"):
            writer.write("/b", 1, string_cdr("x"))
        with pytest.raises(InputError, match="log time"):
            writer.write("/a", -1, string_cdr("x"))
        with pytest.raises(InputError, match="CDR"):
            writer.write("/a", 1, b"\0\1")


def test_existing_folder_is_refused_untouched(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        BagWriter(folder)
    assert [p.name for p in folder.iterdir()] == ["notes.txt"]


def test_impossible_places_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    for folder in (file / "bag", Path("/proc/samrl/bag")):
        with pytest.raises(InputError, match="writable place"):
            BagWriter(folder)


def test_qos_of_older_bags_in_numbers() -> None:
    text = "- history: 1\n  depth: 5\n  reliability: 2\n  durability: 1\n"
    assert load_profiles(text) == (QoS("best_effort", "transient_local", "keep_last", 5),)
    assert load_profiles("nonsense: [") == load_profiles(None) == load_profiles("- {history: 99}") == ()
    with pytest.raises(InputError, match="reliability"):
        QoS(reliability="perhaps")


def test_a_long_recording_takes_no_more_memory(tmp_path: Path, string_cdr) -> None:
    """What mcap's writer would keep of every chunk until the end, 1.4 kB, is on disk."""
    chunks = 2000
    with BagWriter(tmp_path / "long", chunk_bytes=1) as writer:
        for number in range(12):
            writer.add_topic(f"/{number}", STRING)
        data = string_cdr("x")
        writer.write("/0", 0, data)
        tracemalloc.start()
        for k in range(chunks):
            writer.write(f"/{k % 12}", k, data)
        grown, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert grown < 100_000  # [bytes]; 1,500,000 in memory
    with (tmp_path / "long" / "long_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None and len(summary.chunk_indexes) == chunks + 1
        found = sum(1 for _ in reader.iter_messages(topics=["/7"]))
        assert found == sum(k % 12 == 7 for k in range(chunks))
    assert sorted(p.name for p in (tmp_path / "long").iterdir()) == ["long_0.mcap", "metadata.yaml"]
