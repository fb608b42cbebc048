"""What a folder of results is for: development, or a final table, which one state of the code makes.

Test cells that were looked at are no test any more. A folder keeps its purpose; one for a final table keeps a
hash of the package, too, and is not gone on with by other code.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from samrl_core.common.errors import InputError
from samrl_core.common.files import keep_to
from samrl_core.common.streams import TEST

PURPOSE = "purpose.json"


def one_purpose(purposes: Iterable[str]) -> str:
    """The purpose that all have.

    Raises:
        InputError: there are two.
    """
    found = sorted(set(purposes))
    if len(found) != 1:
        raise InputError(
            f"conditions of one run are for {' and '.join(found) or 'nothing'}; run those for a final table "
            f"apart, once, into a folder of their own"
        )
    return found[0]


def keep_purpose(folder: Path, purpose: str) -> None:
    """State the purpose of a folder, or hold it against the one that is there.

    Raises:
        InputError: the folder has another purpose, or is for a final table and other code has begun it.
    """
    code = code_digest() if purpose == TEST else ""
    keep_to(folder / PURPOSE, {"purpose": purpose, "code": code}, "evaluation", {})


@cache
def code_digest() -> str:
    """Hash of all source files of the package, the same wherever it is installed."""
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
