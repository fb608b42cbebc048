"""Help of every option reads as written: the terminal's markup takes `[s]` for a style and drops it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import typer
from rich.text import Text

from samrl_ros.cli.commands import COMMANDS, GROUPS, app


def _commands(group: Any, path: str) -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            command.make_context(name, ["--help"], resilient_parsing=True)  # a group is loaded when used
            yield from _commands(command, f"{path} {name}")
        else:
            yield f"{path} {name}", command


@pytest.mark.thorough  # imports what each command needs: some seconds
def test_no_help_text_loses_words_to_markup() -> None:
    seen = 0
    for path, command in _commands(typer.main.get_command(app), "samrl"):
        context = command.make_context(path, [], resilient_parsing=True)
        for option in command.get_params(context):
            text = getattr(option, "help", None) or ""
            seen += 1
            assert Text.from_markup(text).plain == text, f"{path} {option.name}: {text}"
    assert seen > len(COMMANDS) + len(GROUPS)
