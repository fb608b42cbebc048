"""Tracks of bodies with known differences, made by SciPy's integrator, PyBullet and MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.body_recording import BodyModel, BodyRecording, BodyTrack, Support

G = 9.81
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Tracker:
    """How a camera sees a body."""

    rate: float = 120.0  # [Hz]
    noise: float = 5e-4  # [m]
    turn_noise: float = 0.01  # [rad]
    lost: float = 0.0  # share of frames
    wrong: float = 0.0  # share of frames with a detection of something else
    smooth: float = 0.0  # [frames] of a filter that colours the noise
    scale: float = 1.0  # of lengths as seen
    clock: float = 1.0  # of stamps against time


@dataclass(frozen=True)
class World:
    """What really acts."""

    gravity: Vector = (0.0, 0.0, -G)
    drag: float = 0.0  # [1/m]
    lift: Vector = (0.0, 0.0, 0.0)  # [1/s] spin's force across the velocity
    push: Callable[[float], np.ndarray] | None = None  # [m/s^2] over time
    friction: float = 0.3
    viscous: float = 0.0  # [s/m]
    normal: Vector = (0.0, 0.0, 1.0)
    restitution: float = 0.6
    center: Vector = (0.0, 0.0, 0.0)  # of mass in the tracked frame [m]
    gyration: Vector = (1e-3, 1e-3, 1e-3)
    tracker: Tracker = field(default_factory=Tracker)


def seen(
    world: World, time: np.ndarray, position: np.ndarray, turned: Rotation | None, rng: np.random.Generator,
    axes: str = "xyz",
) -> BodyTrack:  # fmt: skip
    """The track of centres (N, 3) and turns as the world's tracker gives it."""
    t = world.tracker
    count = len(time)
    noise = rng.standard_normal((count, 3))
    shaken = rng.standard_normal((count, 3))
    if t.smooth:
        kernel = np.exp(-0.5 * (np.arange(-9, 10) / t.smooth) ** 2)
        kernel /= np.sqrt(np.sum(kernel**2))
        noise, shaken = (
            np.stack([np.convolve(c, kernel, "same") for c in x.T], axis=1) for x in (noise, shaken)
        )
    frame = position if turned is None else position - turned.apply(np.asarray(world.center))
    frame = t.scale * frame + t.noise * noise
    wrong = rng.uniform(size=count) < t.wrong
    frame[wrong] += 0.05 * rng.standard_normal((int(wrong.sum()), 3))
    kept = rng.uniform(size=count) >= t.lost
    mask = np.array([a in axes for a in "xyz"], dtype=float)
    quats, turns = np.zeros((0, 4)), ""
    if turned is not None:
        quats = (Rotation.from_rotvec(t.turn_noise * shaken) * turned).as_quat()[kept]
        turns = "xyz"
    stamps = t.clock * time[kept]
    return BodyTrack(stamps - stamps[0], (frame * mask)[kept], axes, quats, turns)


def _air(world: World, t: float, velocity: np.ndarray) -> np.ndarray:
    out = -world.drag * np.linalg.norm(velocity) * velocity + np.cross(world.lift, velocity)
    return out if world.push is None else out + world.push(t)


def toss(
    world: World, rng: np.random.Generator, seconds: float = 0.6, speed: float = 1.5,
    way: float | None = None, spin: float = 6.0, turns: bool = True, name: str = "toss",
    body: BodyModel | None = None,
) -> BodyRecording:  # fmt: skip
    """A free flight with Euler's equations, integrated by SciPy."""
    angle = rng.uniform(0, 2 * np.pi) if way is None else way
    start = np.array([speed * np.cos(angle), speed * np.sin(angle), rng.uniform(2.0, 3.0)])
    omega = spin * rng.standard_normal(3) / np.sqrt(3.0)
    inertia = np.asarray(world.gyration)
    time = np.arange(0.0, seconds, 1.0 / world.tracker.rate)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        v, q, w = y[3:6], y[6:10], y[10:13]
        turn = 0.5 * np.concatenate([q[3] * w + np.cross(q[:3], w), [-q[:3] @ w]])
        force = np.asarray(world.gravity) + _air(world, t, v)
        return np.concatenate([v, force, turn, np.cross(inertia * w, w) / inertia])

    first = Rotation.random(random_state=int(rng.integers(1 << 30))).as_quat()
    y0 = np.concatenate([rng.uniform(-0.5, 0.5, 3), start, first, omega])
    made = solve_ivp(rate, (0.0, seconds), y0, t_eval=time, rtol=1e-9, atol=1e-10).y.T
    turned = Rotation.from_quat(made[:, 6:10])
    track = seen(world, time, made[:, :3], turned if turns else None, rng)
    return BodyRecording(
        name, "made by a test", "0" * 64, track, body or BodyModel("cube", "box", (0.1,) * 3)
    )


def slide(
    world: World, rng: np.random.Generator, way: float | None = None, speed: float = 1.2, name: str = "slide",
    support: Support | None = None, axes: str = "xy", seconds: float = 1.5,
) -> BodyRecording:  # fmt: skip
    """A puck that slides until it rests, and a while longer."""
    angle = rng.uniform(0, 2 * np.pi) if way is None else way
    normal = np.asarray(world.normal) / np.linalg.norm(world.normal)
    gravity = np.asarray(world.gravity)
    load = -float(normal @ gravity)
    pull = gravity - normal * (normal @ gravity)
    start = np.array([np.cos(angle), np.sin(angle), 0.0])
    start = start - normal * (normal @ start)
    velocity = speed * start / np.linalg.norm(start)
    position, step = rng.uniform(-0.3, 0.3, 3) * [1, 1, 0], 2e-4
    position = position - normal * (normal @ position)
    every = round(1.0 / world.tracker.rate / step)
    step = 1.0 / world.tracker.rate / every
    path = []
    for k in range(round(seconds / step)):
        if k % every == 0:
            path.append(position.copy())
        size = math.sqrt(velocity @ velocity)  # np.linalg.norm takes four times as long
        push = np.zeros(3) if world.push is None else world.push(k * step)
        brake = (world.friction + world.viscous * size) * load
        if size <= brake * step:
            velocity = np.zeros(3)
            if np.linalg.norm(pull + push) <= world.friction * load:
                continue
            size, brake = 1.0, 0.0
        velocity = velocity + step * (
            pull + push - world.drag * size * velocity - brake * velocity / max(size, 1e-9)
        )
        position = position + step * velocity
    time = np.arange(len(path)) * every * step
    track = seen(world, time, np.array(path), None, rng, axes)
    return BodyRecording(
        name, "made by a test", "0" * 64, track, BodyModel("puck", "cylinder", (0.04, 0.02)),
        support or Support(friction=0.3),
    )  # fmt: skip


def bounces(
    world: World, rng: np.random.Generator, name: str = "ball", height: float = 0.6, seconds: float = 1.6,
    restitution: float = 0.6, scatter: float = 0.01,
) -> BodyRecording:  # fmt: skip
    """A small ball that is dropped with a little speed across, exact parabolas."""
    time = np.arange(0.0, seconds, 1.0 / world.tracker.rate)
    p, v = np.array([0.0, 0.0, height]), np.array([rng.uniform(-0.4, 0.4), rng.uniform(-0.4, 0.4), 0.0])
    g, at, path = np.asarray(world.gravity), 0.0, []
    for t in time:
        while True:
            a, b, c = 0.5 * g[2], v[2], p[2]
            hit = (-b - np.sqrt(max(b * b - 4 * a * c, 0.0))) / (2 * a)
            if at + hit > t or (abs(v[2]) < 0.05 and p[2] < 1e-6):
                break
            p, v, at = p + v * hit + 0.5 * g * hit**2, v + g * hit, at + hit
            e = world.restitution * (1.0 + scatter * rng.standard_normal())
            p[2], v[2] = 0.0, -e * v[2]
        if abs(v[2]) < 0.05 and p[2] < 1e-6:
            path.append(np.array([p[0], p[1], 0.0]))
            continue
        s = t - at
        path.append(p + v * s + 0.5 * g * s * s)
    track = seen(world, time, np.array(path), None, rng)
    return BodyRecording(
        name, "made by a test", "0" * 64, track, BodyModel("ball", "sphere", (0.02,)),
        Support(friction=0.3, restitution=restitution),
    )  # fmt: skip


def several(
    make: Callable[..., BodyRecording], world: World, count: int, seed: int, **more: object
) -> list[BodyRecording]:
    """Recordings with one stream of random numbers."""
    rng = np.random.default_rng(seed)
    return [
        replace(make(world, rng, **more), name=f"run{k:02d}", sha256=f"{seed * 1000 + k:064x}")
        for k in range(count)
    ]
