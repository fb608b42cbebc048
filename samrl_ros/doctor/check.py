"""One line of a check-up."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Level(StrEnum):
    """How bad a finding is."""

    OK = "ok"
    WARNING = "warning"  # it runs, but slower, less safely or not with everything
    PROBLEM = "problem"  # `samrl cell` does not run


@dataclass(frozen=True)
class Check:
    """Result of one check, with its remedy; `remedy` is empty when all is well."""

    name: str
    level: Level
    found: str
    remedy: str = ""


def ok(name: str, found: str) -> Check:
    """All is well."""
    return Check(name, Level.OK, found)


def warning(name: str, found: str, remedy: str) -> Check:
    """It runs, but not as it should."""
    return Check(name, Level.WARNING, found, remedy)


def problem(name: str, found: str, remedy: str) -> Check:
    """The cell does not run."""
    return Check(name, Level.PROBLEM, found, remedy)
