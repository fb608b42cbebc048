"""A few damaged inputs to every reader at each commit; `make fuzz` tries 100,000."""

from __future__ import annotations

import pytest

from tests.fuzz.attack import attack
from tests.fuzz.reader import Reader
from tests.fuzz.readers import READERS

FEW = 15  # inputs per reader


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)
def test_damaged_inputs_are_read_or_refused(reader: Reader) -> None:
    for content in reader.sound():
        assert content
    assert attack(reader, FEW, seed=0) >= FEW
