"""What an insertion leaves for the next episode of its cell: how far images and encoders were wrong.

Once the peg is in, the encoders say where the hole is, to its clearance. What the images said before
differs by errors of the lens, of masks and of the calibration, which stay. They depend on the view, so that
the memory fades with the camera's way, and a little on where the hole lies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from samrl_core.cell.types.pose import Pose


@dataclass(frozen=True)
class MemorySettings:
    """Standard deviations. `tests.policy.contact.gap_accuracy` measures what `unknown` rests on; it is stated
    wider than in typical cells, because nobody tells an agent that its cell is a worse one.
    """

    unknown: float = 0.0008  # of the images' error per axis, before any insertion and at another view [m]
    found: float = 0.0004  # of the hole's place by a peg in it [m]
    other_place: float = 0.0003  # of the error between two episodes with one view [m]
    way: float = 0.15  # camera's way after which half of a memory has faded [m]
    # Of the tip's height by the encoders over the mouth, before any touch, as in careless cells: a peg that
    # slipped in the hand by 1.5 mm, joints that are 2 mrad off [m].
    height: float = 0.002
    touched: float = 0.0003  # of the mouth's height by a touch [m]


@dataclass(frozen=True, eq=False)
class CellMemory:
    """Belief of what stays from episode to episode."""

    error: np.ndarray  # (2,) hole's place by images less that by the peg in it [m]
    variance: float  # of each axis [m2]
    camera: Pose | None  # where that was seen from; none before the first insertion
    height: float  # tip's height by the encoders less the true one [m]
    height_variance: float  # [m2]


def no_memory(settings: MemorySettings) -> CellMemory:
    """Of a cell where nothing was inserted yet."""
    return CellMemory(np.zeros(2), settings.unknown**2, None, 0.0, settings.height**2)


def at_view(memory: CellMemory, camera: Pose, settings: MemorySettings) -> tuple[np.ndarray, float]:
    """Error (2,) [m] that images from there are expected to have, and the variance of each axis [m2]."""
    if memory.camera is None:
        return memory.error, memory.variance
    way = float(np.linalg.norm(camera.position - memory.camera.position))
    kept = 0.5 ** (way / settings.way)
    return kept * memory.error, memory.variance + (1.0 - kept**2) * settings.unknown**2


def after_insertion(
    memory: CellMemory, camera: Pose, error: np.ndarray, settings: MemorySettings
) -> CellMemory:
    """Kalman's update by the error (2,) [m] that one insertion showed, then fading for the next episode."""
    mean, variance = at_view(memory, camera, settings)
    gain = variance / (variance + settings.found**2)
    left = (1.0 - gain) * variance + settings.other_place**2
    return replace(
        memory,
        error=mean + gain * (error - mean),
        variance=min(left, settings.unknown**2),
        camera=camera,
    )


def after_touch(memory: CellMemory, height_error: float, settings: MemorySettings) -> CellMemory:
    """The same for the height of the tip by the encoders, where it touched a face of known height [m]."""
    gain = memory.height_variance / (memory.height_variance + settings.touched**2)
    return replace(
        memory,
        height=memory.height + gain * (height_error - memory.height),
        height_variance=(1.0 - gain) * memory.height_variance,
    )
