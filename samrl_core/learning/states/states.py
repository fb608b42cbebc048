"""Labelled states to learn from: what a picture would show, where everything is, and what to do there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from samrl_core.common.errors import InputError


@dataclass(frozen=True, eq=False)
class StateSamples:
    """N states of one task, each with the optimiser's first action.

    Raises:
        InputError: fields of different lengths, wrong shapes, or a value that is not finite.
    """

    values: np.ndarray  # (N, P) in the order of `Task.parameters`
    tip_in_base: np.ndarray  # (N, 3) tool tip in the tool arm's base frame [m]
    tool_arm_position: np.ndarray  # (N, J) joints that put it there [rad]
    frames: np.ndarray  # (N, F, 12) float32, of `SceneFrames`: rotation by rows, position in world [m]
    action: np.ndarray  # (N, 3) the optimiser's first action [m]
    sub_goal: np.ndarray  # (N,) str, which one it heads for
    solved: np.ndarray  # (N,) bool, whether the model reaches it

    def __post_init__(self) -> None:
        count = len(self.values)
        shapes = {f.name: np.shape(getattr(self, f.name)) for f in fields(self)}
        tails = {"tip_in_base": (3,), "action": (3,), "sub_goal": (), "solved": ()}
        wrong = [
            name
            for name, shape in shapes.items()
            if shape[:1] != (count,) or (name in tails and shape[1:] != tails[name])
        ]
        if wrong or len(shapes["frames"]) != 3 or shapes["frames"][2] != 12:
            raise InputError(
                f"labelled states have shapes {shapes}; {wrong or ['frames']} do not fit {count}"
            )
        for name in ("values", "tip_in_base", "tool_arm_position", "frames", "action"):
            if not np.isfinite(getattr(self, name)).all():
                raise InputError(f"{name} of labelled states is not finite; sample them again")

    def __len__(self) -> int:
        return len(self.values)

    def arrays(self) -> dict[str, np.ndarray]:
        """All fields by name, as a shard stores them."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def rows(self, which: np.ndarray | slice) -> StateSamples:
        """Some of the states."""
        return StateSamples(**{name: array[which] for name, array in self.arrays().items()})

    @staticmethod
    def from_arrays(arrays: dict[str, np.ndarray]) -> StateSamples:
        """The inverse of `arrays`.

        Raises:
            InputError: fields are missing or unknown, or do not fit.
        """
        names = {f.name for f in fields(StateSamples)}
        if set(arrays) != names:
            raise InputError(f"a shard of states holds {sorted(arrays)}, must hold {sorted(names)}")
        return StateSamples(**arrays)

    @staticmethod
    def joined(parts: Sequence[StateSamples]) -> StateSamples:
        """All states of several samples, in order."""
        if not parts:
            raise InputError("no labelled states to join; a shard is missing")
        every = [part.arrays() for part in parts]
        return StateSamples(**{name: np.concatenate([one[name] for one in every]) for name in every[0]})
