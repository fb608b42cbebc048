"""One made-up diagnosis per verdict, with numbers and curves as a 7-joint arm would show them."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.result import (
    PHASES,
    Curve,
    Diagnosis,
    Heatmap,
    HeldOutGap,
    InputFile,
    LeastSize,
    NamedEffect,
    NextExperiment,
    Overlay,
    ParameterEstimate,
    Signature,
    Timeline,
    WhereItem,
)

JOINTS = tuple(f"panda_joint{i}" for i in range(1, 8))
PLACES = tuple(f"joint:{name}" for name in JOINTS)
CHANNELS = ("controller", "drive", "link")
FIT = ("a_reversals.mcap", "b_multisine.mcap")
HELD_OUT = "c_task.mcap"

COULOMB = NamedEffect(
    "coulomb_friction",
    "joint:panda_joint4",
    0.97,
    {
        "Fc": ParameterEstimate(0.412, "N m", (0.381, 0.443)),
        "transition": ParameterEstimate(0.0121, "rad/s", (0.008, 0.0162)),
    },
    gain=812.4,
)
STRIBECK = NamedEffect(
    "stribeck_friction",
    "joint:panda_joint4",
    0.02,
    {"Fs": ParameterEstimate(0.52, "N m", (0.2, 0.9))},
    795.0,
    "",
    "runner_up",
)
DELAY = NamedEffect(
    "command_delay",
    "arm:tool_arm",
    0.004,
    {"delay": ParameterEstimate(0.00213, "s", (0.0018, 0.00241))},
    402.1,
    "",
    "runner_up",
)
BACKLASH = NamedEffect(
    "backlash",
    "joint:panda_joint4",
    0.48,
    {"half_width": ParameterEstimate(0.0031, "rad", (0.0024, 0.0037))},
    311.0,
)
ELASTICITY = NamedEffect(
    "joint_elasticity",
    "joint:panda_joint4",
    0.45,
    {
        "stiffness": ParameterEstimate(8200.0, "N m/rad", (7100.0, 9400.0)),
        "damping": ParameterEstimate(11.0, "N m s/rad", (4, 18)),
    },
    307.5,
)


def diagnosis(verdict: str, seed: int = 0) -> Diagnosis:
    """A diagnosis with that verdict."""
    return {
        "no_gap": _no_gap,
        "effect": _effect,
        "ambiguous": _ambiguous,
        "none_of_mine": _none_of_mine,
        "not_testable": _not_testable,
    }[verdict](np.random.default_rng(seed))


def heatmap(rng: np.random.Generator, row: int | None, channel: int = 1) -> Heatmap:
    values = rng.uniform(0.7, 1.4, (7, len(CHANNELS) * len(PHASES)))
    if row is not None:
        values[row, 4 * channel : 4 * channel + 4] = (2.1, 7.4, 6.1, 3.2)
        values[row + 1, 4 * channel + 1] = 2.4
    values[:, 0] = np.nan  # no recording rests in this channel
    return Heatmap(PLACES, tuple((c, p) for c in CHANNELS for p in PHASES), values, 1.8)


def timelines(rng: np.random.Generator, row: int | None, onset: float | None = None) -> tuple[Timeline, ...]:
    result = []
    for name in (*FIT, HELD_OUT):
        time = np.arange(0.125, 20, 0.25)
        energy = {p: rng.uniform(0.8, 1.3, len(time)) for p in PLACES}
        if row is not None:
            later = time > (onset or 0.0)
            energy[PLACES[row]] = energy[PLACES[row]] + later * (
                3 + 1.5 * np.sin(time) + rng.normal(0, 0.3, len(time))
            )
        result.append(Timeline(name, time, energy, 1.8, onset))
    return tuple(result)


def friction_curve(rng: np.random.Generator) -> Curve:
    speed = rng.normal(0, 0.5, 6000)
    torque = 0.41 * np.tanh(speed / 0.012) + rng.normal(0, 0.07, len(speed))
    grid = np.linspace(-1.8, 1.8, 361)
    return Curve(
        COULOMB.name,
        "velocity [rad/s]",
        "residual torque [N m]",
        speed,
        torque,
        grid,
        0.41 * np.tanh(grid / 0.012),
    )


def overlays(
    rng: np.random.Generator, samples: int = 20_000, with_effect: bool = True
) -> tuple[Overlay, ...]:
    result = []
    t = np.linspace(0, 20, samples)
    for k, joint in enumerate(JOINTS):
        q = 0.6 * np.sin(2 * np.pi * (0.1 + 0.05 * k) * t) + 0.15 * np.sin(2 * np.pi * 0.9 * t + k)
        dq = np.gradient(q, t)
        strength = 1.0 if k == 3 else 0.02
        lag = 0.012 * strength * np.tanh(dq / 0.05)
        noise = rng.normal(0, 2e-4, len(t))
        explained = q + noise
        result.append(
            Overlay(
                HELD_OUT,
                joint,
                "position",
                "rad",
                t,
                q - lag + noise,
                q + 0.0004 * strength,
                q - 0.85 * lag if with_effect else None,
                explained - 0.5 * lag if with_effect and k == 3 else None,
            )
        )
        tau = 8 * np.cos(q + k) + 0.4 * strength * np.tanh(dq / 0.012)
        result.append(
            Overlay(
                HELD_OUT,
                joint,
                "effort",
                "N m",
                t,
                tau + rng.normal(0, 0.05, len(t)),
                8 * np.cos(q + k),
                tau - 0.05 * strength * np.tanh(dq / 0.012) if with_effect else None,
            )
        )
    return tuple(result)


def _held_out(with_effect: bool = True) -> HeldOutGap:
    if not with_effect:
        return HeldOutGap(
            "position error", "rad", 0.0113, None, None, None, None, None, None, recordings=(HELD_OUT,)
        )
    return HeldOutGap(
        "position error",
        "rad",
        0.0113,
        0.00192,
        0.0052,
        STRIBECK.name,
        0.83,
        (0.79, 0.86),
        0.29,
        (
            ("position", "rad", 0.0113, 0.00192),
            ("velocity", "rad/s", 0.041, 0.012),
            ("effort", "N m", 0.39, 0.071),
        ),
        (HELD_OUT,),
    )


def _inputs() -> tuple[InputFile, ...]:
    names = (*FIT, HELD_OUT)
    roles = ("fit", "fit", "held_out")
    return tuple(
        InputFile(n, f"{i:x}" * 64, r, 20.0) for i, (n, r) in enumerate(zip(names, roles, strict=True), 10)
    )


def _common(rng: np.random.Generator) -> dict:
    return {
        "not_testable": {
            "camera_latency": "no images",
            "hand_eye": "no images",
            "contact_friction": "no contact",
        },
        "inputs": _inputs(),
        "seed": 7,
        "version": "0.1.0",
        "arm": "tool_arm",
        "timings": {"triage": 11.2, "fit": 88.1, "held out": 21.0},
        "settings": {
            "tolerances": {"mass": 0.02, "base_tilt": 0.0005},
            "library": None,
            "rollouts": np.int64(120),
        },
    }


def _where(share: float = 0.71) -> tuple[WhereItem, ...]:
    return (
        WhereItem("joint:panda_joint4", "drive", "reversal", 3.2, 5.0, share, FIT[0]),
        WhereItem("joint:panda_joint4", "drive", "slow", 5.0, 9.5, 0.2, FIT[0]),
        WhereItem("joint:panda_joint5", "drive", "reversal", 3.2, 5.0, 0.03, FIT[1], 3.25),
    )


def _effect(rng: np.random.Generator) -> Diagnosis:
    return Diagnosis(
        verdict="effect",
        reasons=(
            "The gap is far above what the tolerances explain (7.4 standard deviations at panda_joint4).",
            "Coulomb friction fits better than every other effect by 17 nats or more.",
            "Its parameters are the same in both recordings and at both gains.",
        ),
        where=_where(),
        effects=(COULOMB,),
        runner_ups=(STRIBECK, DELAY),
        ambiguity_set=(),
        next_experiment=None,
        gap=_held_out(),
        unexplained_fraction=0.08,
        heatmap=heatmap(rng, 3),
        timelines=timelines(rng, 3),
        curves=(friction_curve(rng),),
        overlays=overlays(rng),
        notes=("b_multisine.mcap: 3 samples with a repeated stamp were left out.",),
        couplings=(("panda_joint5", "panda_joint6", "velocity", 0.71),),
        **_common(rng),
    )


def _no_gap(rng: np.random.Generator) -> Diagnosis:
    return Diagnosis(
        verdict="no_gap",
        reasons=("No joint, channel or phase exceeds what the stated tolerances explain.",),
        where=(),
        effects=(),
        runner_ups=(),
        ambiguity_set=(),
        next_experiment=None,
        gap=_held_out(with_effect=False),
        unexplained_fraction=float("nan"),
        heatmap=heatmap(rng, None),
        timelines=timelines(rng, None),
        overlays=overlays(rng, 4000, with_effect=False),
        least_sizes=(
            LeastSize("depth_scale@sensor:camera", "a", "1", (-0.022, 0.022), (-0.0007, 0.0007)),
            LeastSize("depth_scale@sensor:camera", "b", "m", (-0.0066, 0.0066), (-0.0002, 0.0002)),
            LeastSize("lighting@cell", "g", "1", (-0.41, 0.68), (-0.02, 0.02)),
            LeastSize(
                "camera_latency@sensor:camera", "T", "s", (float("nan"), float("nan")), (-0.001, 0.001)
            ),
        ),
        **_common(rng),
    )


def _ambiguous(rng: np.random.Generator) -> Diagnosis:
    programme = {
        "schema": 1,
        "arm": "tool_arm",
        "programme": "load_reversals",
        "joints": ["panda_joint4"],
        "segments": [
            {"kind": "chirp", "from_hz": 1.0, "to_hz": 20.0, "amplitude_rad": 0.01, "duration_s": 15.0}
        ],
    }
    return Diagnosis(
        verdict="ambiguous",
        reasons=("Backlash and elasticity fit equally well: their scores differ by 3.5 nats, 9 are needed.",),
        where=_where(0.55),
        effects=(BACKLASH,),
        runner_ups=(ELASTICITY, DELAY),
        ambiguity_set=((BACKLASH.name, ELASTICITY.name),),
        next_experiment=NextExperiment(
            "next.yaml",
            "a chirp through 20 Hz shows a resonance if the joint is elastic, and none if it has play",
            0.93,
            programme,
        ),
        gap=_held_out(),
        unexplained_fraction=0.12,
        heatmap=heatmap(rng, 3, 2),
        timelines=timelines(rng, 3, 8.0),
        overlays=overlays(rng),
        **_common(rng),
    )


def _none_of_mine(rng: np.random.Generator) -> Diagnosis:
    return Diagnosis(
        verdict="none_of_mine",
        reasons=(
            "The best effect leaves 46 % of the excess unexplained; at most 25 % is allowed.",
            "Its delay changes from 2.1 ms to 9.5 ms when the gains are halved.",
        ),
        where=_where(0.4),
        effects=(),
        runner_ups=(DELAY, ELASTICITY),
        ambiguity_set=(),
        next_experiment=None,
        gap=_held_out(with_effect=False),
        unexplained_fraction=0.46,
        alarms=(
            "command_delay@arm:tool_arm is not invariant: 2.1 ms in a_reversals, 9.5 ms in b_multisine",
            "regressor fit and rollout fit of Fc disagree: 0.12 and 0.44 N m",
        ),
        nearest=DELAY,
        signatures=(
            Signature(
                "joint:panda_joint4",
                "link",
                (("odd in velocity", 0.12), ("repeats 12.0 times per turn", 0.81)),
            ),
            Signature("joint:panda_joint5", "link", (("grows with time", 0.34),)),
        ),
        heatmap=heatmap(rng, 3, 2),
        timelines=timelines(rng, 3),
        overlays=overlays(rng),
        **_common(rng),
    )


def _not_testable(rng: np.random.Generator) -> Diagnosis:
    common: dict = _common(rng) | {
        "not_testable": dict.fromkeys(("backlash", "command_delay"), "the arm does not move")
    }
    return Diagnosis(
        verdict="not_testable",
        reasons=(
            "The arm moves less than 0.01 rad in every recording; record the programme of `samrl excite`.",
        ),
        where=(),
        effects=(),
        runner_ups=(),
        ambiguity_set=(),
        next_experiment=None,
        gap=None,
        unexplained_fraction=float("nan"),
        **common,
    )
