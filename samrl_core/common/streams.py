"""Random streams by name: what two numbers cannot keep apart, two names do.

NumPy's seeds made of integers collide: `default_rng([seed, 3])` and `default_rng((seed, 3, 0, 0))` are one
stream, because trailing zeros do not count: 2 of 200 evaluated episodes once began where training data began.
A name is hashed with its kind and its length, so that different names are different streams, and
`DEVELOPMENT` and `TEST` never share one whatever the numbers behind them.
"""

from __future__ import annotations

import hashlib

import numpy as np

from samrl_core.common.errors import InputError

DEVELOPMENT = "development"  # what may be looked at, trained on and tuned to
TEST = "test"  # what is looked at once, for a final table
PURPOSES = (DEVELOPMENT, TEST)


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """The generator of a seed and a path of names, such as `stream(7, "cell instance", "depth", "scale")`.

    Raises:
        InputError: from `entropy_of`.
    """
    return np.random.default_rng(np.random.SeedSequence(entropy_of(seed, *names)))


def seed_of(seed: int, *names: str | int) -> int:
    """A seed below 2^63 for what takes a number alone, from the same hash.

    Raises:
        InputError: from `entropy_of`.
    """
    return entropy_of(seed, "seed", *names) >> 193


def entropy_of(seed: int, *names: str | int) -> int:
    """256 bits that follow from the seed and all names, in order.

    Raises:
        InputError: the seed is negative, there is no name, or a name is empty or neither text nor a whole
            number.
    """
    if seed < 0:
        raise InputError(f"seed is {seed}, must be at least 0")
    if not names:
        raise InputError("a stream needs a name; say what is drawn from it")
    digest = hashlib.sha256()
    for part in (seed, *names):
        if isinstance(part, bool) or not isinstance(part, str | int | np.integer) or part == "":
            raise InputError(f"a stream's name has {part!r} in it, must be text or a whole number")
        kind = b"t" if isinstance(part, str) else b"n"
        text = (part if isinstance(part, str) else str(int(part))).encode()
        digest.update(kind + len(text).to_bytes(8, "little") + text)
    return int.from_bytes(digest.digest(), "little")
