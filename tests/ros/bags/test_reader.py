"""Bags of other origin, cut bags, damaged bags, and what is no bag."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType, Writer

from samrl_core.common.errors import InputError
from samrl_ros.bags import scan
from samrl_ros.bags.reader import open_bag, require_topics
from samrl_ros.bags.schemas import schema_text

STRING = "std_msgs/msg/String"


def foreign(string_cdr, schema: bytes | None = None, encoding: str = "ros2msg", **options) -> bytes:
    """A file of another writer: 60 messages of two topics, log times out of order now and then."""
    stream = io.BytesIO()
    writer = Writer(stream, **options)
    writer.start(profile="ros2", library="elsewhere")
    text = schema_text(STRING).encode() if schema is None else schema
    schema_id = writer.register_schema(STRING, encoding, text)
    channels = [writer.register_channel(name, "cdr", schema_id) for name in ("/a", "/b")]
    for i in range(60):
        writer.add_message(channels[i % 2], 1000 + i - 5 * (i % 7 == 0), string_cdr(str(i)), i)
    writer.finish()
    return stream.getvalue()


VARIANTS = {
    "zstd": {"chunk_size": 300},
    "lz4": {"chunk_size": 300, "compression": CompressionType.LZ4},
    "none": {"chunk_size": 300, "compression": CompressionType.NONE, "enable_crcs": False},
    "one chunk": {},
    "unchunked": {"use_chunking": False},
    "no index": {"chunk_size": 300, "index_types": IndexType.NONE},
    "no statistics": {"chunk_size": 300, "use_statistics": False},
    "bare": {
        "chunk_size": 300,
        "index_types": IndexType.NONE,
        "use_statistics": False,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_summary_offsets": False,
    },
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_files_of_other_writers(tmp_path: Path, string_cdr, variant: str) -> None:
    file = tmp_path / "foreign.mcap"
    file.write_bytes(foreign(string_cdr, **VARIANTS[variant]))
    bag = open_bag(file)
    assert not bag.truncated and not bag.has_metadata
    assert [(t.name, t.type, t.count, t.qos, t.type_hash) for t in bag.topics] == [
        ("/a", STRING, 30, (), ""),
        ("/b", STRING, 30, (), ""),
    ]
    raw = list(bag.messages())
    assert [m.log_time_ns for m in raw] == sorted(m.log_time_ns for m in raw)
    assert sorted(int(m.data) for _, m in bag.decoded()) == list(range(60))
    assert {m.topic for m in bag.messages(["/b"])} == {"/b"}
    assert (bag.start_ns, bag.end_ns) == (raw[0].log_time_ns, raw[-1].log_time_ns)


@pytest.mark.parametrize("variant", VARIANTS)
def test_what_lies_near_some_times_is_read_without_the_rest(
    tmp_path: Path, string_cdr, variant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "x.mcap").write_bytes(foreign(string_cdr, **VARIANTS[variant]))
    bag, read = open_bag(tmp_path / "x.mcap"), []
    unread = scan.read_block
    monkeypatch.setattr(scan, "read_block", lambda *given: read.append(given[2]) or unread(*given))
    whole = list(bag.messages("/a"))
    blocks, wanted = len(read), {1004, 1052}
    read.clear()
    near = list(bag.messages("/a", near_ns=wanted))
    assert [m for m in near if m.log_time_ns in wanted] == [m for m in whole if m.log_time_ns in wanted] != []
    assert [m for m in whole if m in near] == near
    assert len(read) < blocks or blocks == 1
    assert list(bag.messages("/a", near_ns=())) == []


@pytest.mark.parametrize("variant", VARIANTS)
def test_any_cut_yields_a_prefix(tmp_path: Path, string_cdr, variant: str) -> None:
    data = foreign(string_cdr, **VARIANTS[variant])
    file = tmp_path / "cut.mcap"
    file.write_bytes(data)
    # In file order: the fixture's log times are not monotone, a prefix of the file is.
    whole = [int(m.publish_time_ns) for m in open_bag(file).messages()]
    rng = np.random.default_rng(7)
    kept = set()
    for cut in sorted(rng.integers(8, len(data), 120)):
        file.write_bytes(data[:cut])
        bag = open_bag(file)
        found = sorted(m.publish_time_ns for m in bag.messages())
        assert bag.truncated and bag.damage
        assert found == sorted(whole)[: len(found)]
        assert bag.message_count == len(found) == sum(t.count for t in bag.topics)
        if found:
            assert bag.end_ns == max(m.log_time_ns for m in bag.messages())
        kept.add(len(found))
    assert max(kept) == 60 or variant == "one chunk"


def test_a_folder_of_bags_names_them(small_bag) -> None:
    folder = small_bag()
    with pytest.raises(InputError, match=f"no .mcap file; inside it are .*{folder.name}.*: name one"):
        open_bag(folder.parent)


@pytest.mark.parametrize("compression", ["zstd", "none"])
def test_any_cut_of_our_own_bag(small_bag, compression: str) -> None:
    folder = small_bag(compression=compression)
    whole = list(open_bag(folder).messages())
    (folder / "metadata.yaml").unlink()
    file = folder / "small_0.mcap"
    data = file.read_bytes()
    rng = np.random.default_rng(8)
    for cut in rng.integers(8, len(data), 120):
        file.write_bytes(data[:cut])
        bag = open_bag(folder)
        found = list(bag.messages())
        assert bag.truncated
        assert found == whole[: len(found)]
        assert bag.custom_data in ({}, {"task": "peg_insertion"})


def test_flipped_bytes_are_refused_or_reported_never_a_crash(small_bag) -> None:
    folder = small_bag()
    whole = {m.data for m in open_bag(folder).messages()}
    file = folder / "small_0.mcap"
    data = file.read_bytes()
    rng = np.random.default_rng(9)
    refused = 0
    for position in rng.integers(0, len(data), 60):
        changed = bytearray(data)
        changed[position] ^= int(rng.integers(1, 256))
        file.write_bytes(changed)
        try:
            # Chunks carry checksums, so no message that is read may differ from the recorded ones.
            assert {m.data for m in open_bag(folder).messages()} <= whole
            assert {m.data for m in open_bag(folder, verify=True).messages()} <= whole
        except InputError:
            refused += 1
    assert refused > 0


def test_damage_in_the_middle_of_a_whole_file(small_bag) -> None:
    folder = small_bag(compression="none")
    file = folder / "small_0.mcap"
    data = bytearray(file.read_bytes())
    at = data.index(b"phase 100")
    data[at] ^= 0xFF
    file.write_bytes(data)
    with pytest.raises(InputError, match="samrl bag repair"):
        list(open_bag(folder).messages())
    checked = open_bag(folder, verify=True)
    assert checked.truncated and 50 < checked.message_count < 100
    assert checked.lost_bytes > 0


def test_zero_filled_tail_is_a_cut(small_bag) -> None:
    folder = small_bag(close=False)
    file = folder / "small_0.mcap"
    whole = open_bag(folder).message_count
    file.write_bytes(file.read_bytes() + bytes(4096))
    bag = open_bag(folder)
    assert bag.truncated and bag.message_count == whole == 200


def test_no_bag_at_all(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing of that name"):
        open_bag(tmp_path / "nothing")
    with pytest.raises(InputError, match=r"holds no \.mcap file"):
        open_bag(tmp_path)
    empty = tmp_path / "empty.mcap"
    empty.write_bytes(b"")
    with pytest.raises(InputError, match="is empty"):
        open_bag(empty)
    text = tmp_path / "text.mcap"
    text.write_bytes(b"hello, I am a text")
    with pytest.raises(InputError, match="no MCAP file"):
        open_bag(text)
    (tmp_path / "sql").mkdir()
    (tmp_path / "sql" / "old.db3").write_bytes(b"SQLite format 3")
    with pytest.raises(InputError, match="ros2 bag convert"):
        open_bag(tmp_path / "sql")


def test_broken_or_foreign_metadata(small_bag) -> None:
    folder = small_bag()
    file = folder / "metadata.yaml"
    good = file.read_text()
    for bad in ("{", "just text", "a: 1", "\x00"):
        file.write_text(bad)
        with pytest.raises(InputError, match="samrl bag repair"):
            open_bag(folder)
    assert open_bag(folder, ignore_metadata=True).message_count == 200
    file.write_text(good.replace("storage_identifier: mcap", "storage_identifier: sqlite3"))
    with pytest.raises(InputError, match="sqlite3"):
        open_bag(folder)
    file.write_text(good.replace("compression_mode: ''", "compression_mode: file"))
    with pytest.raises(InputError, match="compression"):
        open_bag(folder)
    file.write_text(good.replace("small_0.mcap", "other_0.mcap"))
    with pytest.raises(InputError, match="lacks other_0"):
        open_bag(folder)


def test_missing_topics_are_listed(small_bag) -> None:
    bag = open_bag(small_bag())
    assert require_topics(bag, ["/cell/phase"]) == ("/cell/phase",)
    with pytest.raises(InputError, match=r"lacks /x, /y; topics present: /cell/phase, /cell/tool_arm"):
        require_topics(bag, ["/x", "/cell/phase", "/y"])
    with pytest.raises(InputError, match="/nope"):
        bag.topic("/nope")
    assert list(bag.messages(["/nope"])) == []


@pytest.mark.parametrize(
    ("schema", "encoding"),
    [
        (b"this is ][ no definition", "ros2msg"),
        (b"pkg/Missing nested\n", "ros2msg"),
        (b"std_msgs/String data\n", "ros2msg"),
        (b"wstring data\n", "ros2msg"),
        (b"\xff\xfe", "ros2msg"),
        (b"", "ros2idl"),
    ],
)
def test_broken_schema_names_its_topic(tmp_path: Path, string_cdr, schema: bytes, encoding: str) -> None:
    file = tmp_path / "broken.mcap"
    file.write_bytes(foreign(string_cdr, schema=schema, encoding=encoding))
    bag = open_bag(file)
    assert len(list(bag.messages())) == 60  # raw reading needs no schema
    with pytest.raises(InputError, match="/a"):
        list(bag.decoded(["/a"]))


def test_message_that_does_not_fit_its_schema(tmp_path: Path) -> None:
    file = tmp_path / "short.mcap"
    file.write_bytes(foreign(lambda _: b"\0\1\0\0\xff\0\0\0a"))
    with pytest.raises(InputError, match=r"/a, log time \d+ ns"):
        list(open_bag(file).decoded())


def test_two_types_on_one_topic_are_refused(tmp_path: Path) -> None:
    stream = io.BytesIO()
    writer = Writer(stream)
    writer.start(profile="ros2")
    for name in (STRING, "std_msgs/msg/Bool"):
        schema = writer.register_schema(name, "ros2msg", schema_text(name).encode())
        writer.add_message(writer.register_channel("/a", "cdr", schema), 0, b"\0\1\0\0\0", 0)
    writer.finish()
    file = tmp_path / "two.mcap"
    file.write_bytes(stream.getvalue())
    with pytest.raises(InputError, match="recorded as"):
        open_bag(file)
