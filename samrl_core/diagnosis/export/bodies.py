"""Bodies as simulators want them: mass, centre, inertia about it; from the ten parameters and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class RigidBody:
    """A rigid body in the axes of its frame."""

    mass: float  # [kg]
    center: np.ndarray  # (3,) [m]
    inertia: np.ndarray  # (3, 3) about the centre [kg m2]

    @property
    def possible(self) -> bool:
        """Whether matter can be so: a positive mass, moments that obey the triangle inequality."""
        moments = np.linalg.eigvalsh(self.inertia)
        return bool(self.mass > 0 and moments[0] > 0 and moments[0] + moments[1] >= moments[2] * (1 - 1e-9))


def ten_of(body: RigidBody) -> np.ndarray:
    """m, m c, then Ixx Ixy Iyy Ixz Iyz Izz about the frame's origin (Pinocchio's order)."""
    c = body.center
    about = body.inertia + body.mass * (c @ c * np.eye(3) - np.outer(c, c))
    return np.concatenate([[body.mass], body.mass * c, about[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])


def body_of(ten: np.ndarray) -> RigidBody:
    """The body of ten parameters; of no mass it has its centre at the origin."""
    mass = float(ten[0])
    center = ten[1:4] / mass if mass else np.zeros(3)
    about = np.array([[ten[4], ten[5], ten[7]], [ten[5], ten[6], ten[8]], [ten[7], ten[8], ten[9]]])
    return RigidBody(mass, center, about - mass * (center @ center * np.eye(3) - np.outer(center, center)))


def moved(ten: np.ndarray, to: np.ndarray) -> np.ndarray:
    """Ten parameters about another origin; the old one lies at `to` (3,) in the new frame of equal axes."""
    m, h = float(ten[0]), ten[1:4]
    about = np.array([[ten[4], ten[5], ten[7]], [ten[5], ten[6], ten[8]], [ten[7], ten[8], ten[9]]])
    about = about + 2 * (to @ h) * np.eye(3) - np.outer(to, h) - np.outer(h, to)
    about = about + m * (to @ to * np.eye(3) - np.outer(to, to))
    return np.concatenate([[m], h + m * to, about[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])
