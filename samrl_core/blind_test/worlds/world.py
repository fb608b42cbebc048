"""One sealed world.

Three recordings as a real arm could have made them, the truth, and the best possible answer.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import lru_cache

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Injection, Site
from samrl_core.blind_test.disturbances.registry import attach
from samrl_core.blind_test.engines import simulate as simulation
from samrl_core.blind_test.engines.hooks import Hooks
from samrl_core.blind_test.engines.simulate import Reality, Trace, simulate
from samrl_core.blind_test.second_set.registry import find_in
from samrl_core.blind_test.worlds.background import Background, sample_background
from samrl_core.blind_test.worlds.nominal import (
    ARMATURE,
    SETS,
    NominalArm,
    demands,
    description,
    nominal_arm,
    world_command,
)
from samrl_core.blind_test.worlds.plan import PlanItem, PlannedEffect
from samrl_core.blind_test.worlds.stated_friction import (
    StatedFriction,
    encoders,
    state_friction,
    with_losses,
)
from samrl_core.blind_test.worlds.world_cache import load_or_compute
from samrl_core.cell.types.arm_description import STANDARD_GRAVITY, Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.common.errors import InputError

HELD_OUT = "C"


@dataclass(frozen=True, eq=False)
class Oracle:
    """Held-out C without noise, background or stamp errors, at the controller's ticks.

    `states` hold position, velocity and link-side effort, `commanded` the effort sent.
    """

    effect_states: JointSignal  # nominal arm with the true disturbance
    effect_commanded: JointSignal
    nominal_states: JointSignal  # nominal arm alone
    nominal_commanded: JointSignal


def make_world(
    item: PlanItem, tolerances: Tolerances | None = None
) -> tuple[dict[str, ArmRecording], dict, Oracle]:
    """Recordings A, B and C, the label to be sealed, and the oracle.

    Raises:
        DivergedError: the world's ranges make an arm that runs away; nothing is sampled again in silence.
        InputError: an unknown family or place.
    """
    stated = tolerances or Tolerances()
    streams = np.random.default_rng(item.seed).spawn(2 + len(item.effects))
    arm = nominal_arm(item.arm)
    background = sample_background(
        arm.spec, arm.bare, arm.tool, ARMATURE[item.arm], stated, item.scale, streams[0], _friction(item)
    )
    injections = [
        _inject(planned, item, arm, stream) for planned, stream in zip(item.effects, streams[2:], strict=True)
    ]
    seeds = streams[1].integers(2**62, size=(len(SETS), 3)).tolist()
    recordings = {}
    for letter, (noise_seed, effect_seed, stamp_seed) in zip(SETS, seeds, strict=True):
        trace = _run(item, letter, injections, effect_seed, background, noise_seed)
        recordings[letter] = _recorded(
            item, letter, trace, background, stated, np.random.default_rng(stamp_seed)
        )
    held_out_effects = seeds[list(SETS).index(HELD_OUT)][1]
    plain = replace(item, effects=())
    nominal = (
        _run(plain, HELD_OUT, [], 0, None, 0)
        if item.sticks
        else _nominal(item.arm, item.programme, item.duration_s, item.engine)
    )
    best = _run(item, HELD_OUT, injections, held_out_effects, None, 0) if injections else nominal
    oracle = Oracle(*_signals(best), *_signals(nominal))
    return recordings, _label(item, injections, background), oracle


def joint_of(place: str, arm: NominalArm) -> int:
    """Index of the joint of a place, -1 for the whole arm.

    Raises:
        InputError: a place that the arm does not have.
    """
    kind, _, name = place.partition(":")
    names = {
        "joint": [link.joint for link in arm.bare.links],
        "link": [link.name for link in arm.bare.links],
        "arm": [],
    }
    if kind == "arm" and name == arm.role:
        return -1
    if name not in names.get(kind, []):
        raise InputError(
            f"{arm.role} has no place '{place}'; joints are {names['joint']}, links {names['link']}"
        )
    return names[kind].index(name)


def _inject(planned: PlannedEffect, item: PlanItem, arm: NominalArm, rng: np.random.Generator) -> Injection:
    asked = demands(item.arm, item.programme, item.duration_s)
    site = Site(
        spec=arm.spec,
        role=item.arm,
        model=arm.model,
        joint=joint_of(planned.place, arm),
        armature=ARMATURE[item.arm],
        peak_torque=asked.torque,
        gravity_torque=asked.gravity,
        peak_rate=lambda: _peak_rate(item.arm, item.programme, item.duration_s),
        lowest=asked.lowest,
        highest=asked.highest,
        rng=rng,
    )
    return find_in(planned.series, planned.family).make(site, planned.form, planned.severity)


def _run(
    item: PlanItem,
    letter: str,
    injections: list[Injection],
    effect_seed: int,
    background: Background | None,
    noise_seed: int,
) -> Trace:
    arm = nominal_arm(item.arm)
    hooks = Hooks()
    for injection, planned, rng in zip(
        injections, item.effects, np.random.default_rng(effect_seed).spawn(len(injections)), strict=True
    ):
        attach(injection, planned.onset, hooks, rng)
    controller = description(item.arm, letter, Tolerances()).controller
    assert controller is not None
    reality = Reality.ideal(ARMATURE[item.arm], np.array(STANDARD_GRAVITY))
    if item.sticks:
        friction = _friction(item)
        reality = replace(reality, dry=friction.dry, viscous=friction.wet)
    if background is not None:
        reality = background.reality
        if item.sticks:
            hooks.encoder.append(encoders(len(controller.joints), controller.period_s, item.seed))
    return simulate(
        arm.model,
        arm.body if background is None else background.body,
        controller,
        world_command(item.arm, item.programme, letter, item.duration_s),
        hooks,
        reality,
        item.engine,
        np.random.default_rng(noise_seed),
    )


def _friction(item: PlanItem) -> StatedFriction:
    return state_friction(nominal_arm(item.arm).spec, item.seed, item.sticks)


@lru_cache(maxsize=64)
def _peak_rate(role: str, trajectory_set: int, duration_s: float) -> np.ndarray:
    """Slope over 10 ms that set B's nominal commanded torque exceeds 1 % of the time, (J,) [N m/s]."""
    commanded = _nominal(role, trajectory_set, duration_s, "pybullet", "B").commanded
    return np.quantile(np.abs(commanded[10:] - commanded[:-10]), 0.99, axis=0) / 0.01


@lru_cache(maxsize=64)
def _nominal(role: str, trajectory_set: int, duration_s: float, engine: str, letter: str = HELD_OUT) -> Trace:
    """The nominal arm under a command; the same in every forge, so it is cached."""
    item = PlanItem("", "none", engine, role, trajectory_set, (), 1.0, 0, duration_s)
    arm = nominal_arm(role)
    command = world_command(role, trajectory_set, letter, duration_s)
    asked = (
        (engine, simulation.SETTLE_S, arm.spec, arm.tool, arm.urdf),
        (description(role, letter, Tolerances()), command),
    )
    made = load_or_compute(
        "nominal",
        ("blind_test/engines", "blind_test/disturbances", "blind_test/worlds", "cell/robots", "cell/types"),
        ("numpy", "scipy", "pin", engine),
        asked,
        lambda: vars(_run(item, letter, [], 0, None, 0)),
    )
    return Trace(**made)


def _signals(trace: Trace) -> tuple[JointSignal, JointSignal]:
    states = JointSignal(trace.time, trace.position, trace.velocity, effort=trace.effort)
    return states, JointSignal(trace.time, effort=trace.commanded)


def _recorded(
    item: PlanItem,
    letter: str,
    trace: Trace,
    background: Background,
    tolerances: Tolerances,
    rng: np.random.Generator,
) -> ArmRecording:
    command = world_command(item.arm, item.programme, letter, item.duration_s)
    count = len(trace.time)
    jitter = np.clip(rng.normal(size=(3, count)) * background.stamp_jitter, -4e-4, 4e-4)
    stamps = trace.time + background.stamp_offsets[:, None] + jitter
    stamps -= stamps[:, 0].min()
    noise = rng.normal(size=trace.effort.shape) * background.effort_noise
    arm = description(item.arm, letter, tolerances)
    assert arm.urdf is not None
    effort = trace.effort + background.sensor_offset + noise
    states, commanded = (
        JointSignal(stamps[0], trace.position, trace.velocity, effort=effort),
        JointSignal(stamps[2], effort=trace.commanded),
    )
    if item.sticks:
        states, commanded = with_losses(states, rng), with_losses(commanded, rng)
    return ArmRecording(
        name=letter,
        source="",
        sha256="",
        arm=replace(arm, urdf=_friction(item).in_urdf(arm.urdf, arm.joints)),
        states=states,
        command=JointSignal(
            stamps[1], command.position, command.velocity, command.acceleration, command.effort
        ),
        commanded_effort=commanded,
    )


def _label(item: PlanItem, injections: list[Injection], background: Background) -> dict:
    named = [
        {
            **asdict(planned),
            "parameters": {name: asdict(quantity) for name, quantity in injection.parameters.items()},
        }
        for planned, injection in zip(item.effects, injections, strict=True)
    ]
    return {
        "schema": 1,
        "id": item.id,
        "set": item.set,
        "engine": item.engine,
        "arm": item.arm,
        "programme": item.programme,
        "effects": named,
        "background": background.label,
        "seed": item.seed,
    }
