"""Several bags of one machine: which lie in a folder, and one draft for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from samrl_core.common.files import is_file, is_folder
from samrl_ros.log_import.draft.blocks import ROS_TYPES
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.formats.parquet import is_lerobot
from samrl_ros.log_import.formats.rosbag import is_bag, list_topics
from samrl_ros.log_import.imported_files import INDEX
from samrl_ros.log_import.tables import RARELY_LOGS, SUFFIXES

_LOGS = frozenset(SUFFIXES) - {*RARELY_LOGS, ".txt", ".json"}  # beside bags, text and JSON are notes


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
    return [] if found == [path / f"{each.stem}.mcap" for each in found[:1]] else found


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
    return list(paths) if topics[0] and all(each == topics[0] for each in topics) else []


def spread(draft: Draft, bags: Sequence[Path]) -> Draft:
    """A draft of the first bag, for all that hold the topics it reads; the last of them is held out.

    Args:
        draft: of `bags[0]`; changed in place.
        bags: of one folder.
    """
    first, *others = bags
    read = {source["part"] for source in draft.sources.values() if "part" in source}
    alike = [first]
    for bag in others:
        lacks = read - {topic.name for topic in list_topics(bag, "the log")}
        if lacks:
            draft.unused.append(f"{bag.name}: has no {', '.join(sorted(lacks))}")
        else:
            alike.append(bag)
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
    )
    return draft
