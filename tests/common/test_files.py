"""Files and their names: what the system answers is said once, and odd names do not stop a report."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from samrl_core.common.errors import InputError
from samrl_core.common.files import append_line, check_folder, read_whole, write_whole

LATIN_1 = os.fsdecode(b"M\xfcnchen.csv")  # as an archive of Windows leaves it here


def test_a_name_that_is_no_utf_8_can_be_written_of(tmp_path: Path) -> None:
    """A report of such a recording ended in a UnicodeEncodeError, with half of its files written."""
    page, log = tmp_path / "page.html", tmp_path / "log.jsonl"
    write_whole(page, f"<p>{LATIN_1} und Köln</p>")
    append_line(log, json.dumps({"file": LATIN_1}, ensure_ascii=False))
    assert page.read_text(encoding="utf-8") == "<p>M\\udcfcnchen.csv und Köln</p>"
    assert json.loads(log.read_text(encoding="utf-8")) == {"file": LATIN_1}  # and a program finds the file


def test_what_cannot_be_read_is_named_once(tmp_path: Path) -> None:
    path = tmp_path / "none.yaml"
    with pytest.raises(InputError) as refused:
        read_whole(path, 100)
    assert str(refused.value) == f"cannot read {path}: No such file or directory; check the path"


def test_a_folder_that_may_not_be_written_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check_folder(tmp_path / "not" / "there")
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # root may write anywhere
    with pytest.raises(InputError, match="may not be written; give another --out"):
        check_folder(tmp_path / "not" / "there")
