"""What acts on bodies and is no effect of the library: it must not pass under another name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.diagnosis.effects.bodies.base_tilt import EFFECT
from samrl_core.diagnosis.effects.body_forms import OfMotion
from samrl_core.diagnosis.effects.form import Form, Place, Shape
from samrl_core.diagnosis.kinds.suspects import Suspect, explained, strongest
from samrl_core.diagnosis.residuals.bodies import columns
from samrl_core.diagnosis.residuals.bodies.body_trial import BodyTrial
from samrl_core.diagnosis.selection.hypothesis import PLAUSIBLE, Evidence, Fit

ROLLS = 3.0  # [nat] by which a body that rolls must explain more: one is rarer than a wrong coefficient
ROLLING = {"ball": 2 / 5, "cylinder": 1 / 2, "hollow ball": 2 / 3}  # inertia over mass and squared radius
ROLLING_SPREAD = 0.01  # of the share of its weight's pull that turns it
RESISTANCE = 0.005  # of rolling: coefficients of hard bodies are below 0.01
PATTERN = 80.0  # [nat] beyond noise and tolerances, of which something is there whatever it is
SLOW = 6.0  # samples that count as one there: whatever lasts as long as a motion is none of the noise
MOST_TILT = EFFECT.parameters[0].high  # [rad]
MUCH_OFF = 0.15  # of its size, that a pull may be off by and still be gravity
LEAST_OF_FLIGHT = 8  # poses
SPREAD = 0.1  # of a suspect's size before any data, in the units of its column


class BodySuspect(Suspect[BodyTrial]):
    """Forces of `BodyTrial.suspects`."""

    acts_on = "contact"

    def forms(self, trial: BodyTrial, place: Place) -> tuple[Form[BodyTrial], ...]:
        out = []
        for name, found in trial.suspects.items():
            freedom = max(len(rows) for rows in found.values())
            out.append(
                OfMotion(
                    name=name, place=place, amplitudes=tuple("abc"[:freedom]),
                    of=lambda t, name=name: t.suspects.get(name, {}), spreads=(SPREAD,) * freedom,
                )
            )  # fmt: skip
        return tuple(out)


@dataclass(frozen=True, eq=False, kw_only=True)
class Rolling(OfMotion):
    """A body that turns as it goes down: a share k / (1 + k) of the pull is missing, and its friction."""

    shapes: tuple[Shape, ...] = tuple({"k": k} for k in ROLLING.values())

    def prior(self, trial: BodyTrial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        share = shape["k"] / (1.0 + shape["k"])
        return np.array([share, -trial.constants.friction]), np.array([ROLLING_SPREAD, RESISTANCE])


class RollingSuspect(Suspect[BodyTrial]):
    """What nobody stated to roll, on an incline."""

    acts_on = "contact"

    def forms(self, trial: BodyTrial, place: Place) -> tuple[Form[BodyTrial], ...]:
        if not columns.may_roll(trial):
            return ()
        return (
            Rolling(
                name="a body that rolls", place=place, amplitudes=("k", "mu"), of=columns.unstated_rolling,
                spreads=(1.0, 1.0),
            ),
        )  # fmt: skip


def seen_pull(trial: BodyTrial) -> np.ndarray | None:
    """Mean acceleration (3,) [m/s^2] of the flights of a track of all three axes; None where none is seen.

    Each flight by a parabola; long ones count as much more as they tell.
    """
    if trial.recording.track.axes != "xyz":
        return None
    flights = [s for s in trial.segments if not s.slides and len(s) >= LEAST_OF_FLIGHT]
    weight = np.array([len(s) * (s.time[-1] - s.time[0]) ** 4 for s in flights])
    if not flights or not weight.any():
        return None
    pulls = [2.0 * np.polyfit(s.time - np.mean(s.time), s.position, 2)[0] for s in flights]
    return np.average(pulls, axis=0, weights=weight)


def leaning_gravity(trials: Sequence[BodyTrial]) -> list[str]:
    """A pull of the stated size from a direction beyond what a tilt is looked for in, in words."""
    pulls = [pull for trial in trials if (pull := seen_pull(trial)) is not None]
    if not pulls:
        return []
    pull, stated = np.median(pulls, axis=0), np.asarray(trials[0].recording.gravity, dtype=float)
    size, whole = float(np.linalg.norm(pull)), float(np.linalg.norm(stated))
    lean = float(np.arccos(np.clip(pull @ stated / max(size * whole, 1e-9), -1.0, 1.0)))
    if lean < PLAUSIBLE * MOST_TILT or abs(size / whole - 1.0) > MUCH_OFF:
        return []
    fitted = ", ".join(f"{x:.3g}" for x in whole * pull / size)
    return [
        f"gravity leans by {np.degrees(lean):.1f} degrees: state `gravity: [{fitted}]` if the track's frame"
        f" does so; a tilt is looked for up to {np.degrees(PLAUSIBLE * MOST_TILT):.0f} degrees"
    ]


def suspicions(evidence: Evidence, chosen: Fit | None, least: float) -> list[str]:
    """Suspects that explain the recordings better than what was chosen, or than nothing, in words."""
    trial = evidence.likelihood.trials[0]
    assert isinstance(trial, BodyTrial)
    if leans := leaning_gravity([t for t in evidence.likelihood.trials if isinstance(t, BodyTrial)]):
        return leans
    found = explained(evidence, BodySuspect(), trial)
    rolls = explained(evidence, RollingSuspect(), trial)
    best = max((gain for gain, _ in rolls), default=-np.inf)
    if chosen is not None and best > chosen.log_evidence + ROLLS:
        return [
            f"a body that rolls explains {best:.0f} of log evidence, what can be named"
            f" {chosen.log_evidence:.0f}: state its shape, and `rolls: true` if it rolls, `box` if it cannot"
        ]
    found += rolls
    if chosen is None:
        excess = evidence.likelihood.deficit(evidence.likelihood.y, SLOW)
        if excess > PATTERN:
            found.append((excess, "something that is no effect"))
    return strongest(found, chosen, least, "")
