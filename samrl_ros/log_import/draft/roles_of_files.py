"""Files named as measured and commanded, `measured_js` and `setpoint_js`: topics of one recording."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.column_names import meaning


def split_roles(paths: list[Path]) -> tuple[list[Path], list[Path]]:
    """Those measured by their names, and those commanded; a name that says both is neither."""
    said = {path: meaning(path.stem) for path in paths}
    return (
        [path for path, each in said.items() if each.measured and not each.commanded],
        [path for path, each in said.items() if each.commanded and not each.measured],
    )


def are_topics(spans: Mapping[Path, tuple[float, float]]) -> bool:
    """Whether files with the same columns are topics of one recording, and not recordings one after another.

    Args:
        spans: first and last stamp of each file, in one unit; NaN where it has none.

    Raises:
        InputError: several are measured, at once with what is commanded: which belong together is not said.
    """
    measured, commanded = split_roles(list(spans))
    at_once = [
        (one, other)
        for one in measured
        for other in commanded
        if not (spans[one][1] < spans[other][0] or spans[other][1] < spans[one][0])
    ]
    if at_once and len(measured) > 1:
        one, other = at_once[0]
        raise InputError(
            f"{one.name} and {other.name} were recorded at once, one measured, one commanded by name,"
            f" and {len(measured)} files are measured: put those of each recording into a folder of its own,"
            " under the same names, as run1/measured.csv and run1/setpoint.csv"
        )
    return bool(at_once)
