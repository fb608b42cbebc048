"""Changes attributes of an XML text and leaves every other byte as it is: a diff shows the change."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from samrl_core.common.errors import InputError


@dataclass(eq=False)
class XmlElement:
    """An element of the text."""

    tag: str
    attributes: dict[str, str]
    parent: XmlElement | None
    start: int  # byte of its '<'
    end: int = 0  # byte behind the '>' of its first tag
    close: int = 0  # byte of its end tag's '<'; `end` where it has none
    children: list[XmlElement] = field(default_factory=list)

    def child(self, tag: str) -> XmlElement | None:
        """The first child of a tag."""
        return next((c for c in self.children if c.tag == tag), None)


class XmlText:
    """A text and the edits to it; the text itself is never reordered or reformatted.

    Raises:
        InputError: it is not well-formed.
    """

    def __init__(self, text: str) -> None:
        """Find every element."""
        self.data = text.encode()
        self.elements: list[XmlElement] = []
        self._edits: list[tuple[int, int, bytes]] = []
        self._changed: dict[int, tuple[XmlElement, str, dict[str, str]]] = {}
        self._opened: set[int] = set()
        stack: list[XmlElement] = []
        parser = expat.ParserCreate()

        def start(tag: str, attributes: dict[str, str]) -> None:
            one = XmlElement(tag, dict(attributes), stack[-1] if stack else None, parser.CurrentByteIndex)
            one.end = _tag_end(self.data, one.start)
            if stack:
                stack[-1].children.append(one)
            self.elements.append(one)
            stack.append(one)

        def end(tag: str) -> None:
            one = stack.pop()
            one.close = max(parser.CurrentByteIndex, one.end)

        parser.StartElementHandler, parser.EndElementHandler = start, end
        try:
            parser.Parse(self.data, True)
        except expat.ExpatError as error:
            raise InputError(f"the model is not well-formed XML ({error}); mend it") from error

    def find(self, tag: str, **attributes: str) -> XmlElement | None:
        """The first element of a tag with these attributes."""
        for one in self.elements:
            if one.tag == tag and all(one.attributes.get(k) == v for k, v in attributes.items()):
                return one
        return None

    def set(self, element: XmlElement, attributes: dict[str, str | None], tag: str | None = None) -> None:
        """Set attributes, None takes one away; another `tag` renames the element."""
        name, now = self.state(element)
        for key, value in attributes.items():
            if value is None:
                now.pop(key, None)
            else:
                now[key] = value
        self._changed[element.start] = (element, tag or name, now)

    def state(self, element: XmlElement) -> tuple[str, dict[str, str]]:
        """Tag and attributes as they will be."""
        _, tag, now = self._changed.get(element.start, (element, element.tag, element.attributes))
        return tag, dict(now)

    def add_first(self, element: XmlElement, text: str) -> None:
        """Put a child in front of an element's content."""
        line = self.data.rfind(b"\n", 0, element.start) + 1
        lead = re.match(rb"[ \t]*", self.data[line : element.start])
        indent = lead.group() if lead else b""
        added = b"\n" + indent + b"  " + text.encode()
        if self.data[element.end - 2 : element.end] == b"/>":  # opened by whoever writes its first tag
            self._opened.add(element.start)
            self._changed.setdefault(element.start, (element, element.tag, dict(element.attributes)))
            added += b"\n" + indent + f"</{element.tag}>".encode()
        self._edits.append((element.end, element.end, added))

    def replace_content(self, element: XmlElement, text: str) -> None:
        """Put this in place of all that an element holds."""
        self._edits.append((element.end, element.close, text.encode()))

    def result(self) -> str:
        """The text with all edits."""
        edits = list(self._edits)
        for element, tag, attributes in self._changed.values():
            old = self.data[element.start : element.end]
            new = _rewritten(old, element, tag, attributes)
            if element.start in self._opened:
                new = re.sub(rb"\s*/>$", b">", new)
            edits.append((element.start, element.end, new))
            if tag != element.tag and element.close > element.end:
                close = self.data.index(b">", element.close) + 1
                edits.append((element.close, close, f"</{tag}>".encode()))
        out = self.data
        # An element's own first tag and what is put behind it touch: the later one goes in first.
        for begin, end, new in sorted(edits, key=lambda e: (e[0], e[1]), reverse=True):
            out = out[:begin] + new + out[end:]
        return out.decode()


def _tag_end(data: bytes, start: int) -> int:
    """Byte behind the '>' that ends the tag at `start`; one within quotes does not."""
    quote = 0
    for k in range(start, len(data)):
        c = data[k]
        if quote:
            quote = 0 if c == quote else quote
        elif c in b"\"'":
            quote = c
        elif c == ord(">"):
            return k + 1
    return len(data)


def _rewritten(old: bytes, element: XmlElement, tag: str, attributes: dict[str, str]) -> bytes:
    """The first tag with changed attributes; those that stay keep their place and their spelling."""
    text = old.decode()
    for key, value in element.attributes.items():
        pattern = re.compile(rf"(\s+){re.escape(key)}(\s*=\s*)(\"[^\"]*\"|'[^']*')")
        if key not in attributes:
            text = pattern.sub("", text, count=1)
        elif attributes[key] != value:
            text = pattern.sub(lambda m, k=key: f"{m[1]}{k}{m[2]}{quoteattr(attributes[k])}", text, count=1)
    new = "".join(f" {k}={quoteattr(v)}" for k, v in attributes.items() if k not in element.attributes)
    cut = re.search(r"\s*/?>$", text)
    assert cut is not None
    text = text[: cut.start()] + new + text[cut.start() :]
    return re.sub(rf"^<{re.escape(element.tag)}", f"<{tag}", text).encode()
