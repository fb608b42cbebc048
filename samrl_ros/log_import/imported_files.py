"""What importers of every kind share: entries of a mapping, and files by role that are never replaced."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_there, write_whole
from samrl_core.common.text_files import parse_yaml

INDEX = "recordings.json"


def entries_of(text: str, path: Path) -> tuple[dict[str, Any], list[Any]]:
    """What holds for all recordings of a mapping's text, and its list of them; `path` is for messages.

    Raises:
        InputError: it is no YAML, has no list `recordings`, or a draft's questions are still open in it.
    """
    content = parse_yaml(text, str(path))
    if not isinstance(content, dict) or not isinstance(content.get("recordings"), list):
        raise InputError(f"{path.name}: must be a mapping of keys to values with a list `recordings`")
    if asked := content.get("questions"):
        listed = "".join(f"\n  {each}" for each in asked) if isinstance(asked, list) else f" {asked}"
        raise InputError(
            f"{path.name}: questions of its draft are open; answer them in the file, then delete `questions`:"
            f"{listed}"
        )
    general = {str(k): v for k, v in content.items() if k not in ("recordings", "about", "questions")}
    return general, content["recordings"]


def check_names(made: Sequence[Any], path: Path) -> None:
    """Refuse no recording at all, and names that are not of one alone. Raises `InputError`."""
    names = [each.recording.name for each in made]
    if not names:
        raise InputError(f"{path.name}: recordings is empty; name at least one")
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(f"{path.name}: recordings {twice[:5]} are named more than once")


def write_imported(made: Sequence[Any], out: Path, suffix: str, write: Callable[[Any, Path], object]) -> None:
    """Each recording as `out/<name><suffix>`, and their roles in `recordings.json`.

    Args:
        made: imported recordings with `recording.name` and `role`.
        out: folder.
        suffix: of the files.
        write: writes one imported recording to a path.

    Raises:
        InputError: one of the files exists already, or the disk has no room; nothing is left then.
    """
    files = [out / f"{each.recording.name}{suffix}" for each in made]
    if existing := [p for p in (*files, out / INDEX) if is_there(p)]:
        raise InputError(f"{existing[0]} exists already; choose another --out or move it away")
    roles = {
        role: [f.name for e, f in zip(made, files, strict=True) if e.role == role]
        for role in ("fit", "held_out")
    }
    is_new = not is_there(out)
    out.mkdir(parents=True, exist_ok=True)
    try:
        for each, file in zip(made, files, strict=True):
            write(each, file)
        write_whole(out / INDEX, json.dumps(roles, indent=2) + "\n")
    except BaseException:
        for file in files:  # none was there before; without its index none has a role
            file.unlink(missing_ok=True)
        if is_new:
            with suppress(OSError):
                out.rmdir()
        raise
