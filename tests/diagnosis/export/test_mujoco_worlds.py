"""From an MJCF and logs of a machine to a changed MJCF that plain MuJoCo confirms."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.diagnosis.export.run_worlds import judge


@pytest.mark.slow
@pytest.mark.parametrize("name", ["coulomb:servo:11", "mass:motor:16", "damping:servo:13"])
def test_plain_mujoco_confirms_the_promise(name: str, tmp_path: Path) -> None:
    found = judge(name, tmp_path / "world")
    assert found["verdict"] in ("effect", "ambiguous"), found
    assert found["shrink"] >= 0.9 * found["promise"], found
