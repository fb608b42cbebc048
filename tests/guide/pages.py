"""Code of a page of the guide, executed as the modules that the page says it is."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

GUIDE = Path(__file__).parents[2] / "msgs_docs/guide"
_BLOCK = re.compile(r"^```(\w+)(?: (\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page: str, *languages: str) -> list[tuple[str, str, str]]:
    """Language, file that is named behind it, and text of each block in those languages, in order."""
    return [found for found in _BLOCK.findall((GUIDE / page).read_text()) if found[0] in languages]


def module_of(name: str, code: str, patch: pytest.MonkeyPatch) -> None:
    """Execute a file's code as the module of that name; importable until `patch` is undone."""
    module = ModuleType(name)
    patch.setitem(sys.modules, name, module)
    exec(compile(code, name, "exec"), vars(module))


def register(page: str, patch: pytest.MonkeyPatch, package: ModuleType, registry: str) -> None:
    """Follow the page: its files are modules, and what its lines add to a registry is in there."""
    for _, _, text in blocks(page, "python"):
        if name := re.match(r"# (\S+)\.py\n", text):
            module_of("samrl_core." + name[1].replace("/", "."), text, patch)
    differences = "".join(text for _, _, text in blocks(page, "diff"))
    changed = dict(vars(package))
    exec("\n".join(line[1:] for line in differences.splitlines() if line.startswith("+")), changed)
    for name, made in changed[registry].items():
        patch.setitem(vars(package)[registry], name, made)
