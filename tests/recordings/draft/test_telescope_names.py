"""Names of a telescope's servo log: dates under UTC are a clock, demanded positions are commanded."""

from __future__ import annotations

import pytest

from samrl_ros.log_import.draft.column_names import is_time, meaning


@pytest.mark.parametrize("name", ["UTC", "UTC [#iso]", "DATE", "utc_time", "datetime"])
def test_dates_are_a_clock_by_name(name: str) -> None:
    assert is_time(name)


@pytest.mark.parametrize("name", ["az_dem", "{}_dem [deg]", "demand{}", "demanded_{}"])
def test_what_is_demanded_is_commanded(name: str) -> None:
    assert meaning(name).commanded
