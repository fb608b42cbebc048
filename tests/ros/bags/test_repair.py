"""Repair, info and their commands."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from mcap.writer import Writer
from rosbags.rosbag2 import Reader

from samrl_core.common.errors import InputError
from samrl_ros.bags.info import describe
from samrl_ros.bags.reader import open_bag
from samrl_ros.bags.repair import repair
from samrl_ros.bags.writer import BagWriter
from samrl_ros.cli.main import run


def fingerprint(folder: Path) -> dict[str, str]:
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.iterdir()}


@pytest.mark.parametrize("cut", [0.5, 0.9, 1.0])
def test_repair_makes_a_complete_bag_and_leaves_the_source(small_bag, tmp_path: Path, cut: float) -> None:
    folder = small_bag(close=False)
    file = folder / "small_0.mcap"
    file.write_bytes(file.read_bytes()[: int(cut * file.stat().st_size)])
    before, source = fingerprint(folder), open_bag(folder)
    report = repair(folder, tmp_path / "new" / "whole")
    assert fingerprint(folder) == before
    whole = open_bag(tmp_path / "new" / "whole", verify=True)
    assert list(whole.messages()) == list(source.messages())
    assert report.messages == whole.message_count == source.message_count > 0
    assert not whole.truncated and whole.has_metadata
    assert report.damage and report.end_ns == source.end_ns
    assert whole.custom_data == {"task": "peg_insertion"}
    for name in ("/cell/tool_arm/joint_states", "/cell/tool_arm/tool"):
        assert whole.topic(name).qos == source.topic(name).qos
        assert whole.topic(name).type_hash == source.topic(name).type_hash
    with Reader(tmp_path / "new" / "whole") as reader:
        assert len(list(reader.messages())) == report.messages


def test_sound_bag_without_metadata_is_copied(small_bag, tmp_path: Path) -> None:
    folder = small_bag()
    (folder / "metadata.yaml").unlink()
    report = repair(folder, tmp_path / "whole")
    assert report.messages == 200 and report.damage == () and report.lost_bytes == 0
    assert open_bag(tmp_path / "whole").has_metadata


def test_repair_refuses(small_bag, tmp_path: Path) -> None:
    folder = small_bag()
    (tmp_path / "there").mkdir()
    with pytest.raises(InputError, match="exists already"):
        repair(folder, tmp_path / "there")
    with pytest.raises(InputError, match="inside the source"):
        repair(folder, folder / "whole")
    head = tmp_path / "head.mcap"
    head.write_bytes((folder / "small_0.mcap").read_bytes()[:40])
    with pytest.raises(InputError, match="nothing can be kept"):
        repair(head, tmp_path / "whole")
    assert not (tmp_path / "whole").exists()


def test_an_interrupted_repair_leaves_no_half_bag(small_bag, tmp_path: Path) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    folder = small_bag()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(BagWriter, "write", interrupt)
        with pytest.raises(KeyboardInterrupt):
            repair(folder, tmp_path / "whole")
    assert not (tmp_path / "whole").exists()
    assert repair(folder, tmp_path / "whole").messages == 200


def test_oddities_of_other_writers_are_copied(tmp_path: Path) -> None:
    source = tmp_path / "odd.mcap"
    with source.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_metadata("samrl", {"seed": "4", "task": "t"})
        schema = writer.register_schema("my.Thing", "jsonschema", b"{}")
        writer.add_message(writer.register_channel("thing", "json", schema), 5, b"{}", 4)
        writer.finish()
    assert repair(source, tmp_path / "whole").messages == 1
    bag = open_bag(tmp_path / "whole")
    assert bag.custom_data == {"task": "t"}
    assert [(m.topic, m.type, m.data) for m in bag.messages()] == [("thing", "my.Thing", b"{}")]
    assert bag.topics[0].serialization == "json" and bag.topics[0].definition.encoding == "jsonschema"


def test_describe(small_bag) -> None:
    described = describe(open_bag(small_bag()))
    assert described["messages"] == 200
    assert described["duration_s"] == pytest.approx(0.199)
    joints = next(t for t in described["topics"] if t["type"] == "sensor_msgs/msg/JointState")
    assert joints["rate_hz"] == pytest.approx(180 / 0.199)
    assert joints["reliability"] == "reliable" and joints["type_hash"].startswith("RIHS01_")
    assert described["truncated"] is False and described["metadata"] is True


def test_commands_and_their_exit_codes(
    small_bag, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def told(code: int, *arguments: str) -> str:
        assert run(["bag", *arguments]) == code
        heard = capfd.readouterr()
        return heard.err if code == 3 else heard.out

    monkeypatch.setenv("COLUMNS", "250")
    folder = small_bag()
    assert json.loads(told(0, "info", str(folder), "--json"))["messages"] == 200
    shown = told(0, "info", str(folder))
    assert "/cell/phase" in shown and "200 messages" in shown
    assert "nothing of that name" in told(3, "info", str(tmp_path / "nothing"))
    told(2, "info")
    told(2, "info", str(folder), "--no-such-option")
    (folder / "metadata.yaml").unlink()
    assert "200 messages" in told(0, "repair", str(folder))
    assert open_bag(tmp_path / "small_repaired").has_metadata
    assert "refused" in told(3, "repair", str(folder))  # the destination exists now
    told(0, "repair", str(folder), "--out", str(tmp_path / "other"))
