"""Arms by name. A new arm is a folder with a URDF and a `RobotSpec`, and a line here."""

from __future__ import annotations

from samrl_core.cell.robots.panda.spec import PANDA
from samrl_core.cell.robots.rizon.spec import RIZON4
from samrl_core.cell.robots.robot import RobotSpec

ROBOTS: dict[str, RobotSpec] = {spec.name: spec for spec in (PANDA, RIZON4)}
