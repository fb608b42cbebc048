"""How noise is spread over frequency, and the filter that makes it white.

Accelerations are differences: the power of a velocity's white noise rises with the square of frequency, that
of a position's with the fourth. On a light machine this noise is larger than every torque, yet nearly all
of it lies at the upper edge of the band, the motion at the lower. A likelihood that spreads it evenly is
blind there and hears patterns in the noise instead. Residuals and regressors therefore pass the same filter,
after which noise of unit variance is white within the band (generalised least squares; Aitken 1936).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CORNER_HZ = 2.0  # below it noise counts as white: what models leave there is no noise, and no floor knows it
LEAST_RISING = 0.1  # of the variance: less changes nothing
PADDED_S = 1.0  # of reflection at both ends


@dataclass(frozen=True, eq=False)
class NoiseColor:
    """Of the residuals of one channel.

    Attributes:
        rising: (J,) share of the variance that rises with frequency, 0..1.
        order: of its power: 2 where velocities were differenced, 4 where positions were.
        band: [Hz] up to which there is noise at all.
        dt: spacing of samples [s].
    """

    rising: np.ndarray
    order: int
    band: float
    dt: float

    def whitened(self, rows: np.ndarray, joint: int) -> np.ndarray:
        """Rows (..., n) of a joint, as they come out of the whitening filter."""
        return self._filtered(rows, joint, -0.5)

    def colored(self, rows: np.ndarray, joint: int) -> np.ndarray:
        """The reverse of `whitened`."""
        return self._filtered(rows, joint, 0.5)

    def density(self, frequency: np.ndarray, joint: int) -> np.ndarray:
        """Power of noise at frequencies [Hz] over its mean within the band."""
        share = float(self.rising[joint])
        inside = np.clip(frequency, min(CORNER_HZ, self.band), self.band) / self.band
        return (1.0 - share) + share * (self.order + 1) * inside**self.order

    @property
    def raised(self) -> np.ndarray:
        """Factor (J,) by which the whitening filter raises what is slow."""
        joints = range(len(self.rising))
        slow = [float(self.density(np.zeros(1), j)[0]) for j in joints]
        return np.where(self.rising < LEAST_RISING, 1.0, 1.0 / np.sqrt(slow))

    def _filtered(self, rows: np.ndarray, joint: int, power: float) -> np.ndarray:
        if self.rising[joint] < LEAST_RISING:
            return rows
        count = rows.shape[-1]
        pad = min(count - 1, round(PADDED_S / self.dt))
        wide = np.concatenate([rows[..., pad:0:-1], rows, rows[..., -2 : -pad - 2 : -1]], axis=-1)
        gain = self.density(np.fft.rfftfreq(wide.shape[-1], self.dt), joint) ** power
        return np.fft.irfft(np.fft.rfft(wide, axis=-1) * gain, wide.shape[-1], axis=-1)[
            ..., pad : pad + count
        ]
