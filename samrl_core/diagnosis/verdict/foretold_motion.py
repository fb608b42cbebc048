"""How much closer simulated motion would come on held-out recordings, were the named effect all there is.

A gap that does not shrink says one of two things. Where motion hangs on its start and on what tolerances
leave open, as a double pendulum's does, it would not shrink for the true effect either. Where it would, what
is named is not what moves the machine, or not at that size, however well it explains the torques. So machines
are simulated that differ from the nominal one by the named effect, and by tolerances and noise at random, and
the gap of nominal and named plant is measured on them as on the log (posterior predictive check: Rubin 1984,
Annals of Statistics 12; Gelman, Meng and Stern 1996, Statistica Sinica 6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.result import HeldOutGap
from samrl_core.diagnosis.selection.gap_metric import shrink
from samrl_core.diagnosis.selection.hypothesis import Fit
from samrl_core.diagnosis.selection.resimulation import (
    Resimulation,
    gap,
    over_time,
    plant_of,
    resimulable,
    resimulate,
    simulable,
)
from samrl_core.diagnosis.selection.tolerated_plant import sample_plant
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters

MACHINES = 40  # that are simulated
QUANTILES = 0.2, 0.5, 0.8
ADDED = (
    "torque_offset",
    "sensor_bias",
    "coulomb",
    "viscous",
    "rotor_inertia",
)  # fields that tolerances add to


@dataclass(frozen=True)
class ForetoldMotion:
    """What the simulated gap of held-out recordings would do, were the named effect all there is."""

    shrink: tuple[float, float, float]  # its 20 % quantile, median and 80 % quantile over simulated machines
    left: float  # gap that the named effect would leave on half of them at most, in the gap's unit

    def tells(self, least: float) -> bool:
        """Whether the gap of these recordings shrinks by so much where the effect is all there is."""
        return self.shrink[1] >= least

    def is_missed(self, gap: HeldOutGap, least: float) -> bool:
        """Whether the log's gap shrinks less than on 80 % of such machines, where it would by `least`."""
        return gap.shrink is not None and self.tells(least) and gap.shrink < self.shrink[0]

    def beyond(self, gap: HeldOutGap) -> float:
        """Share of the squared gap, 0..1, that is left beyond what such a machine would leave."""
        assert gap.with_effect is not None
        there = max(gap.nominal**2 - self.left**2, 1e-12)
        return float(np.clip((gap.with_effect**2 - self.left**2) / there, 0.0, 1.0))

    def __str__(self) -> str:
        """The interval in words."""
        return f"{self.shrink[0]:.0%} to {self.shrink[2]:.0%}"


def foretell_motion(
    held_out: Sequence[Observed], chosen: Fit, rng: np.random.Generator
) -> ForetoldMotion | None:
    """Simulate held-out recordings as machines with the chosen effects; None where one of them cannot be.

    Args:
        held_out: recordings that can be simulated.
        chosen: the named effects at their sizes.
        rng: draws machines and noise.
    """
    trials = [t for t in held_out if resimulable(t)]
    samples = [sample_plant(trials[0], rng) for _ in range(MACHINES)] if trials else []
    runs = []
    for trial in trials:
        if plant_of(trial, chosen) is None:
            return None
        stages = []
        for begin, plants in over_time(trial, {"with_effect": chosen}):
            named = plants["with_effect"]
            machines = {f"machine {k}": _beside(trial, named, s) for k, s in enumerate(samples)}
            stages.append((begin, {**plants, **machines}))
        off = {f"machine {k}": rng for k in range(len(samples))}
        runs.append(resimulate(trial, stages, off))
    found = []
    for k in range(len(samples)):
        as_log = [_as_measured(r, f"machine {k}", rng) for r in runs]
        pair = gap(as_log, "nominal"), gap(as_log, "with_effect")
        if np.isfinite(pair).all():
            found.append(pair)
    if len(found) < MACHINES / 2:
        return None
    shrinks = np.quantile([shrink(*pair) for pair in found], QUANTILES)
    low, middle, high = shrinks.tolist()
    return ForetoldMotion((low, middle, high), float(np.median([left for _, left in found])))


def _beside(trial: Trial, named: PlantParameters, sample: PlantParameters) -> PlantParameters:
    """The plant with the effects, and off within tolerances as a sample of the nominal one is."""
    assert trial.rigid is not None and sample.inertial_delta is not None and sample.gravity is not None
    changes = {name: np.asarray(getattr(named, name)) + getattr(sample, name) for name in ADDED}
    delta = sample.inertial_delta + (0.0 if named.inertial_delta is None else named.inertial_delta)
    nominal = np.asarray(trial.rigid.gravity_vector)
    gravity = sample.gravity - nominal + (nominal if named.gravity is None else named.gravity)
    return replace(named, **changes, inertial_delta=delta, gravity=gravity)


def _as_measured(run: Resimulation, machine: str, rng: np.random.Generator) -> Resimulation:
    """A run whose measured channels are those of a simulated machine, with the log's noise."""
    noise = run.trial.motion.noise
    in_loop = simulable(run.trial)
    measured = {}
    for quantity in run.measured:
        simulated = run.simulated[machine][quantity]
        level = getattr(noise, quantity) if in_loop else 0.0  # windows compare what is free of it
        measured[quantity] = simulated + level * rng.standard_normal(simulated.shape)
    return replace(run, measured=measured)
