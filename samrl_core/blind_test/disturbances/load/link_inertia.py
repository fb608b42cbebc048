"""25. Link with another mass than described.

T0: mass, centre and inertia off. T1: a forgotten part bolted to one side of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.arm_body import ArmBody, join_mass, scaled_inertia
from samrl_core.blind_test.engines.hooks import Hooks
from samrl_core.cell.types.pose import Pose


def _make(site: Site, form: str, severity: float) -> Injection:
    # The catalogue guesses 1-5 %, hardly beyond the stated tolerances: here from twice them to ten times.
    way = site.sign()
    share = way * quantile(severity, 0.04, 0.2)
    shift = quantile(severity, 0.004, 0.02)
    direction = site.rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    part = quantile(severity, 0.1, 0.8)  # [kg]

    def alter(body: ArmBody) -> ArmBody:
        at = body.mount_joints + site.joint
        link = body.links[at]
        if form == "T0":
            factor = (1.0 + share) * np.ones(3)
            link = replace(
                link,
                mass=link.mass * (1.0 + share),
                center_of_mass=link.center_of_mass + shift * direction,
                inertia=scaled_inertia(link.inertia, factor),
            )
        elif part > 0:
            place = link.center_of_mass + 0.08 * direction
            link = join_mass(link, part, place, 5e-4 * part * np.eye(3), Pose.identity())
        return replace(body, links=(*body.links[:at], link, *body.links[at + 1 :]))

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.body.append(alter)

    if form == "T1":
        return Injection({"part_mass": Quantity(part, "kg"), "part_distance": Quantity(0.08, "m")}, attach)
    axes = zip(("cx", "cy", "cz"), (shift * direction).tolist(), strict=True)
    moved = {name: Quantity(value, "m") for name, value in axes}
    return Injection({"mass_error": Quantity(share, "1"), **moved}, attach)


DISTURBANCE = Disturbance("link_inertia", "link", _make, shows_in="link", first_joint=1)
