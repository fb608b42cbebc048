"""What likelihood, selection and report need of one recording, whatever it recorded.

Every kind of recording is brought to the same form: residuals that are zero but for noise where nominal model
and reality agree, in channels (a torque, a direction of a pose error), for one or more places (a joint, a
camera). Effects and tolerances are columns of these residuals.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from samrl_core.diagnosis.residuals.signals.noise_color import NoiseColor


class Observed(ABC):
    """A recording with its residuals. Rows of a channel are its places, samples have times."""

    kind: ClassVar[str]  # of recording: arm, poses, ...
    # Effects are geometry, not formulas: who explains as much is not told apart.
    exact: ClassVar[bool] = False
    short: ClassVar[bool] = False  # many blocks of few samples: what noise alone exceeds in them adds up
    unsure: ClassVar[float] = 0.0  # share of the noise's energy, by which its level may be off
    tiles_along_side: ClassVar[int] = 0  # of an image's square of tiles; 0 of what is no image
    channels: tuple[str, ...]
    cached: dict[tuple[str, str], Any]  # what a form works out once per recording

    @property
    @abstractmethod
    def name(self) -> str:
        """Of the recording, as shown."""

    @property
    @abstractmethod
    def places(self) -> tuple[str, ...]:
        """Places of the contract, one per row of every channel."""

    @property
    @abstractmethod
    def units(self) -> Mapping[str, str]:
        """Unit of each channel."""

    @property
    @abstractmethod
    def residual(self) -> Mapping[str, np.ndarray]:
        """Per channel (N, R) in its unit; channels may differ in N."""

    @property
    @abstractmethod
    def sigma(self) -> Mapping[str, np.ndarray]:
        """Noise and floors, like `residual`."""

    @property
    def color(self) -> Mapping[str, NoiseColor]:
        """Spectrum of the noise of channels whose noise is not white."""
        return {}

    @property
    @abstractmethod
    def duration(self) -> float:
        """Length [s]."""

    @abstractmethod
    def elapsed(self, channel: str) -> np.ndarray:
        """Times (N,) of a channel's samples since the recording began [s]."""

    @abstractmethod
    def phases(self, channel: str) -> np.ndarray:
        """Index into `result.PHASES` (N, R) of each sample."""

    @abstractmethod
    def drivers(self, channel: str, row: int) -> dict[str, np.ndarray]:
        """Quantities (N,) that a remainder may follow, by name: hints for the eye."""

    @abstractmethod
    def names_of(self, kind: str) -> tuple[str, ...]:
        """Places of a kind (joint, link, arm, sensor, body, cell) at which something of it may act."""

    def rows_at(self, place: str) -> tuple[int, ...]:
        """Rows of a place: its own, or all where it has none of its own."""
        return (self.places.index(place),) if place in self.places else tuple(range(len(self.places)))

    def tiles_of(self, channel: str) -> np.ndarray | None:
        """Index (N,) of each sample's tile of the image, row by row of a square; None of what is no image."""
        return None

    def spacing(self, channel: str) -> float:
        """Typical time between samples of a channel [s]."""
        times = self.elapsed(channel)
        return float(np.median(np.diff(times))) if len(times) > 1 else 1.0
