"""Several bags of one machine: which lie in a folder, and one draft for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from samrl_core.common.files import is_file, is_folder
from samrl_ros.log_import.draft.blocks import ROS_TYPES
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.roles_of_files import are_topics, split_roles
from samrl_ros.log_import.draft.same_machine import Makings, read_makings, topics_of_joints
from samrl_ros.log_import.formats.parquet import is_lerobot
from samrl_ros.log_import.formats.rosbag import is_bag, list_topics, read_span
from samrl_ros.log_import.imported_files import INDEX
from samrl_ros.log_import.tables import RARELY_LOGS, SUFFIXES

_LOGS = frozenset(SUFFIXES) - {*RARELY_LOGS, ".txt", ".json"}  # beside bags, text and JSON are notes
SAID = 3  # differences that a question names


def bags_in(path: Path) -> list[Path]:
    """Bags in a folder that holds no other logs, by name: folders, or files without metadata; else none.

    A folder with metadata.yaml, or with a single .mcap file, is a bag itself.
    """
    if not is_folder(path) or is_lerobot(path) or is_file(path / "metadata.yaml"):
        return []
    inside = sorted(path.iterdir())
    if any(file.name == INDEX or file.suffix.lower() in _LOGS for file in inside):
        return []
    found = [each for each in inside if is_bag(each) and (is_folder(each) or is_file(each))]
    only = found == [path / f"{each.stem}.mcap" for each in found[:1]]
    return [] if only or _are_topics(found) else found


def bags_of(paths: Sequence[Path]) -> list[Path]:
    """Bags of one machine: those of a folder, or several in one folder that are named; else none.

    Named bags with different topics may be one recording: its joints in one, its controller in another.
    """
    if len(paths) == 1:
        return bags_in(paths[0])
    if len({path.resolve().parent for path in paths}) != 1 or not all(is_bag(path) for path in paths):
        return []
    joints = [[topic for topic in list_topics(path, "the log") if topic.type in ROS_TYPES] for path in paths]
    topics = [{topic.name for topic in each} for each in joints]
    alike = topics[0] and all(each == topics[0] for each in topics)
    return list(paths) if alike and not _are_topics(paths) else []


def _are_topics(bags: Sequence[Path]) -> bool:
    """Whether bags are one recording's, as echoed topics with a file each are, by their names and stamps."""
    return all(split_roles(list(bags))) and are_topics({bag: read_span(bag, "the log") for bag in bags})


def spread(draft: Draft, bags: Sequence[Path]) -> Draft:
    """A draft of the first bag, for all that hold the topics it reads; the last of them is held out.

    Bags that name other joints are left out. Whether the others are of one machine is asked where anything
    speaks against it.

    Args:
        draft: of `bags[0]`; changed in place.
        bags: of one folder.

    Raises:
        InputError: a bag that cannot be read.
    """
    first, *others = bags
    read = {source["part"] for source in draft.sources.values() if "part" in source}
    topics = topics_of_joints(first, read)
    alike, seen = [first], [read_makings(first, topics)]
    for bag in others:
        lacks = read - {topic.name for topic in list_topics(bag, "the log")}
        if lacks:
            draft.unused.append(f"{bag.name}: has no {', '.join(sorted(lacks))}")
            continue
        makings = read_makings(bag, topics)
        if absent := makings.lacks(seen[0], draft.joints):
            draft.unused.append(f"{bag.name}: names no {', '.join(absent)}, so it is another machine's")
            continue
        alike.append(bag)
        seen.append(makings)
    if len(alike) == 1 or len(draft.recordings) != 1:
        draft.unused += [f"{bag.name}: a recording of its own" for bag in alike[1:]]
        return draft
    kinds = {"" if is_folder(bag) else bag.suffix for bag in alike}
    draft.recordings = [
        {"name": bag.name if is_folder(bag) else bag.stem, "role": "held_out" if bag is alike[-1] else "fit"}
        for bag in alike
    ]
    for name, source in draft.sources.items():
        source["file"] = f"{{name}}{min(kinds)}"
        if len(kinds) > 1:  # folders beside files: each recording names its own
            for recording, bag in zip(draft.recordings, alike, strict=True):
                recording.setdefault("files", {})[name] = bag.name
    draft.note(
        "recordings",
        f"drafted from {first.name}; {', '.join(bag.name for bag in alike[1:])} with the same topics"
        f" {'is' if len(alike) == 2 else 'are'} read alike, and the last by name is held out",
        _one_machine(seen),
    )
    return draft


def ask_one_machine(bags: Sequence[Path]) -> str:
    """The question whether bags are of one machine; empty where nothing speaks against it.

    Raises:
        InputError: a bag that cannot be read.
    """
    if len(bags) < 2:
        return ""
    topics = {topic.name for topic in list_topics(bags[0], "the log")}
    return _one_machine([read_makings(bag, topics_of_joints(bag, topics)) for bag in bags])


def _one_machine(seen: Sequence[Makings]) -> str:
    pairs = [(a, b) for k, b in enumerate(seen) for a in seen[:k]]
    found = [phrase for a, b in pairs for phrase in b.differs(a)]
    if not found:
        return ""
    more = f"; and {len(found) - SAID} more such pairs" if len(found) > SAID else ""
    return f"are all of one machine? {'; '.join(found[:SAID])}{more}; take out those of another, and copies"
