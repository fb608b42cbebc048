"""A verdict with its reasons, and the numbers by which it is taken."""

from __future__ import annotations

from dataclasses import dataclass

from samrl_core.diagnosis.selection.on_held_out import SHOWN


@dataclass(frozen=True)
class VerdictSettings:
    """When to name, and when to refuse. Its numbers come from calibration worlds, never from test worlds."""

    unexplained: float = 0.4  # share of the excess that may remain on fitted recordings
    held_out_unexplained: float = 0.65  # likewise on held-out ones, where parameters were not fitted
    shown: float = SHOWN  # [nat] that a prediction must be worth on held-out recordings before they deny it
    visible: float = 25.0  # [nat] excess below which shares say nothing
    worse: float = -0.1  # shrink below which the named effect contradicts held-out recordings
    tie: float = 0.6  # a probability below it is no name
    rival: float = 0.15  # a rival's probability from which on it belongs to the ambiguity set
    share: float = 0.5  # likewise of the first one's, where that itself is improbable
    dominant: float = 0.3  # simulated shrink from which on an effect stands although much stays unexplained
    surely: float = 0.15  # lower end of that shrink's interval, likewise
    margin: float = 0.03  # shrink beyond the runner-up's, likewise
    sizes: tuple[float, float] = (0.7, 1.4)  # of the fitted effect that simulation may prefer, likewise
    limits: float = 0.25  # simulated shrink below which a limit of the drive is none
    clearly: float = 8.0  # times the threshold, from which on a formula may be seen to explain
    twice: float = 2.0  # times the threshold, up to which a refused effect is no gap where nothing else is
    closer: float = 0.3  # shrink by which a runner-up must do better to be as likely as what is named
    seen: float = 3.0  # simulated gap, in tolerances, from which on held-out motion differs for sure
    all: float = 0.02  # all but this share, on fitted and on held-out recordings
    hardly: float = 0.9  # share of the excess left beyond which it must shrink by `half`
    half: float = 0.5
    noticed: float = 0.05  # simulated shrink below which unseen recordings do not show an effect
    no_gap: float = 250.0  # [nat] excess without any effect above threshold that still counts as no gap
    excited: float = 0.01  # of the evidence, that held-out recordings must be able to show to confirm it


@dataclass(frozen=True)
class Decision:
    """Verdict, why, rivals that are tied, and what is left when nothing was chosen."""

    verdict: str
    reasons: tuple[str, ...]
    tied: tuple[str, ...] = ()
    unexplained: float = 0.0
    contradicted: bool = False  # held-out recordings are worse off with what was found
