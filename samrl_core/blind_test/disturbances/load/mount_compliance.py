"""27. A compliant stand. T0: it rocks about two axes on linear springs. T1: it also sways; springs harden."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.arm_body import ArmBody, MovingLink
from samrl_core.blind_test.engines.hooks import Hooks, MountSpring
from samrl_core.cell.types.pose import Pose

_AXES = np.eye(3)


def _make(site: Site, form: str, severity: float) -> Injection:
    # 30 Hz down to 4 Hz: the period is what grows.
    period = quantile(severity, 1 / 30.0, 1 / 4.0) if severity > 0 else 1 / 300.0
    w = 2 * np.pi / max(period, 1 / 300.0)
    damping_ratio = float(site.rng.uniform(0.03, 0.08))
    home = site.spec.home

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        def stand(body: ArmBody) -> ArmBody:
            inertia = body.inertia_about_base(home)
            base = Pose.identity()
            names = ("rock_x", "rock_y") if form == "T0" else ("sway_x", "sway_y", "rock_x", "rock_y")
            links, springs = [], []
            for name in names:
                axis = "xy".index(name[-1])
                slides = name.startswith("sway")
                own = 4.0 if name == names[-1] else 0.5  # [kg], the last one is the plate under the arm
                links.append(
                    MovingLink(
                        f"mount_{name}",
                        f"mount_{name}",
                        base,
                        _AXES[axis],
                        own,
                        np.zeros(3),
                        0.02 * np.eye(3),
                        slides,
                    )
                )
                carried = body.mass + 5.0 if slides else float(inertia[axis, axis]) + 0.05
                # Sway is kept stiffer than rocking, as on legs that bend little and tilt more (ASSUMPTION).
                k = carried * (w * (1.5 if slides else 1.0)) ** 2
                d = 2.0 * damping_ratio * np.sqrt(k * carried)
                springs.append(MountSpring(float(k), float(d), 0.0 if form == "T0" else 2e3))
            hooks.mount.extend(springs)
            return replace(body, links=(*links, *body.links), mount_joints=len(links))

        hooks.body.append(stand)

    named = {"frequency": Quantity(w / 2 / np.pi, "Hz"), "damping": Quantity(damping_ratio, "1")}
    return Injection(named, attach)


DISTURBANCE = Disturbance("mount_compliance", "arm", _make, shows_in="link")
