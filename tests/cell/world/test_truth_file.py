"""The file of ground truth that evaluation reads, also when it is damaged."""

from __future__ import annotations

from pathlib import Path

import pytest

from samrl_core.cell.instance.cell_instance import read_instance_file
from samrl_core.cell.world.evaluation import read_truth
from samrl_core.common.errors import InputError

LINE = '{"episode": 0, "event": "start"}\n'


def test_events_are_read_by_episode(tmp_path: Path) -> None:
    (tmp_path / "truth.jsonl").write_text(LINE + "\n" + LINE.replace("start", "end"))
    assert list(read_truth(tmp_path / "truth.jsonl")[0]) == ["start", "end"]


@pytest.mark.parametrize(
    "second", [LINE[:-9], "3", "[]", '{"episode": 1}', '{"episode": [], "event": "end"}']
)
def test_a_damaged_line_is_named(second: str, tmp_path: Path) -> None:
    """A bridge that was killed may leave half a line."""
    (tmp_path / "truth.jsonl").write_text(LINE + second)
    with pytest.raises(InputError, match=r"truth\.jsonl, line 2"):
        read_truth(tmp_path / "truth.jsonl")


@pytest.mark.parametrize("content", ["", "[]", '{"name": "typical:0"}'])
def test_a_damaged_cell_instance_is_refused(content: str, tmp_path: Path) -> None:
    (tmp_path / "instance.json").write_text(content)
    with pytest.raises(InputError, match=r"instance\.json"):
        read_instance_file(tmp_path / "instance.json")
