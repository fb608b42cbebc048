"""Notes about recordings as the terminal shows them."""

from __future__ import annotations

from collections.abc import Sequence


def together(notes: Sequence[str]) -> list[str]:
    """Notes `NAME: text` that say the same of several recordings become one, `NAME, NAME: text`.

    Args:
        notes: in their order, which stays that of the first of each.
    """
    names: dict[str, list[str]] = {}
    for note in notes:
        name, separator, text = note.partition(": ")
        names.setdefault(text if separator else note, []).append(name if separator else "")
    return [
        f"{', '.join(dict.fromkeys(named))}: {text}" if named[0] else text for text, named in names.items()
    ]
