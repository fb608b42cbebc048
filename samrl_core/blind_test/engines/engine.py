"""What a physics engine must do for a sealed world: torque at the link side in, true state out."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np


class Engine(ABC):
    """Rigid-body dynamics of n = mount + arm joints: M a + h = effort, semi-implicit in velocity."""

    timestep: float  # [s]
    position: list[float]  # (n,) [rad or m]; a new list after every step
    velocity: list[float]  # (n,) [rad/s or m/s]

    @abstractmethod
    def place(self, position: np.ndarray) -> None:
        """Put all joints at `position` (n,), at rest."""

    @abstractmethod
    def gravity(self, vector: np.ndarray) -> None:
        """Gravity (3,) in the base frame from now on [m/s2]."""

    @abstractmethod
    def dynamics(self) -> tuple[np.ndarray, list[float]]:
        """Mass matrix (n, n) without rotors, and bias effort (n,) with gravity, at the present state.

        The matrix is the caller's own, in rows.
        """

    @abstractmethod
    def step(self, effort: list[float], rotor: list[float], acceleration: list[float]) -> list[float]:
        """Advance one time step.

        Args:
            effort: drive effort less friction (n,) [N m].
            rotor: inertia of rotors that turn rigidly with their joints (n,) [kg m2].
            acceleration: the step's expected acceleration (n,); engines with rotors of their own need it not.

        Returns:
            effort that passed from the rotors to the links, (n,).
        """

    @abstractmethod
    def close(self) -> None:
        """Free the engine."""
