"""A slide's friction is in newtons, whatever the effect's file says of joints that turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.diagnosis.findings.joint_units import sliding_unit, with_joint_units
from samrl_core.diagnosis.report.seen_from import in_short, seen_from
from samrl_core.diagnosis.result import Curve, Diagnosis, LeastSize
from tests.diagnosis.report import samples

URDF = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
<joint name="panda_joint4" type="prismatic"><parent link="a"/><child link="b"/></joint>
<joint name="panda_joint5" type="revolute"><parent link="b"/><child link="c"/></joint></robot>"""


def result() -> Diagnosis:
    d = samples.diagnosis("effect")
    line = np.zeros(2)
    label = "dynamics residual of panda_joint4 [N m]"
    return replace(
        d,
        curves=(
            Curve("coulomb_friction@joint:panda_joint4", "velocity [rad/s]", label, line, line, line, line),
        ),
    )


def arm(*joints: str, urdf: str | None = URDF) -> ArmDescription:
    return ArmDescription("tool_arm", joints, urdf, None)


@pytest.mark.parametrize(
    ("unit", "sliding"),
    [
        ("N m", "N"),
        ("N m s/rad", "N s/m"),
        ("rad", "m"),
        ("kg m2", "kg"),
        ("1/rad", "1/m"),
        ("Hz", "Hz"),
        ("s", "s"),
    ],
)
def test_units(unit: str, sliding: str) -> None:
    assert sliding_unit(unit) == sliding


def test_a_sliding_joint_gets_its_own_units_and_its_neighbour_keeps_them() -> None:
    found = with_joint_units(result(), arm("panda_joint4", "panda_joint5"))
    assert {p.unit for p in found.effects[0].parameters.values()} == {"N", "m/s"}
    assert (found.curves[0].x_label, found.curves[0].y_label[-3:]) == ("velocity [m/s]", "[N]")
    units = {(o.joint, o.quantity): o.unit for o in found.overlays}
    assert units["panda_joint4", "position"] == "m" and units["panda_joint5", "position"] == "rad"
    assert found.gap is not None and "rad or m" in {c[1] for c in found.gap.channels}


def test_of_slides_alone_the_channels_are_plain() -> None:
    found = with_joint_units(result(), arm("panda_joint4"))
    assert found.gap is not None and "m" in {c[1] for c in found.gap.channels}


@pytest.mark.parametrize("urdf", [None, URDF.replace("prismatic", "revolute")])
def test_without_sliding_joints_nothing_changes(urdf: str | None) -> None:
    d = result()
    assert with_joint_units(d, arm("panda_joint4", "panda_joint5", urdf=urdf)) is d


@pytest.mark.parametrize(
    ("text", "sliding"),
    [
        (
            "a@joint:panda_joint4 would have 0.1 times its fitted size at a speed of 0.2 to 0.3 rad/s",
            "a@joint:panda_joint4 would have 0.1 times its fitted size at a speed of 0.2 to 0.3 m/s",
        ),
        ("a@joint:panda_joint4: 3 N m in rad_log", "a@joint:panda_joint4: 3 N in rad_log"),
        (
            "a@joint:panda_joint5 at a position of 1 to 2 rad",
            "a@joint:panda_joint5 at a position of 1 to 2 rad",
        ),
        ("nothing at 1 rad of any joint", "nothing at 1 rad of any joint"),
    ],
)
def test_sentences_about_a_sliding_joint_have_its_units(text: str, sliding: str) -> None:
    d = replace(result(), reasons=(text,), alarms=(text,))
    found = with_joint_units(d, arm("panda_joint4", "panda_joint5"))
    assert found.reasons == found.alarms == (sliding,)


def test_least_sizes_of_slides_are_rows_of_their_own() -> None:
    """A stage whose axes slide read "Fc 0.24 to 0.51 N m"."""
    ends = (-0.4, 0.4)
    places = ("panda_joint4", "panda_joint5")
    least = tuple(LeastSize(f"coulomb_friction@joint:{p}", "Fc", "N m", ends, ends) for p in places)
    found = with_joint_units(replace(result(), least_sizes=least), arm(*places))
    assert [row.unit for row in seen_from(found)] == ["N", "N m"]
    assert in_short(found) == "coulomb_friction Fc ± 0.4 N"
