"""Which worlds a forge makes: decided by one seed, shuffled, each item enough to make its world alone."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from itertools import chain, zip_longest

import numpy as np

from samrl_core.blind_test.disturbances.registry import CATALOGUE, OUTSIDE
from samrl_core.blind_test.engines.engines import ENGINES
from samrl_core.blind_test.second_set.registry import SECOND_OUTSIDE, SECOND_SET, find_in, form_of
from samrl_core.blind_test.worlds.nominal import REVERSING, TRAJECTORY_SETS, nominal_arm
from samrl_core.cell.robots.robot import ROLES
from samrl_core.common.errors import InputError

SEVERITIES = (0.5, 0.95, 0.25, 0.75, 0.1)  # in the order in which rounds over the families take them
_STRONG = (0.5, 0.75, 0.95)
# Pairs that are confounded or mask each other; the first third of the two-effect worlds is sampled from them.
CONFOUNDED = (
    ("coulomb_friction", "viscous_friction"),
    ("payload", "actuator_gain"),
    ("joint_elasticity", "command_delay"),
    ("encoder_offset", "base_tilt"),
    ("coulomb_friction", "cable"),
    ("torque_sensor_error", "payload"),
    ("viscous_friction", "controller_gain"),
    ("backlash", "presliding"),
)


@dataclass(frozen=True)
class ForgeSettings:
    """How many worlds of each kind; half of the effects are of the second set, unless it is left out."""

    seed: int = 0
    single: int = 174  # the catalogue's families by turns
    none: int = 60
    outside: int = 42
    double: int = 24
    mujoco: int = 100  # of all, spread evenly over the kinds
    pinocchio: int = 100  # as many; the rest by PyBullet
    duration_s: float = 12.0  # of each recording
    wide_share: float = 1 / 3  # of worlds whose background leaves the tolerances, up to twice
    second_set: bool = True  # else all are of the first
    families: tuple[str, ...] = ()  # effects to sample from, of the library's and those outside; none: all
    stated_friction: bool = False  # models state friction, arms stick, logs lose messages

    def __post_init__(self) -> None:
        self._check_families()
        counts = (self.single, self.none, self.outside, self.double)
        if min(counts) < 0 or sum(counts) == 0:
            raise InputError(f"numbers of worlds {counts} must not be negative, and not all zero")
        if min(self.mujoco, self.pinocchio) < 0 or self.mujoco + self.pinocchio > sum(counts):
            raise InputError(
                f"{self.mujoco} worlds by MuJoCo and {self.pinocchio} by Pinocchio of {sum(counts)}; give at"
                " most all, or leave --mujoco and --pinocchio out"
            )
        if not 5.0 <= self.duration_s <= 35.0:
            raise InputError(f"recordings of {self.duration_s} s; give 5..35 s")

    def _check_families(self) -> None:
        outside = (*OUTSIDE, *SECOND_OUTSIDE) if self.second_set else OUTSIDE
        for name in self.families:
            if name not in (*CATALOGUE, *outside):
                known = ", ".join((*CATALOGUE, *outside))
                raise InputError(f"no family {name!r} can be made; there are {known}")
        for kind, count, there, least in (
            ("single", self.single, self.library, 1),
            ("double", self.double, self.library, 2),
            ("outside", self.outside, self.outside_library, 1),
        ):
            if count and len(there) < least:
                raise InputError(
                    f"{count} {kind} worlds need {least} famil{'ies' if least > 1 else 'y'} of that kind, of"
                    f" {', '.join(self.families)} {len(there)} are; give --{kind} 0, or further families"
                )

    @property
    def library(self) -> tuple[str, ...]:
        """Families of the library that are sampled."""
        return tuple(name for name in CATALOGUE if not self.families or name in self.families)

    @property
    def outside_library(self) -> tuple[str, ...]:
        """Families outside of it that are sampled, of both sets by turns."""
        pairs = zip_longest(OUTSIDE, SECOND_OUTSIDE if self.second_set else ())
        every = (name for name in chain.from_iterable(pairs) if name is not None)
        return tuple(name for name in every if not self.families or name in self.families)

    def as_dict(self) -> dict:
        """For JSON; without what older studies do not state, where it is as in them."""
        newer = ("families", "stated_friction")
        return {name: value for name, value in asdict(self).items() if name not in newer or value}


@dataclass(frozen=True)
class PlannedEffect:
    """One disturbance to be made."""

    family: str
    place: str  # contract's name of a place
    form: str  # T0, T1, T2
    severity: float
    onset: float | None  # [s]
    series: int = 1  # set of disturbances: 1 the first, 2 the one written anew


@dataclass(frozen=True)
class PlanItem:
    """One world to be made. Nothing else is needed to make it."""

    id: str
    set: str
    engine: str
    arm: str
    programme: int  # number of its set of excitation trajectories; a key of the label
    effects: tuple[PlannedEffect, ...]
    scale: float  # of the background against its tolerances
    seed: int
    duration_s: float
    sticks: bool = False  # as its model states

    def as_dict(self) -> dict:
        """For JSON."""
        return asdict(self)


def seed_from_commit(commit: str) -> int:
    """The forge's seed of a git commit hash, so that nobody chooses it.

    Raises:
        InputError: not a hash of at least seven hexadecimal digits.
    """
    text = commit.strip().lower()
    if len(text) < 7 or set(text) - set("0123456789abcdef"):
        raise InputError(f"'{commit}' is no commit hash; give at least seven hexadecimal digits")
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:6], "big")


def plan_worlds(settings: ForgeSettings) -> list[PlanItem]:
    """All worlds of a forge in shuffled order; the same for the same settings."""
    rng = np.random.default_rng(settings.seed)
    arms = [ROLES[int(rng.integers(2))] for _ in range(_total(settings))]
    kinds: list[tuple[str, tuple[PlannedEffect, ...]]] = []
    library, outside = settings.library, settings.outside_library

    def arm() -> str:
        return arms[len(kinds)]

    for i in range(settings.single):
        number, turn = i % len(library), i // len(library)
        form = "T1" if (number + turn) % 2 else "T0"
        severity, series = SEVERITIES[turn % len(SEVERITIES)], _series(number, turn, settings)
        kinds.append(("single", (_effect(library[number], form, severity, arm(), settings, rng, series),)))
    for _ in range(settings.none):
        kinds.append(("none", ()))
    for i in range(settings.outside):
        severity, name = _STRONG[(i // len(outside)) % 3], outside[i % len(outside)]
        series = 2 if name in SECOND_OUTSIDE else 1
        kinds.append(("outside", (_effect(name, "T2", severity, arm(), settings, rng, series),)))
    for i in range(settings.double):
        kinds.append(("double", _pair(i, 3 * i < settings.double, arm(), settings, rng)))

    total = len(kinds)
    engine = np.zeros(total, dtype=int)
    for index, count in ((1, settings.mujoco), (2, settings.pinocchio)):
        free = np.flatnonzero(engine == 0)
        if count:
            offset = float(rng.uniform(0, len(free) / count))
            engine[free[(offset + np.arange(count) * len(free) / count).astype(int)]] = index
    wide = np.zeros(total, dtype=bool)
    wide[rng.permutation(total)[: round(settings.wide_share * total)]] = True
    order = rng.permutation(total)
    items = []
    for place, k in enumerate(order.tolist()):
        kind, effects = kinds[k]
        items.append(
            PlanItem(
                id=f"w{place:03d}",
                set=kind,
                engine=ENGINES[int(engine[k])],
                arm=arms[k],
                programme=int(rng.integers(TRAJECTORY_SETS)),
                effects=effects,
                scale=float(rng.uniform(1.2, 2.0)) if wide[k] else 1.0,
                seed=int(rng.integers(2**62)),
                duration_s=settings.duration_s,
                sticks=settings.stated_friction,
            )
        )
    return items


def _total(settings: ForgeSettings) -> int:
    return settings.single + settings.none + settings.outside + settings.double


def _series(number: int, turn: int, settings: ForgeSettings) -> int:
    """Each family's rounds are shared between the sets, three of six each, over all severities."""
    return 1 + int(settings.second_set and (turn % 6 in (0, 3, 4)) == bool(number % 2))


def place_of(name: str, arm: str, joint: int, series: int = 1) -> str:
    """Contract's name of the place of a family's effect."""
    kind = find_in(series, name).place
    if kind == "arm":
        return f"arm:{arm}"
    body = nominal_arm(arm).bare
    return f"joint:{body.links[joint].joint}" if kind == "joint" else f"link:{body.links[joint].name}"


def _effect(
    name: str,
    form: str,
    severity: float,
    arm: str,
    settings: ForgeSettings,
    rng: np.random.Generator,
    series: int = 1,
) -> PlannedEffect:
    known = find_in(series, name)
    joint = int(rng.integers(known.first_joint, len(nominal_arm(arm).bare.links)))
    if known.needs_reversal:
        joint = int(rng.choice(REVERSING[arm]))
    place = place_of(name, arm, joint, series)
    if known.also_arm and rng.random() < 0.4:
        place = f"arm:{arm}"
    onset = None
    if known.onset and rng.random() < 0.3:
        onset = round(float(rng.uniform(0.3, 0.6)) * settings.duration_s, 3)
    return PlannedEffect(name, place, form_of(name) if series == 2 else form, severity, onset, series)


def _pair(
    i: int, confounded: bool, arm: str, settings: ForgeSettings, rng: np.random.Generator
) -> tuple[PlannedEffect, ...]:
    library = settings.library
    alike = [pair for pair in CONFOUNDED if set(pair) <= set(library)]
    while True:
        if confounded and alike:
            names = alike[i % len(alike)]
        else:
            first, second = rng.choice(len(library), size=2, replace=False)
            names = (library[first], library[second])
        pair = tuple(_of_a_pair(n, arm, settings, rng) for n in names)
        twisting = [e.place for e in pair if find_in(e.series, e.family).twists]
        if len(set(twisting)) == len(twisting):
            return pair


def _of_a_pair(name: str, arm: str, settings: ForgeSettings, rng: np.random.Generator) -> PlannedEffect:
    form, severity = "T1" if rng.random() < 0.5 else "T0", float(rng.choice(_STRONG))
    series = 1 + int(settings.second_set and name in SECOND_SET and rng.random() < 0.5)
    return _effect(name, form, severity, arm, settings, rng, series)
