"""Names of poses that only neighbours explain: robot makers' angles, OpenCV's vectors beside a pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

Named = dict[tuple[tuple[str, ...], str], dict[str, str]]  # stem and kind -> letter -> column

# Angles about z, y and x, each in the frame turned by those before it: roll, pitch and yaw about fixed axes.
MAKERS = (
    dict(zip("cba", "xyz", strict=True)),  # KUKA: A about z, B about y, C about x
    dict(zip("wpr", "xyz", strict=True)),  # FANUC: W about x, P about y, R about z, all fixed
)
LETTERS = frozenset("abcwpr")
OPENCV = ("tvec",)  # stem of `rvec_x`, `tvec_x` that stand beside another pose


def add_makers_angles(
    single: Named,
    units: dict[tuple[tuple[str, ...], str], str],
    letters: Mapping[tuple[str, ...], Mapping[str, tuple[str, str]]],
) -> None:
    """Make angles of a robot maker the roll, pitch and yaw of the position beside them.

    Args:
        single: names found so far.
        units: of them.
        letters: stem -> letter -> column and unit of names that end with one letter.
    """
    for stem, found in letters.items():
        kinds = {kind for other, kind in single if other == stem}
        if kinds != {"position"} or not {"x", "y", "z"} <= set(single[stem, "position"]):
            continue
        for maker in MAKERS:
            if set(maker) <= set(found):
                single[stem, "rpy"] = {axis: found[letter][0] for letter, axis in maker.items()}
                units[stem, "rpy"] = found[next(iter(maker))][1]
                break


def part_opencv(single: Named, units: dict[tuple[tuple[str, ...], str], str]) -> None:
    """OpenCV's vectors are a pose of their own beside a position without a name; alone they are the log's."""
    if ((), "position") in single:
        return
    for kind in ("position", "rotation_vector"):
        if (OPENCV, kind) in single:
            single[(), kind] = single.pop((OPENCV, kind))
            units[(), kind] = units.pop((OPENCV, kind))


def are_makers_letters(names: Sequence[str]) -> bool:
    """Whether columns are X, Y, Z and a robot maker's angles, and nothing else."""
    return {name.lower() for name in names} in [{*"xyz", *maker} for maker in MAKERS]
