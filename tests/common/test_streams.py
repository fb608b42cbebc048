"""Streams by name are apart where NumPy's own seeds made of numbers are not."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.common.streams import DEVELOPMENT, TEST, entropy_of, seed_of, stream


def numbers(*path: str | int) -> tuple[int, ...]:
    seed, *names = path
    return tuple(stream(int(seed), *names).integers(2**62, size=4).tolist())


def test_numpys_seeds_of_numbers_collide() -> None:
    """Why there are names: should NumPy mend it, this file may go."""
    one, two = np.random.default_rng([5, 3]), np.random.default_rng((5, 3, 0, 0))
    assert one.integers(2**62) == two.integers(2**62)


def test_different_paths_are_different_streams() -> None:
    paths = [
        (5, "a"), (5, "a", 0), (5, "a", 0, 0), (5, "a", "0"), (5, "0", "a"), (5, "ab"), (5, "a", "b"),
        (0, "a"), (5, DEVELOPMENT, "a"), (5, TEST, "a"), (5, "a", TEST), (5, 0, "a"),
    ]  # fmt: skip
    for one, two in itertools.combinations(paths, 2):
        assert numbers(*one) != numbers(*two), (one, two)


def test_development_and_test_never_meet() -> None:
    """1000 numbered streams of each purpose: no seed of one is one of the other."""
    seeds = {p: {seed_of(k, "episode", p) for k in range(1000)} for p in (DEVELOPMENT, TEST)}
    assert all(len(found) == 1000 for found in seeds.values())
    assert not seeds[DEVELOPMENT] & seeds[TEST]


def test_streams_are_the_same_on_every_machine() -> None:
    """Pinned: results are made with them."""
    assert entropy_of(7, "cell instance", "test") % 10**12 == 842452234233
    assert seed_of(7, "x") == 2414913770872385344 < 2**63


@pytest.mark.parametrize("path", [(-1, "a"), (3,), (3, ""), (3, 1.5), (3, True)])
def test_names_that_are_none_are_refused(path: tuple) -> None:
    with pytest.raises(InputError):
        entropy_of(*path)
