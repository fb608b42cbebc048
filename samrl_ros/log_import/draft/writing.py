"""A draft as a commented YAML file."""

from __future__ import annotations

import json
import textwrap
from typing import Any

import yaml

from samrl_ros.log_import.draft.guess import Draft

_WIDTH = 110


def as_yaml(draft: Draft) -> str:
    """The mapping, reasons as comments above what they explain, and what was left out at the end."""
    content = draft.as_mapping()
    lines: list[str] = []
    for key, value in content.items():
        if key == "questions":
            lines += [
                "# Answer these where they point, then delete this list: it keeps the mapping from use."
            ]
            lines += ["questions:", *(f"  - {json.dumps(each, ensure_ascii=False)}" for each in value)]
            continue
        if key == "urdf" and isinstance(value, str) and value.lstrip().startswith("<"):
            lines += [*_reasons(draft, "urdf"), "urdf: |", *(f"  {line}" for line in value.splitlines())]
        elif isinstance(value, dict):  # sources, channels, poses
            lines += [*_reasons(draft, key), f"{key}:"]
            for absent in dict.fromkeys(_absent(draft, key, value)):
                lines += [f"  {line}" for line in _reasons(draft, absent)]
            for name, entry in value.items():
                if not isinstance(entry, dict):
                    lines += [f"  {line}" for line in _reasons(draft, f"{key}.{name}")]
                    lines += _dumped({name: entry}, 2)
                    continue
                lines.append(f"  {name}:")
                lines += _entry(draft, f"{key}.{name}", entry)
        else:
            lines += [*_reasons(draft, key), *_dumped({key: value}, 0)]
    if draft.unused:
        lines.append("# Not used:")
        lines += [f"#   {each}" for each in draft.unused]
    return "\n".join(lines) + "\n"


def _absent(draft: Draft, key: str, value: dict[str, Any]) -> list[str]:
    """Keys below one that have a reason but no entry, such as a support that nothing touches."""
    below = [guess.key for guess in draft.guesses if guess.key.startswith(f"{key}.")]
    return [path for path in below if path.split(".")[1] not in value]


def _entry(draft: Draft, path: str, entry: dict[str, Any]) -> list[str]:
    lines = [f"    {line}" for line in _reasons(draft, path)]
    shown = {guess.key for guess in draft.guesses if guess.key == path}
    for key, value in entry.items():
        lines += [f"    {line}" for line in _reasons(draft, f"{path}.{key}")]
        shown.add(f"{path}.{key}")
        lines += _dumped({key: value}, 4)
    # Reasons of entries that the draft leaves to their defaults, such as a bag's own time.
    rest = [
        guess.key for guess in draft.guesses if guess.key.startswith(f"{path}.") and guess.key not in shown
    ]
    return [*(f"    {line}" for key in dict.fromkeys(rest) for line in _reasons(draft, key)), *lines]


def _reasons(draft: Draft, key: str) -> list[str]:
    lines = []
    for guess in draft.of(key):
        open_head = f"ASKED with {guess.asked_with}" if guess.asked_with else "sure"
        text = f"{'QUESTION' if guess.question else open_head}: {guess.reason}"
        if guess.question:
            text += f". {guess.question[0].upper()}{guess.question[1:]}"
        lines += textwrap.wrap(text, _WIDTH, initial_indent="# ", subsequent_indent="#   ")
    return lines


def _dumped(value: dict[str, Any], indent: int) -> list[str]:
    plain = not any(isinstance(each, dict | list) for each in value.values())
    how = False if plain else None  # a mapping of numbers and texts in one line, but not the outermost
    text = yaml.safe_dump(value, sort_keys=False, default_flow_style=how, width=_WIDTH, allow_unicode=True)
    return [f"{' ' * indent}{line}" for line in text.rstrip().splitlines()]
