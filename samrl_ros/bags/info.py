"""What a bag holds, as a dictionary and as text for people."""

from __future__ import annotations

from typing import Any

from rich.console import Group
from rich.table import Table
from rich.text import Text

from samrl_ros.bags.reader import Bag


def describe(bag: Bag) -> dict[str, Any]:
    """Plain values for JSON; times [s] of the bag's clock, rates over the bag's duration."""
    duration_s = (bag.end_ns - bag.start_ns) * 1e-9
    return {
        "path": str(bag.path),
        "files": [file.name for file in bag.files],
        "bytes": sum(file.stat().st_size for file in bag.files),
        "duration_s": duration_s,
        "start_s": bag.start_ns * 1e-9,
        "end_s": bag.end_ns * 1e-9,
        "messages": bag.message_count,
        "truncated": bag.truncated,
        "damage": list(bag.damage),
        "notes": list(bag.notes),
        "metadata": bag.has_metadata,
        "custom_data": dict(bag.custom_data),
        "topics": [
            {
                "name": topic.name,
                "type": topic.type,
                "count": topic.count,
                "rate_hz": topic.count / duration_s if duration_s > 0 else None,
                "reliability": topic.qos[0].reliability if topic.qos else None,
                "durability": topic.qos[0].durability if topic.qos else None,
                "type_hash": topic.type_hash or None,
            }
            for topic in bag.topics
        ],
    }


def render(described: dict[str, Any]) -> Group:
    """Text for a rich console."""
    lines = [
        f"{described['path']}: {described['messages']} messages, {described['duration_s']:.3f} s, "
        f"{described['bytes'] / 1e6:.2f} MB in {', '.join(described['files'])}",
        f"log time {described['start_s']:.3f} s to {described['end_s']:.3f} s",
        *(f"{key}: {value}" for key, value in described["custom_data"].items()),
    ]
    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column("topic", no_wrap=True, overflow="fold")  # names matter most
    table.add_column("type", no_wrap=True, overflow="ellipsis")
    for name in ("count", "Hz"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("QoS", no_wrap=True, overflow="ellipsis")
    table.add_column("hash", no_wrap=True, overflow="ellipsis")
    for topic in described["topics"]:
        rate = topic["rate_hz"]
        qos = f"{topic['reliability']}, {topic['durability']}" if topic["reliability"] else "not recorded"
        table.add_row(
            topic["name"],
            topic["type"],
            str(topic["count"]),
            "-" if rate is None else f"{rate:.1f}",
            qos,
            topic["type_hash"][7:15] if topic["type_hash"] else "-",
        )
    notes = [Text(note, style="yellow") for note in described["notes"]]
    if described["truncated"]:
        notes.append(Text("truncated: " + "; ".join(described["damage"]), style="yellow"))
    elif not described["metadata"]:
        notes.append(
            Text("no metadata.yaml: `ros2 bag` needs it, `samrl bag repair` writes it", style="yellow")
        )
    return Group(Text("\n".join(lines)), table, *notes)
