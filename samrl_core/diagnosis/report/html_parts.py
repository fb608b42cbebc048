"""Small pieces of HTML. Everything that is not `Markup` is escaped on its way in."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence


class Markup(str):
    """Text that is HTML already."""


def put(value: object) -> Markup:
    """A value as HTML: escaped, unless it is HTML already."""
    return value if isinstance(value, Markup) else Markup(html.escape(str(value), quote=True))


def element(tag: str, *children: object, **attributes: object) -> Markup:
    """`<tag>`; `css` stands for class, and an underscore in other names for a hyphen."""
    shown = "".join(
        f' {"class" if name == "css" else name.replace("_", "-")}="{put(value)}"'
        for name, value in attributes.items()
        if value is not None
    )
    return Markup(f"<{tag}{shown}>{join(children)}</{tag}>")


def join(children: Iterable[object]) -> Markup:
    """Children one after another."""
    return Markup("".join(put(child) for child in children))


def bullets(items: Iterable[object]) -> Markup:
    """An unordered list."""
    return element("ul", *(element("li", item) for item in items))


def table(
    head: Sequence[str], rows: Iterable[Sequence[object]], numbers: Sequence[int] = (), css: str = "wide"
) -> Markup:
    """A table; `numbers` are columns set flush right.

    Where it is too wide it scrolls sideways by itself; the `wide` kind becomes cards on a phone.
    """

    def kind(column: int) -> str:
        return "n" if column in numbers else "any"

    top = element("tr", *(element("th", name, scope="col", css=kind(i)) for i, name in enumerate(head)))
    body = [
        element(
            "tr",
            *(
                element("td", element("span", cell), css=kind(i), data_label=head[i])
                for i, cell in enumerate(row)
            ),
        )
        for row in rows
    ]
    inner = element("table", element("thead", top), element("tbody", *body), css=css)
    return element("div", inner, css="scroll", tabindex=0, role="region", aria_label=", ".join(head))


def bar(fraction: float, css: str = "") -> Markup:
    """A horizontal bar filled to that fraction; it says nothing that the text beside it does not."""
    width = 100 * min(max(fraction, 0.0), 1.0)
    return element(
        "span", element("i", style=f"width:{width:.1f}%"), css=f"bar {css}".strip(), aria_hidden="true"
    )


def key_figure(title: str, value: str, note: str = "") -> Markup:
    """One of the row of figures below the headline; `value` is a number, perhaps a space and a unit."""
    # `> 99 %` stays together: its sign belongs to the number.
    figures, _, unit = value.partition(" ") if value[:1] not in "<>" else (value, "", "")
    shown = (figures, " ", element("span", unit, css="unit")) if unit else (figures,)
    return element("div", element("dt", title), element("dd", *shown, element("small", note) if note else ""))


def section(title: str, *children: object, anchor: str) -> Markup:
    """A section with its heading."""
    return element("section", element("h2", title), *children, id=anchor)


def box(title: str, *children: object, css: str = "") -> Markup:
    """Text set off from the rest."""
    return element("div", element("h3", title), *children, css=f"box {css}".strip())


def figure(anchor: str, caption: str) -> Markup:
    """Where the script draws a figure; its data stands in the script element of that name."""
    plot = element("div", css="plot", data_figure=anchor, role="img", aria_label=caption)
    return element("figure", plot, element("figcaption", caption))


def data_script(anchor: str, json_text: str) -> Markup:
    """Data for the script; `json_text` must hold no `<`."""
    assert "<" not in json_text
    return Markup(f'<script type="application/json" id="{put(anchor)}">{json_text}</script>')
