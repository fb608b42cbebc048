"""The version that reports, bags and summaries state."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

NOT_INSTALLED = "source"  # of a working tree that no installer has seen


def samrl_version() -> str:
    """Version of the installed package, "source" when it is not installed."""
    try:
        return version("samrl")
    except PackageNotFoundError:
        return NOT_INSTALLED
