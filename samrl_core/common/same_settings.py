"""What the work in a folder is done with: written down when it begins, and the same when it goes on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from samrl_core.common.atomic_file import write_whole
from samrl_core.common.errors import InputError


def keep_to(path: Path, wanted: dict[str, Any], what: str, note: dict[str, str]) -> dict[str, str]:
    """Write settings into a folder that has none, or hold them against those that are there.

    Args:
        path: of the file.
        wanted: settings; nested ones are named with dots, so that a refusal can name the one that differs.
        what: is in the folder, e.g. "training".
        note: written beside them, and not compared.

    Returns:
        The note that is in the file, with empty texts for what is missing.

    Raises:
        InputError: the file cannot be read, or holds other settings.
    """
    wanted = json.loads(json.dumps(_flat(wanted), default=str))
    if not path.exists():
        write_whole(path, json.dumps({**note, **wanted}, indent=1) + "\n")
        return note
    try:
        found = dict(json.loads(path.read_text()))
    except (ValueError, TypeError) as error:
        raise InputError(f"{path} cannot be read ({error}); take another folder") from error
    noted = {name: str(found.pop(name, "")) for name in note}
    different = [k for k in {**wanted, **found} if wanted.get(k) != found.get(k)]
    if different:
        listed = ", ".join(f"{k} {found.get(k)!r} (asked for: {wanted.get(k)!r})" for k in different)
        raise InputError(
            f"{path.parent} holds another {what}: {listed}; take another folder, or ask for the same to go on"
        )
    return noted


def _flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= _flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {f"{prefix}{name}": value}
    return flat
