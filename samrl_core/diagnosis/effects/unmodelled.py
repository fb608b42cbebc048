"""Families of the contract that have no effect in the library: joint channels cannot show them, or they are
errors of a description, which `selection.description` looks for before any effect.

An entry leaves this list when the family gets an effect of its own.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class UnmodelledFamily:
    """A family of the contract in words; `reason` says why an arm's recordings cannot show it."""

    number: int
    family: str
    title: str  # starts a sentence
    meaning: str
    remedy: str
    reason: str = ""  # only of families of an arm: those of cameras and contacts are no matter of its joints

    @property
    def running_title(self) -> str:
        """The title as it stands within a sentence."""
        return self.title[:1].lower() + self.title[1:]


UNMODELLED: tuple[UnmodelledFamily, ...] = (
    UnmodelledFamily(
        33,
        "clearance",
        "Clearance of the fit",
        "Hole and peg leave more or less room than the model.",
        "Measure both parts and correct the geometry; wear makes it grow.",
    ),
    UnmodelledFamily(
        34,
        "grip_slip",
        "Slip in the grip",
        "The held object moves between the fingers under load.",
        "Raise the gripping force or roughen the fingers; otherwise let the model allow the slip.",
    ),
    UnmodelledFamily(
        35,
        "tool_compliance",
        "Compliant tool",
        "The tool bends under load, so that its tip lags behind the flange.",
        "Stiffen the tool, or model it as a spring of the fitted stiffness.",
    ),
    UnmodelledFamily(
        37,
        "thread_stiffness",
        "Stiffness of the thread",
        "The thread stretches or bends otherwise than modelled.",
        "Set its stretch and bending stiffness from a hanging and a pulling test.",
    ),
    UnmodelledFamily(
        38,
        "eye_friction",
        "Friction at the eye",
        "The thread drags at the needle's eye, or air moves it.",
        "Measure the drag by slow insertion, and shield the scene from draught.",
    ),
    UnmodelledFamily(
        44,
        "depth_dropout",
        "Missing depth",
        "Pixels lose their depth at edges, slopes and shiny surfaces otherwise than modelled.",
        "Model the dropout over angle and material, or change view or surface.",
    ),
    UnmodelledFamily(
        47,
        "rolling_shutter",
        "Rolling shutter or motion blur",
        "Rows are exposed one after another or for long, so that fast views shear or smear.",
        "Shorten the exposure, move slower while looking, or model the row time.",
    ),
    UnmodelledFamily(
        51,
        "joint_order",
        "Order of the joints",
        "Two or more joints of the log stand under each other's names: an error of the description.",
        "Exchange the columns named in the report, in the mapping or in the driver.",
    ),
    UnmodelledFamily(
        52,
        "unit_error",
        "Unit of the torques",
        "The logged torques are in another unit than the description says: an error of the description.",
        "Correct the unit of the effort columns in the mapping, or in the driver.",
    ),
)
