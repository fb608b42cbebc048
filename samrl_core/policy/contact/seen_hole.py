"""Where a hole lies from the held peg, by the colours of the images from one view."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from samrl_core.cell.tasks.peg_insertion.board import TOP_COLOR
from samrl_core.cell.tasks.peg_insertion.task import PegInsertion
from samrl_core.cell.tasks.peg_insertion.tool import PEG_COLOR
from samrl_core.cell.types.observation import Observation
from samrl_core.model.real2sim.hole_sight import HoleSight, PegColours, on_plane, sight_of

_NEWEST = 9  # peg's ends of which the middle counts: the nearer to the hole, the better they are
_FEWEST = 2  # ends below which nothing is said
_ENOUGH = 3  # ends from which on another image adds little
_COMMON = 0.3  # share of an image's variance that the next one from the same view has in common


@dataclass(frozen=True)
class SeenHole:
    """Sights from one view, the newest last, and the tip (3,) by the encoders at each [m]."""

    sights: tuple[HoleSight, ...] = ()
    tips: tuple[np.ndarray, ...] = field(default=())

    def with_image(
        self,
        task: PegInsertion,
        observation: Observation,
        mouth: np.ndarray,
        end: np.ndarray,
        tip: np.ndarray,
    ) -> SeenHole:
        """After another image from the same view.

        Args:
            task: whose peg and block.
            observation: the image.
            mouth: (3,) and
            end: (3,) of the peg, where they are believed in world [m].
            tip: (3,) by the encoders [m].
        """
        labels, radii = (task.tool_label, task.board_label), (task.peg_radius, task.hole_radius)
        sight = sight_of(observation, labels, PegColours(PEG_COLOR, TOP_COLOR), mouth, end, radii)
        return SeenHole((*self.sights, sight), (*self.tips, tip))

    @property
    def clear(self) -> bool:
        """Whether they tell a place."""
        return len(self._holes) > 0 and len(self._ends) >= _FEWEST

    @property
    def enough(self) -> bool:
        """Whether more images from there would add little."""
        return self.clear and len(self._ends) >= _ENOUGH

    def place(self, height: float, face: float) -> np.ndarray:
        """Middle of the mouth (2,) by the encoders of the tip [m].

        Args:
            height: of the mouth in world, as drawn [m].
            face: the same by the encoders of the tip [m].
        """
        # An arm that holds a camera creeps by millimetres, as its encoders tell: a hole stays, its pixel not.
        hole = np.median([on_plane(one.camera, one.hole, height) for one in self._holes], axis=0)
        found = [
            tip[:2] + hole - on_plane(sight.camera, sight.end, height + float(tip[2]) - face)
            for sight, tip in self._ends[-_NEWEST:]
        ]
        return np.median(found, axis=0)

    def covariance(self, height: float, pixels: float, face_deviation: float) -> np.ndarray:
        """Of `place` (2, 2) [m2], from `pixels` [px] of one image and from the face's height [m]."""
        count = min(len(self._ends), _NEWEST)
        size = pixels * float(np.sqrt(_COMMON + (1.0 - _COMMON) / count))
        return self._ends[-1][0].covariance(height, size, face_deviation)

    @property
    def _holes(self) -> list[HoleSight]:
        return [sight for sight in self.sights if np.isfinite(sight.hole).all()]

    @property
    def _ends(self) -> list[tuple[HoleSight, np.ndarray]]:
        both = zip(self.sights, self.tips, strict=True)
        return [(sight, tip) for sight, tip in both if np.isfinite(sight.end).all()]
