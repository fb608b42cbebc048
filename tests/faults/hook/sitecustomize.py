"""In the processes of a cell under test: what its arms are made to do is written down at every step.

Python imports this by itself where the folder leads PYTHONPATH. The cell's own code stays as it is.
"""

from __future__ import annotations

import importlib.abc
import importlib.util
import os
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

TARGET = "samrl_core.cell.world"


class _Loader(importlib.abc.Loader):
    def __init__(self, inner: Any) -> None:
        self._inner = inner

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return self._inner.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        self._inner.exec_module(module)
        make = module.make_world

        def make_watched(*arguments: Any, **named: Any) -> Any:
            from tests.faults.watched_world import WatchedWorld

            return WatchedWorld(make(*arguments, **named), os.environ["SAMRL_FAULTS_STEPS"])

        module.make_world = make_watched  # ty: ignore[missing-attribute]


class _Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        if name != TARGET:
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        if spec is not None:
            spec.loader = _Loader(spec.loader)
        return spec


if os.environ.get("SAMRL_FAULTS_STEPS"):
    sys.meta_path.insert(0, _Finder())
