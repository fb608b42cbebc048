"""Result of a diagnosis: plain data, written as report.json (contract, schema 1) and drawn as report.html."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

VERDICTS = ("no_gap", "effect", "ambiguous", "none_of_mine", "not_testable")
IN_TOLERANCES = "in tolerances"  # how a metric ends that counts in what a machine's motion may be off by
GAPS = ("effect", "ambiguous", "none_of_mine")  # verdicts by which machine and model differ
PHASES = ("rest", "reversal", "slow", "fast")


@dataclass(frozen=True)
class ParameterEstimate:
    """A parameter with its 95 % interval."""

    value: float
    unit: str
    ci95: tuple[float, float]


@dataclass(frozen=True)
class NamedEffect:
    """An effect at a place, as named or as a runner-up."""

    family: str
    place: str  # contract: joint:<name>, link:<name>, arm:<role>
    probability: float  # that this family at this place is the cause, among all that were tried
    parameters: dict[str, ParameterEstimate]
    gain: float = 0.0  # drop of chi2 against nominal [nat], uncertainty of the nominal model counted
    form: str = ""  # which form of the effect fitted, where it has several
    role: str = "primary"  # primary, secondary, runner_up, or tracked

    @property
    def name(self) -> str:
        """`family@place`."""
        return f"{self.family}@{self.place}"


@dataclass(frozen=True)
class LeastSize:
    """From which size on recordings show an effect, alone: about every other one of that size is named."""

    effect: str  # family@place
    parameter: str
    unit: str
    stated: tuple[float, float]  # down and up, tolerances as stated; NaN beyond what is searched
    exact: tuple[float, float]  # the same if nothing else were off by anything

    @property
    def family(self) -> str:
        """Of the effect."""
        return self.effect.partition("@")[0]


@dataclass(frozen=True)
class WhereItem:
    """A part of the recordings in which the gap is significant; strongest first."""

    place: str
    channel: str  # controller, drive, link, dynamics or tracking
    phase: str  # one of PHASES
    t0: float  # in the recording [s]
    t1: float
    share: float  # of the excess energy of all parts that are significant
    recording: str = ""
    onset: float | None = None  # when the first named effect, which acts there, began in the recording [s]


@dataclass(frozen=True, eq=False)
class Heatmap:
    """Excess over what the tolerances explain, in standard deviations; NaN where nothing was observed."""

    places: tuple[str, ...]  # rows
    columns: tuple[tuple[str, str], ...]  # (channel, phase)
    values: np.ndarray  # (rows, columns), root mean square of the whitened residual
    threshold: float  # above it a cell is significant after false-discovery control


@dataclass(frozen=True)
class TileGaps:
    """Where in the image a channel stands out of noise and tolerances: tiles, row by row of a square."""

    channel: str
    side: int  # tiles along each side of the image
    compared: tuple[int, ...]
    stand_out: tuple[int, ...]  # significant after false-discovery control, effects' own part included


@dataclass(frozen=True, eq=False)
class Timeline:
    """The heatmap's measure for one recording, in windows."""

    recording: str
    time: np.ndarray  # (W,) window centres [s]
    energy: dict[str, np.ndarray]  # place -> (W,) root mean square, of the channel that stands out most
    threshold: float  # above it a window is significant by itself
    onset: float | None = None  # [s]


@dataclass(frozen=True, eq=False)
class Curve:
    """The named effect over the data: residual torque against the quantity that drives it, and the fit."""

    effect: str  # family@place
    x_label: str  # with unit
    y_label: str  # with unit
    x: np.ndarray  # (N,) data
    y: np.ndarray  # (N,)
    fit_x: np.ndarray  # (K,) sorted; in order of time where the fit is no function of x
    fit_y: np.ndarray  # (K,)

    @property
    def is_line(self) -> bool:
        """Whether the fit is a function of x: a payload's is none of the joint's position alone."""
        return bool(np.all(np.diff(self.fit_x) >= 0.0))


@dataclass(frozen=True, eq=False)
class Overlay:
    """A held-out signal: measured, re-simulated with the nominal model, and with the named effect."""

    recording: str
    joint: str
    quantity: str  # position, velocity, effort, commanded_effort, or residual
    unit: str
    time: np.ndarray  # (N,) [s]
    measured: np.ndarray  # (N,)
    nominal: np.ndarray  # (N,)
    with_effect: np.ndarray | None  # (N,)
    runner_up: np.ndarray | None = None  # (N,)
    tiles: np.ndarray | None = None  # (N,) of images, index of each sample's tile, row by row of a square


@dataclass(frozen=True)
class HeldOutGap:
    """How far the gap shrinks on recordings never fitted."""

    metric: str
    unit: str
    nominal: float
    with_effect: float | None
    runner_up: float | None
    runner_up_effect: str | None
    shrink: float | None  # 1 - with_effect / nominal
    ci95: tuple[float, float] | None  # block bootstrap
    margin: float | None  # shrink minus the runner-up's
    channels: tuple[tuple[str, str, float, float | None], ...] = ()  # (quantity, unit, nominal, with effect)
    recordings: tuple[str, ...] = ()

    @property
    def in_tolerances(self) -> bool:
        """Whether its numbers are tolerances: below 1 nothing is off."""
        return self.metric.endswith(IN_TOLERANCES)

    @property
    def ends_within(self) -> bool:
        """Whether what the effect leaves is within tolerance: machines in order are off by as much."""
        return self.in_tolerances and self.with_effect is not None and self.with_effect < 1.0


@dataclass(frozen=True)
class NextExperiment:
    """The recording that would split the ambiguity set, as a file that `samrl excite` plays."""

    file: str  # next.yaml, relative to the report
    why: str
    separates: float  # probability that the closest pair is told apart by it
    programme: dict  # its content


@dataclass(frozen=True)
class Signature:
    """What the unexplained rest looks like; hints, not a cause."""

    place: str
    channel: str
    hints: tuple[tuple[str, float], ...]  # (description such as "odd in velocity", correlation -1..1)


@dataclass(frozen=True)
class InputFile:
    """A recording that was used."""

    bag: str
    sha256: str
    role: str  # fit or held_out
    duration: float = 0.0  # [s]


@dataclass(frozen=True)
class FamilyWords:
    """What is said of a family as one kind of recordings shows it: a ball has no base and no controller."""

    meaning: str
    remedy: str
    parameters: dict[str, str] = field(default_factory=dict)  # name -> what it is


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The whole answer."""

    verdict: str
    reasons: tuple[str, ...]  # why this verdict and no other, one sentence each
    where: tuple[WhereItem, ...]
    effects: tuple[NamedEffect, ...]
    runner_ups: tuple[NamedEffect, ...]
    ambiguity_set: tuple[tuple[str, ...], ...]
    next_experiment: NextExperiment | None
    gap: HeldOutGap | None
    unexplained_fraction: float  # of the excess energy on fitted recordings, after the named effects
    not_testable: dict[str, str]  # family -> reason
    inputs: tuple[InputFile, ...]
    seed: int
    version: str
    arm: str  # role
    alarms: tuple[str, ...] = ()  # parameters that were not invariant, fits that disagree
    notes: tuple[str, ...] = ()  # about the input
    nearest: NamedEffect | None = None  # with none_of_mine: what fitted best, and would be wrong
    tracked: tuple[NamedEffect, ...] = ()  # asked for and not named: so large if they are there at all
    signatures: tuple[Signature, ...] = ()
    couplings: tuple[tuple[str, str, str, float], ...] = ()  # (joint, driven by joint, quantity, correlation)
    heatmap: Heatmap | None = None
    tiles: tuple[TileGaps, ...] = ()  # of images
    # Effect -> parameter -> least standard deviation that these recordings allow, were all else as stated.
    information: dict[str, dict[str, float]] = field(default_factory=dict)
    least_sizes: tuple[LeastSize, ...] = ()  # of effects that would have been seen
    timelines: tuple[Timeline, ...] = ()
    curves: tuple[Curve, ...] = ()
    overlays: tuple[Overlay, ...] = ()
    told: dict[str, FamilyWords] = field(default_factory=dict)  # family -> words; others as of an arm
    timings: dict[str, float] = field(default_factory=dict)  # stage -> [s]
    settings: dict[str, object] = field(default_factory=dict)
