"""Effect families of an arm, numbers 1-30 of the catalogue: what a library may hold."""

from __future__ import annotations

from samrl_core.diagnosis.effects import EFFECTS, NOT_BY_JOINTS

ARM_FAMILIES: tuple[str, ...] = (*(e.family for e in EFFECTS), *NOT_BY_JOINTS)


def without(withheld: str) -> tuple[str, ...]:
    """The library without one family."""
    return tuple(f for f in ARM_FAMILIES if f != withheld)
