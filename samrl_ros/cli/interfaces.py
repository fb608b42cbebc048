"""`samrl interfaces`: the project's ROS 2 interfaces, built into this environment or taken out again."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Annotated

import typer

from samrl_ros.interfaces.build import main


@dataclass(frozen=True)
class InterfacesOptions:
    """Options of `samrl interfaces`."""

    force: Annotated[bool, typer.Option("--force", help="Build even when the installed one is current.")] = (
        False
    )
    remove: Annotated[bool, typer.Option("--remove", help="Take out what this command installed.")] = False


def build_interfaces(options: InterfacesOptions) -> int:
    """Build what is not current; what is not of this project stays."""
    return main([f"--{name}" for name, wanted in asdict(options).items() if wanted])
