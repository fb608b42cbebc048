"""Pages from Jinja templates, every value escaped and every missing name an error."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup


def read_templates(folders: Sequence[Path], **given: Any) -> Environment:
    """Templates of these folders, the first that has one of a name; all of them see what is `given`."""
    environment = Environment(
        loader=FileSystemLoader(folders),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals.update(given)
    return environment


def sources_of(folder: Path) -> Callable[[str], Markup]:
    """Function of a file's name to its text, which goes into a page as it stands: styles and scripts."""
    return lambda name: Markup((folder / name).read_text(encoding="utf-8"))
