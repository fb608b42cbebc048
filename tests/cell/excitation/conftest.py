"""The cell's two arms with what they carry."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from samrl_core.cell.robots.arm_model import Payload, nominal_payloads
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.robot import ROLES, RobotSpec
from samrl_core.cell.tasks import task_named


@dataclass(frozen=True, eq=False)
class CarryingArm:
    role: str
    spec: RobotSpec
    payload: Payload


def _arms() -> dict[str, CarryingArm]:
    cell = cell_named()
    tool = task_named("peg_insertion").scene(cell).tool
    loads = nominal_payloads(cell, tool)
    return {role: CarryingArm(role, cell.arm(role), loads[role]) for role in ROLES}


ARMS = _arms()  # once: the free box is cached per arm


@pytest.fixture(params=ROLES)
def arm(request: pytest.FixtureRequest) -> CarryingArm:
    return ARMS[request.param]


@pytest.fixture
def tool_arm() -> CarryingArm:
    return ARMS["tool_arm"]


@pytest.fixture
def camera_arm() -> CarryingArm:
    return ARMS["camera_arm"]
