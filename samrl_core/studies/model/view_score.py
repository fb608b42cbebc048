"""Does the view score help? Estimate errors after one more view, chosen by score, at random, or not at all.

Each seed lays a world, fits the model to the start view, then goes on three times from the same belief with
"best", "random" and "fixed". Truth is read here alone, after the fits. Run it with
`python -m samrl_core.studies.model.view_score --seeds 20 --out DIR`.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scipy.stats import binomtest, wilcoxon

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import Real2Sim, initial_estimate
from samrl_core.policy.view.view_planning import STRATEGIES, ViewPlanner
from samrl_core.studies.episodes.cell_driver import CellDriver


@dataclass(frozen=True)
class ViewTrial:
    """One strategy on one seed."""

    seed: int
    strategy: str
    first_error: float  # after the start view [m]
    error: float  # after the second view [m]
    expected: float  # standard deviation that the estimate claims, root of the summed variances [m]
    score: float  # [nat]
    visibility: float  # 0..1
    moved: bool
    plan_s: float  # wall time of the choice [s]
    update_s: float  # wall time of the second fit [s]


@dataclass(frozen=True)
class ViewComparison:
    """A paired comparison of "best" with another strategy."""

    other: str
    wins: int  # seeds on which best was nearer
    losses: int
    median_difference: float  # best less other [m]
    sign_p: float  # one-sided sign test
    wilcoxon_p: float  # one-sided signed-rank test


def run_seed(
    seed: int,
    driver: CellDriver,
    world: PyBulletWorld,
    real2sim: Real2Sim,
    planner: ViewPlanner,
    model: Model,
) -> list[ViewTrial]:
    """All strategies on one seed; the world is laid anew for each, with the same noise up to the choice."""
    trials = []
    for k, strategy in enumerate(STRATEGIES):
        world.reset(seed)
        first = driver.observe()
        estimate = real2sim.update(initial_estimate(model), first)
        began = time.perf_counter()
        rng = np.random.default_rng([seed, k])
        choice = planner.plan(estimate, first.tool_arm.position, first.camera_arm.position, strategy, rng)
        planned = time.perf_counter()
        if choice.move:
            driver.move("camera_arm", choice.joint_position)
        second = driver.observe()
        fitting = time.perf_counter()
        after = real2sim.update(estimate, second)
        done = time.perf_counter()
        truth = _true_values(world, model, estimate.names)
        trials.append(
            ViewTrial(
                seed,
                strategy,
                float(np.linalg.norm(estimate.values - truth)),
                float(np.linalg.norm(after.values - truth)),
                float(np.sqrt(np.trace(after.covariance))),
                choice.score,
                choice.visibility,
                choice.move,
                planned - began,
                done - fitting,
            )
        )
    return trials


def _true_values(world: PyBulletWorld, model: Model, names: tuple[str, ...]) -> np.ndarray:
    """For tasks whose parameters are a body's x and y."""
    if len(names) != 2 or not (names[0].endswith("_x") and names[1].endswith("_y")):
        raise InputError(f"this study knows tasks with parameters *_x, *_y only, not {names}")
    body = next(iter(model.task.body_poses(np.array([p.nominal for p in model.task.parameters()]))))
    return world.truth().body_position[body][:2]


def compare(trials: list[ViewTrial], other: str) -> ViewComparison:
    """Best against another strategy, paired by seed; ties are left out of the sign test."""
    by = {(t.seed, t.strategy): t.error for t in trials}
    seeds = sorted({t.seed for t in trials})
    difference = np.array([by[s, "best"] - by[s, other] for s in seeds])
    wins, losses = int((difference < 0).sum()), int((difference > 0).sum())
    sign = binomtest(wins, wins + losses, alternative="greater").pvalue if wins + losses else 1.0
    rank = _signed_rank(difference) if wins + losses else 1.0
    return ViewComparison(other, wins, losses, float(np.median(difference)), float(sign), float(rank))


def _signed_rank(difference: np.ndarray) -> float:
    """One-sided p of Wilcoxon's test that the differences lie below zero."""
    result: Any = wilcoxon(difference, alternative="less")
    return float(result.pvalue)


def main(arguments: list[str] | None = None) -> int:
    """Run, print a table, write DIR/view_score.json."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--task", default="peg_insertion")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(arguments)
    if options.seeds < 1 or options.first_seed < 0:
        raise InputError(
            f"--seeds {options.seeds} must be at least 1, --first-seed {options.first_seed} at least 0"
        )
    options.out.mkdir(parents=True, exist_ok=True)

    torch.set_num_threads(1)  # images are too small to share; waiting threads cost more than they save
    cell, task = cell_named(), task_named(options.task)
    model = Model(task, cell)
    real2sim, planner = Real2Sim(model), ViewPlanner(model, cell, task)
    planner.prepare()
    world = PyBulletWorld(task, cell)
    driver = CellDriver(world, cell, task.scene(cell).tool)
    trials: list[ViewTrial] = []
    for count in range(1, options.seeds + 1):
        seed = options.first_seed + count - 1
        trials += run_seed(seed, driver, world, real2sim, planner, model)
        shown = "  ".join(f"{t.strategy} {1e3 * t.error:.2f}" for t in trials[-len(STRATEGIES) :])
        print(
            f"{count}/{options.seeds} seed {seed}: first {1e3 * trials[-1].first_error:.2f}  {shown} mm",
            flush=True,
        )
    world.close()

    print(
        f"\n{'strategy':9} {'median':>7} {'90 %':>7} {'max':>7} {'claimed':>8} {'plan':>6} {'fit':>6} mm, s"
    )
    for strategy in STRATEGIES:
        rows = [t for t in trials if t.strategy == strategy]
        e = 1e3 * np.array([t.error for t in rows])
        claimed = 1e3 * np.median([t.expected for t in rows])
        plan, fit = np.median([t.plan_s for t in rows]), np.median([t.update_s for t in rows])
        print(
            f"{strategy:9} {np.median(e):7.3f} {np.quantile(e, 0.9):7.3f} {e.max():7.3f} {claimed:8.3f} "
            f"{plan:6.2f} {fit:6.2f}"
        )
    comparisons = [compare(trials, other) for other in STRATEGIES if other != "best"]
    for c in comparisons:
        print(
            f"best against {c.other}: {c.wins} wins, {c.losses} losses, "
            f"median {1e3 * c.median_difference:+.3f} mm, "
            f"sign p {c.sign_p:.4f}, Wilcoxon p {c.wilcoxon_p:.4f}"
        )
    record = {
        "schema": 1,
        "task": options.task,
        "trials": [asdict(t) for t in trials],
        "comparisons": [asdict(c) for c in comparisons],
    }
    write_whole(options.out / "view_score.json", json.dumps(record, indent=1))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
