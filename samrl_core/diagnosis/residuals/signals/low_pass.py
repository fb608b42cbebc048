"""The low-pass that a driver put before a reading, told by the colour of the reading's noise.

A drive that reports its current filtered, as for display, leaves little noise at high frequencies and all of
it where motions are, and is late by the filter's time constant. Taken for white, such noise looks many times
smaller than it is, and all that lies in it like a cause.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.diagnosis.residuals.signals.spectrum import detrended_spectrum

BLOCK = 128  # samples of a spectrum; what happens in fewer than half of the blocks is not in their median
LEAST_BLOCKS = 8
ABOVE = 1.5  # times the band, from where on there is noise and no motion
LOWEST = 0.04  # of the rate: frequencies that are compared, up to
HIGHEST = 0.35  # beyond which what a driver's own sampling folded back matters
LEAST_BINS = 12  # frequencies, to tell a slope
CORNERS = np.geomspace(0.2, 0.004, 80)  # of a filter, as shares of the rate
EXPLAINED = 0.25  # of the variance of the logarithm of the spectrum that a filter may leave
FITS = 0.05  # of it in all: another spectrum is not such a filter's
UNSURE = 4.0  # of the misfit's fall in chi-square, within which a weaker filter may be the true one


Gain = Callable[[np.ndarray, np.ndarray], np.ndarray]  # corners (K, 1), shares of the rate (n,) -> power


@dataclass(frozen=True)
class Form:
    """A kind of filter: how it delays what is slow, times 2 pi its corner, and what power it leaves."""

    delay: float
    gain: Gain


def _one_pole(corner: np.ndarray, share: np.ndarray) -> np.ndarray:
    """y[k] = pole y[k-1] + (1 - pole) x[k]."""
    pole = np.exp(-2.0 * np.pi * corner)
    return (1.0 - pole) ** 2 / (1.0 + pole**2 - 2.0 * pole * np.cos(2.0 * np.pi * share))


def _bilinear(order: int) -> Gain:
    """Butterworth's at the log's own rate."""
    return lambda corner, share: 1.0 / (1.0 + (np.tan(np.pi * share) / np.tan(np.pi * corner)) ** (2 * order))


def _faster(order: int) -> Gain:
    """Butterworth's in a driver that is much faster than the log."""
    return lambda corner, share: 1.0 / (1.0 + (share / corner) ** (2 * order))


SECOND = float(np.sqrt(2.0))  # delay of Butterworth's second order
FORMS = (
    Form(1.0, _one_pole),
    Form(1.0, _bilinear(1)),
    Form(SECOND, _bilinear(2)),
    Form(SECOND, _faster(2)),
)


def _both_ways(order: int) -> Gain:
    """Butterworth's forwards and backwards at a faster rate: no delay, twice the order."""
    return lambda corner, share: _faster(order)(corner, share) ** 2


# What those who publish a log filter it by before they thin it out: at a quarter of the rate it is left with,
# where neither white noise nor motion stands alone (SARCOS' matrices are of that kind).
OFFLINE = tuple(Form(0.0, _both_ways(order)) for order in (2, 3, 4))
OFFLINE_CORNERS = np.geomspace(0.35, 0.01, 100)
OFFLINE_ABOVE = (1.0, 1.25, 1.5)  # times the band, the first from where on the spectrum is such a filter's
OFFLINE_HIGHEST = 0.48
SCATTER = 2.1  # variance of the logarithm of a median over blocks, times their number


@dataclass(frozen=True)
class LowPass:
    """A low-pass of a log, the weakest that noise speaks for.

    Attributes:
        form: None: there is no filter.
        corner: frequency of half the power, as a share of the rate.
        rate: of the log [Hz].
        band: up to which motions are compared [Hz].
    """

    form: Form | None
    corner: float
    rate: float
    band: float
    begins: float = 0.0  # share of the rate from which on, and up to which, the spectrum is the filter's
    ends: float = HIGHEST

    @property
    def lag_s(self) -> float:
        """By how much it delays what is slow [s]."""
        return 0.0 if self.form is None else self.form.delay / (2.0 * np.pi * self.corner * self.rate)

    def noise(self, x: np.ndarray) -> np.ndarray:
        """Deviation (J,) of white noise that has as much power within the band as that of readings (F, J)."""
        assert self.form is not None
        share, power = _spectra(x, self.rate, self.begins, self.ends)
        corner = np.array([[self.corner]])
        behind = np.log(self.form.gain(corner, share)[0])
        level = np.exp(np.mean(np.log(np.maximum(power, 1e-300)) - behind[:, None], axis=0))
        level *= np.mean(self.form.gain(corner, np.linspace(0.0, self.band / self.rate, 64)))
        return np.asarray(np.sqrt(level * self.rate / 2.0))


def find_low_pass(x: np.ndarray | None, rate: float, band: float) -> LowPass:
    """The filter behind which readings (F, J) were taken, by their noise above `band` [Hz].

    The spectrum's logarithm against a filter's, each joint with a level of its own. It is a median over short
    blocks: steps of reversals have spectra of that kind too, and must not count.
    """
    none = LowPass(None, 0.0, rate, band)
    if x is None or len(x) < LEAST_BLOCKS * BLOCK:
        return none
    begins = max(ABOVE * band / rate, LOWEST)
    best = _best_form(*_spectra(x, rate, begins, HIGHEST), FORMS, CORNERS)
    if best is None or best.least > FITS or best.least > EXPLAINED * best.white:
        return none
    weakest = float(CORNERS[best.misfit < best.least * (1.0 + UNSURE / best.size)][0])
    if weakest * rate < band:
        return none  # a motion that reverses all the time: no driver hides what an arm does
    return LowPass(best.form, weakest, rate, band, begins)


def find_any_filter(x: np.ndarray | None, rate: float, band: float) -> LowPass:
    """The driver's filter, or else the one that a log passed before it was published."""
    found = find_low_pass(x, rate, band)
    return found if found.form is not None else find_offline_filter(x, rate, band)


def find_offline_filter(x: np.ndarray | None, rate: float, band: float) -> LowPass:
    """The filter forwards and backwards that readings (F, J) passed before they were published.

    As `find_low_pass`, up to the log's last frequencies; motion may reach beyond the band, so that the lowest
    frequency from which on the spectrum is that of such a filter is sought too.
    """
    none = LowPass(None, 0.0, rate, band)
    if x is None or len(x) < LEAST_BLOCKS * BLOCK:
        return none
    blocks = 2 * len(x) // BLOCK - 1
    share, power = _spectra(x, rate, min(OFFLINE_ABOVE) * band / rate, OFFLINE_HIGHEST)
    for times in OFFLINE_ABOVE:
        begins = times * band / rate
        best = _best_form(share[share > begins], power[share > begins], OFFLINE, OFFLINE_CORNERS)
        if best is None:
            return none
        corner = float(OFFLINE_CORNERS[int(np.argmin(best.misfit))])
        fits = best.least < FITS + SCATTER / blocks and best.least < EXPLAINED * best.white
        if fits and corner * rate >= band:
            return LowPass(best.form, corner, rate, band, begins, OFFLINE_HIGHEST)
    return none


@dataclass(frozen=True, eq=False)
class _BestForm:
    """The form whose logarithm of the spectrum is nearest to a log's."""

    form: Form
    misfit: np.ndarray  # mean square at each corner
    white: float  # that of no filter at all
    size: int  # numbers of the spectrum

    @property
    def least(self) -> float:
        return float(self.misfit.min())


def _best_form(
    share: np.ndarray, power: np.ndarray, forms: Sequence[Form], corners: np.ndarray
) -> _BestForm | None:
    """The best of forms at corners (K,) for spectra (B, J) at shares (B,) of the rate; None of too few."""
    tells = np.min(power, axis=0, initial=np.inf) > 0.0
    if len(share) < LEAST_BINS or not tells.any():
        return None
    seen = np.log(power[:, tells])
    fits = []
    for form in forms:
        off = seen - np.log(form.gain(corners[:, None], share))[:, :, None]
        fits.append(np.mean((off - off.mean(axis=1, keepdims=True)) ** 2, axis=(1, 2)))
    form, misfit = min(zip(forms, fits, strict=True), key=lambda fit: float(fit[1].min()))
    return _BestForm(form, misfit, float(np.mean((seen - seen.mean(axis=0)) ** 2)), seen.size)


def _spectra(x: np.ndarray, rate: float, begins: float, ends: float) -> tuple[np.ndarray, np.ndarray]:
    """Shares (bins,) of the rate where there is noise alone, and its power (bins, J) per hertz."""
    frequency, power = detrended_spectrum(x, rate, BLOCK, by_median=True)
    share = frequency / rate
    noise = (share > begins) & (share < ends)
    return share[noise], power[noise]
