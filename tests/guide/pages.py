"""Code of a page of the guide, executed as the modules that the page says it is."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

GUIDE = Path(__file__).parents[2] / "msgs_docs/guide"
_BLOCK = re.compile(r"^```python\n# (\S+)\.py\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def modules_of(page: str, patch: pytest.MonkeyPatch) -> dict[str, ModuleType]:
    """The page's files in order, by dotted name; importable until `patch` is undone."""
    found = {}
    for path, code in _BLOCK.findall((GUIDE / page).read_text()):
        name = "samrl_core." + path.replace("/", ".")
        module = found[name] = ModuleType(name)
        patch.setitem(sys.modules, name, module)
        exec(compile(code, f"{page}:{path}.py", "exec"), vars(module))
    return found


def added_lines(page: str) -> list[str]:
    """What the page's differences add."""
    blocks = re.findall(r"^```diff\n(.*?)^```$", (GUIDE / page).read_text(), re.MULTILINE | re.DOTALL)
    return [line[1:] for block in blocks for line in block.splitlines() if line.startswith("+")]
