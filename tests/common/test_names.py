"""Names that somebody mistyped."""

from __future__ import annotations

import pytest

from samrl_core.cell.types.arm_description import Tolerances
from samrl_core.common.errors import InputError
from samrl_core.common.names import known_are
from samrl_core.diagnosis.diagnose import library


def test_the_nearest_name_is_proposed() -> None:
    assert known_are("paylod", ("cable", "payload")) == "known are cable, payload; did you mean 'payload'?"
    assert known_are("gravity", ("cable", "payload")) == "known are cable, payload"


def test_refusals_of_names_propose_one() -> None:
    """Of thirty names a reader had to find the one that was meant."""
    with pytest.raises(InputError, match="did you mean 'coulomb_friction'"):
        library(["coulomb_frictio"])
    with pytest.raises(InputError, match="did you mean 'mass'"):
        Tolerances.from_mapping({"mas": 0.05})
