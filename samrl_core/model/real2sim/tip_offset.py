"""Slow calibration: how far the tool's tip, as the camera sees it, lies from where the encoders have it.

Hand-eye, base-to-base, encoder zeros, the lens and how a part sits in the hand all move what the camera shows
of the tip, and of the goal beside it, by nearly the same. What an action needs is the difference of the two,
so the sum of all these errors at the tip is one vector of three numbers. It changes slowly: every image adds
to it, a camera that moved makes it uncertain again. A mask that is wider than what it shows would pass for a
part that is nearer, so that its growth is estimated along.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from samrl_core.cell.calibration.seen_error import SeenError
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.observation import Observation
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Tool
from samrl_core.model.real2sim.held_peg import HeldPeg, compared_pixels
from samrl_core.model.real2sim.information import ImageNoise, ViewInformation, newton_step, view_information


@dataclass(frozen=True)
class TipOffsetSettings:
    """Belief before the first image, and noise."""

    # Before the first image, standard deviation in x, y and z. The goal is found at its drawn height, so the
    # tip is taken to be as high as the encoders say: what tilts the camera then moves both alike.
    prior: tuple[float, float, float] = (0.005, 0.005, 0.001)  # [m]
    growth: float = 0.0008  # of masks all around, standard deviation, half a pixel or less [m]
    per_metre: float = 0.004  # it grows by this times the camera's way, standard deviation [m/m]
    per_radian: float = 0.003  # and by this times its turn [m/rad]
    # From one episode to the next: the arm stands elsewhere, the grip is the same, standard deviation [m].
    per_episode: float = 0.0005
    # A mask's boundary errs to one side over many pixels: one image's outline is good to a pixel and a half.
    # Depth has a bias of millimetres, and the goal's pose hardly rests on it: it counts for little.
    noise: ImageNoise = field(default_factory=lambda: ImageNoise(edge=1.5, shared_by=15.0, depth=0.03))
    half_span: float = 0.0012  # of the differences, half a pixel's worth [m]
    iterations: int = 8
    enough: float = 2e-5  # a step below ends the search [m]
    longest: float = 0.003  # step per axis [m]
    least_pixels: int = 30  # fewer of the peg say nothing

    def doubting(self, times: float) -> TipOffsetSettings:
        """The same for cells whose calibration is wrong by so many times as much."""
        x, y, z = self.prior
        return replace(
            self,
            prior=(times * x, times * y, times * z),
            per_metre=times * self.per_metre,
            per_radian=times * self.per_radian,
        )

    def beside(self, seen: SeenError) -> TipOffsetSettings:
        """The same where a correction of the cell is not known exactly; heights are the encoders' anyway."""
        x, y = np.hypot(self.prior[:2], np.sqrt(np.diag(seen.place)))
        return replace(
            self,
            prior=(float(x), float(y), self.prior[2]),
            per_metre=float(np.hypot(self.per_metre, seen.per_metre)),
            per_radian=float(np.hypot(self.per_radian, seen.per_radian)),
        )


@dataclass(frozen=True, eq=False)
class TipOffset:
    """Gaussian belief of the offset in world, and of the growth of masks."""

    mean: np.ndarray  # (4,) offset, growth [m]
    covariance: np.ndarray  # (4, 4) [m2]
    camera: Pose | None = None  # of the last image; none before the first
    images: int = 0  # that it rests on

    @property
    def offset(self) -> np.ndarray:
        """True tip less the encoders' (3,), as the camera sees both [m]."""
        return self.mean[:3]


class TipOffsetFit:
    """Corrects the belief by one image after the other."""

    def __init__(self, tool: Tool, cell: CellSpec, settings: TipOffsetSettings | None = None) -> None:
        """Raises:
        InputError: from `HeldPeg`.
        """
        self._peg, self._settings = HeldPeg(tool, cell), settings or TipOffsetSettings()

    def begin(self, before: TipOffset | None = None) -> TipOffset:
        """The belief before any image of an episode; `before` is that of the last one in the same cell."""
        s = self._settings
        if before is None:
            return TipOffset(np.zeros(4), np.diag(np.square([*s.prior, s.growth])))
        loose = self._loosened(before, s.per_episode**2)
        return TipOffset(loose.mean, loose.covariance, before.camera)

    def update(self, belief: TipOffset, observation: Observation, tip: np.ndarray) -> TipOffset:
        """The likeliest values by belief and image, with its covariance (Gauss-Newton on the posterior).

        Args:
            belief: before this image.
            observation: the image.
            tip: (3,) by the encoders, in world [m].
        """
        s = self._settings
        belief = self.carried(belief, observation.camera.camera_in_world)
        shown = compared_pixels(observation.camera, tip + belief.offset)
        real = self._peg.read(observation, shown)
        if int(real.mask.sum()) < s.least_pixels:
            return belief
        precision = np.linalg.inv(belief.covariance)
        encoders, mean = np.array([*tip, 0.0]), belief.mean.copy()
        view = self._linearise(observation.camera, encoders + mean, shown)
        for _ in range(s.iterations):
            step = newton_step(view, real, belief=(belief.mean - mean, precision))
            step = np.clip(step, -s.longest, s.longest)
            mean = mean + step
            view = self._linearise(observation.camera, encoders + mean, shown)
            if float(np.abs(step).max()) < s.enough:
                break
        covariance = np.linalg.inv(precision + view.matrix)
        return TipOffset(mean, 0.5 * (covariance + covariance.T), belief.camera, belief.images + 1)

    def carried(self, belief: TipOffset, camera: Pose) -> TipOffset:
        """The belief at another camera pose, where errors of the camera arm and the lens are others."""
        s, spread = self._settings, 0.0
        if belief.camera is not None:
            way = float(np.linalg.norm(camera.position - belief.camera.position))
            spread = (s.per_metre * way) ** 2 + (s.per_radian * camera.angle_to(belief.camera)) ** 2
        loose = self._loosened(belief, spread)
        return TipOffset(loose.mean, loose.covariance, camera, belief.images)

    def _loosened(self, belief: TipOffset, spread: float) -> TipOffset:
        """Wider by a variance [m2], never wider than before the first image, towards which it goes back.

        A process that forgets (Uhlenbeck and Ornstein 1930): a belief that is the prior stays so.
        """
        prior = np.square([*self._settings.prior, self._settings.growth])
        kept = np.sqrt(prior / (prior + np.array([spread, spread, spread, 0.0])))
        covariance = belief.covariance * np.outer(kept, kept) + np.diag(prior * (1.0 - kept**2))
        return TipOffset(belief.mean * kept, covariance)

    def _linearise(self, camera: Camera, peg: np.ndarray, shown: np.ndarray) -> ViewInformation:
        s = self._settings
        return view_information(
            lambda one: self._peg.images(one[None], camera, shown)[0],
            peg,
            np.full(4, s.half_span),
            s.noise,
            render_all=lambda many: self._peg.images(many, camera, shown),
        )
