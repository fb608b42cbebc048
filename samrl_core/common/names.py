"""Names that somebody mistyped: what to say of them."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def known_are(name: str, known: Iterable[str], what: str = "known are") -> str:
    """End of a refusal: the known names, and which of them comes nearest, if one is near.

    Args:
        name: that is not known.
        known: what may stand in its place, in the order in which it is listed.
        what: goes before the list.

    Returns:
        `known are payload, cable; did you mean 'payload'?`.
    """
    listed = list(known)
    near = get_close_matches(name, listed, n=1)
    return f"{what} {', '.join(listed)}" + (f"; did you mean {near[0]!r}?" if near else "")
