"""Variants of the tasks at the difficulty that their names stand for.

The plain tasks are easier: a peg believed 4 mm beside its hole goes in, a thread goes through after one
look, a pancake is turned over by one who sees nothing. Here fits are tight and starts spread wider, too large
a force is a failure, and an episode has 1.5 times the actions that an expert needs. What an instance is made
of, its true clearance and lean, only its world knows; a model has the drawing and the ranges.
"""

from __future__ import annotations

import math
from dataclasses import replace

from samrl_core.cell.tasks.needle_threading.task import NeedleThreading
from samrl_core.cell.tasks.peg_insertion.task import PegInsertion
from samrl_core.cell.tasks.spatula_flipping.task import SpatulaFlipping
from samrl_core.cell.tasks.task import Task

HARD = "_hard"  # ends the names of the variants
# Fingers hold by friction: at 70 N (Franka Hand, continuous force) and a coefficient of 0.3 on both sides
# what they hold slips at 2 x 0.3 x 70 N.
SLIP_FORCE = 42.0  # [N]
# A coated pan wants a turner of nylon. A blade of 30 x 2 mm, held 90 mm from its edge, bends for good at
# s w t^2 / (6 l), which is 10 N where PA 6 yields that is used in a kitchen, moist: at 45 MPa.
BENDING_FORCE = 10.0  # [N]


def hard() -> tuple[Task, ...]:
    """One variant of each task."""
    return _peg(), _flipping(), _threading()


def _peg() -> Task:
    """A radial clearance of 0.2 to 0.5 mm, and a block that leans.

    A vertical peg and a hole of depth d agree within 2 c / d, 2 deg at 0.35 mm and 20 mm; beyond that the peg
    jams and the arm has to give way: an expert presses with 75 N at 3 deg about both axes.
    """
    task = PegInsertion(
        clearance=0.00035,
        fits=(0.0002, 0.0005),
        tilt=math.radians(1.5),
        turn=math.radians(15.0),
        force_limit=SLIP_FORCE,
        max_actions=45,
        usual_policy="touch",
    )
    return replace(task, name=task.name + HARD, variant_of=task.name)


def _flipping() -> Task:
    """Anywhere within 5 cm, 80 or 100 mm across, a blade too narrow to turn over what it misses, on a plate
    whose height nobody has told: an edge that is 1 mm too low bends, and one that is 3 mm too high pushes a
    pancake against the lip until it bends, too.
    """
    task = SpatulaFlipping(
        center_x=0.495,
        half_range=(0.025, 0.025),
        small_radius=0.040,
        blade_width=0.030,
        aside=0.018,
        turn_aside=0.010,
        done_height=0.040,  # on a plate that is too high, and shown too high
        beyond=0.005,
        surface_deviation=0.0029,
        shaken=True,
        upright=(1.2, 1.4),
        usual_policy="touch",
        force_limit=BENDING_FORCE,
        max_actions=56,
    )
    return replace(task, name=task.name + HARD, variant_of=task.name)


def _threading() -> Task:
    """A thread of 1.5 mm radius for an eye of 3 to 4 mm, which stands anywhere within 2 cm.

    Where the needle stands, how long the thread is and how far the camera shows both beside their places is
    estimated. A height is known to some millimetres, so that the goal is as much deeper than success needs.
    """
    task = NeedleThreading(
        thread_radius=0.0015,
        eye_radius=0.0035,
        eyes=(0.0030, 0.0040),
        eye_thickness=0.003,
        post_range=0.010,
        softness=3.0,
        usual_policy="optimised",
        length_range=0.20,
        done_margin=0.005,
        fine_step=0.0045,
        force_limit=1.0,
        max_actions=27,
    )
    return replace(task, name=task.name + HARD, variant_of=task.name)
