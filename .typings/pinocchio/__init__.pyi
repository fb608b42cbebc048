# pinocchio's names come from a compiled module by a star import, which pyright cannot see.
from typing import Any

def __getattr__(name: str) -> Any: ...
