"""How far and how fast the model is put right by one image (the paper's Fig. 9).

Thread: straight offsets are sampled at random, both the true one and the one that the fit starts from; its
colour is that of the model, another, or changes from link to link. Pancake: the fit starts centimetres and
tens of degrees off. The images are PyBullet's with the sensors' noise; the truth is read after each fit, to
score it. Then the belief is disturbed as much as one action may, and the update of the loop is timed.

    python -m samrl_core.studies.model.model_updating --cases 20 --out DIR

Every case is a line in DIR/cases.jsonl; started again, the command goes on where it was stopped. At the end
it writes DIR/model_updating.json and DIR/model_updating.png.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks.needle_threading.task import NeedleThreading
from samrl_core.cell.tasks.spatula_flipping.task import PANCAKE, SpatulaFlipping
from samrl_core.cell.types.observation import Observation
from samrl_core.cell.world.evaluation import true_values
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.world import Truth
from samrl_core.common.array_file import write_arrays
from samrl_core.common.errors import InputError
from samrl_core.common.files import append_line, write_whole
from samrl_core.model.model import Model
from samrl_core.model.real2sim.pose_fit import PoseFitSettings
from samrl_core.model.real2sim.real2sim import Estimate, Real2Sim, Real2SimSettings, initial_estimate
from samrl_core.studies.episodes.cell_driver import CellDriver
from samrl_core.studies.model.model_updating_cases import UpdateCase, line_of, read_cases, summary
from samrl_core.studies.model.model_updating_picture import write_picture

HUES = ((0.85, 0.10, 0.10), (0.15, 0.65, 0.20), (0.15, 0.25, 0.85))  # of links in turn
OTHER_COLOR = (0.15, 0.55, 0.30)  # that the model starts from where it is given a wrong one


@dataclass(frozen=True)
class UpdatingStudy:
    """One row of the figure."""

    name: str
    task: NeedleThreading | SpatulaFlipping
    iterations: int  # renderings with gradient at most, from far
    loop_iterations: int  # the same in the loop
    spread: tuple[float, ...]  # the start is off by up to this, uniformly [unit of the parameter]
    recolored: bool = False  # the model starts with another colour than the real thread has


_THREAD_SPREAD = (NeedleThreading().half_range,) * 20
_PANCAKE_SPREAD = (0.03, 0.03, 0.015, 0.35, 0.35)
STUDIES = (
    UpdatingStudy("thread", NeedleThreading(), 200, 20, _THREAD_SPREAD),
    UpdatingStudy("thread_other_color", NeedleThreading(), 200, 20, _THREAD_SPREAD, recolored=True),
    UpdatingStudy("thread_of_colors", NeedleThreading(link_colors=HUES), 200, 20, _THREAD_SPREAD),
    UpdatingStudy("pancake", SpatulaFlipping(), 100, 10, _PANCAKE_SPREAD),
)


class UpdatingSetup:
    """A study's model and world."""

    def __init__(self, study: UpdatingStudy) -> None:
        """Builds both."""
        cell = cell_named()
        self.study = study
        self.model = Model(study.task, cell)
        self.world = PyBulletWorld(study.task, cell)
        self._driver = CellDriver(self.world, cell, study.task.scene(cell).tool)
        base = Real2SimSettings()
        self._far = Real2Sim(self.model, replace(base, pose=_within(base.pose, study.iterations)))
        self._loop = Real2Sim(self.model, replace(base, pose=_within(base.pose, study.loop_iterations)))
        self._specs = study.task.parameters()

    def run(self, seed: int) -> tuple[UpdateCase, dict[str, np.ndarray]]:
        """One case, and pictures of it: the model before and after, and the real one (H, W, 3) 0..1."""
        self.world.reset(seed)
        image = self._driver.observe()
        rng = np.random.default_rng([seed, 9])
        start = self._start(rng)
        way = [start.values]
        began = time.perf_counter(), time.process_time()
        found = self._far.update(start, image, way.append)
        took = time.perf_counter() - began[0], time.process_time() - began[1]

        scale = np.array([p.scale for p in self._specs])
        push = Real2SimSettings.motion * scale * rng.standard_normal(scale.size)
        again = self._driver.observe()
        began = time.perf_counter(), time.process_time()
        looped = self._loop.update(replace(found, values=self._bounded(found.values + push)), again)
        loop_took = time.perf_counter() - began[0], time.process_time() - began[1]

        truth = self.world.truth()  # after the fits: nothing above has used it
        scores = [self._score(v, image, truth) for v in (*way, found.values)]
        loop = self._score(looped.values, again, truth)
        error = found.values - true_values(self.study.task, truth)
        surprise = float(error @ np.linalg.solve(found.covariance, error)) / error.size
        case = UpdateCase(
            self.study.name,
            seed,
            [s[0] for s in scores],
            scores[-1][1],
            [s[2] for s in scores] if self._is_pancake else [],
            float(np.sqrt(surprise)),
            found.iterations,
            found.why_stopped,
            *took,
            loop[0],
            loop[2],
            looped.iterations,
            *loop_took,
        )
        shown = {"before": start, "after": found}
        pictures = {name: self._render(e, image) for name, e in shown.items()}
        return case, pictures | {"real": image.frame.color / 255.0}

    @property
    def _is_pancake(self) -> bool:
        return isinstance(self.study.task, SpatulaFlipping)

    def _start(self, rng: np.random.Generator) -> Estimate:
        estimate = initial_estimate(self.model)
        spread = np.array(self.study.spread)
        values = self._bounded(estimate.values + rng.uniform(-spread, spread))
        colors = estimate.colors.copy()
        if self.study.recolored:
            colors[self.model.target_groups] = OTHER_COLOR
        # What is known of the start: how it was sampled, and how the truth is.
        covariance = estimate.covariance + np.diag(spread**2 / 3.0)
        return replace(estimate, values=values, colors=colors, covariance=covariance)

    def _bounded(self, values: np.ndarray) -> np.ndarray:
        return np.clip(values, [p.lower for p in self._specs], [p.upper for p in self._specs])

    def _render(self, estimate: Estimate, image: Observation) -> np.ndarray:
        with torch.no_grad():
            r = self.model.render(
                torch.from_numpy(estimate.values),
                torch.from_numpy(estimate.colors),
                image.camera,
                image.tool_arm.position,
            )
        return np.clip(r.color.numpy().astype(np.float64), 0.0, 1.0)

    def _score(self, values: np.ndarray, image: Observation, truth: Truth) -> tuple[float, float, float]:
        """L1 and straight distance [m], and angle [deg]."""
        task = self.study.task
        if isinstance(task, SpatulaFlipping):
            pose = task.body_poses(values)[PANCAKE]
            offset = (pose.position - truth.body_position[PANCAKE])[None]
            wanted = task.body_poses(true_values(task, truth))[PANCAKE]
            cosine = float(np.clip(pose.rotation[:, 2] @ wanted.rotation[:, 2], -1.0, 1.0))
            angle = float(np.degrees(np.arccos(cosine)))
        else:
            points = task.thread_points(values, self.model.tip_in_base(image.tool_arm.position).position)
            offset, angle = _middles(points) - _middles(truth.chain_points), 0.0
        straight = float(np.linalg.norm(offset, axis=1).mean())
        return float(np.abs(offset).sum(axis=1).mean()), straight, angle


def _middles(points: np.ndarray) -> np.ndarray:
    return 0.5 * (points[1:] + points[:-1])


def _within(settings: PoseFitSettings, iterations: int) -> PoseFitSettings:
    """At most so many renderings with gradient, half of them for eq. 5 alone."""
    coarse = replace(settings.coarse, max_evaluations=iterations // 2)
    return replace(
        settings, coarse=coarse, fine=replace(settings.fine, max_evaluations=iterations - iterations // 2)
    )


def main(arguments: list[str] | None = None) -> int:
    """Run what is missing, print a table, write JSON and picture."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--only", choices=[s.name for s in STUDIES], default=None)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(arguments)
    if options.cases < 1 or options.first_seed < 0:
        raise InputError(
            f"--cases {options.cases} must be positive, --first-seed {options.first_seed} not negative"
        )
    options.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)  # images are too small to share; waiting threads cost more than they save

    path = options.out / "cases.jsonl"
    cases = read_cases(path)
    write_whole(path, "".join(json.dumps(asdict(c)) + "\n" for c in cases))  # without a line that was cut off
    seeds = range(options.first_seed, options.first_seed + options.cases)
    studies = [s for s in STUDIES if options.only in (None, s.name)]
    for study in studies:
        missing = [s for s in seeds if (study.name, s) not in {(c.study, c.seed) for c in cases}]
        if not missing:
            continue
        bench = UpdatingSetup(study)
        for seed in missing:
            case, pictures = bench.run(seed)
            cases.append(case)
            append_line(path, json.dumps(asdict(case)))
            if seed == options.first_seed:
                kept = {name: pictures[name] for name in ("before", "after", "real")}
                write_arrays(options.out / f"{study.name}.npz", kept)
            print(
                f"{study.name} {seed - options.first_seed + 1}/{options.cases}: {line_of(case)}", flush=True
            )
        bench.world.close()

    chosen = {s.name: [c for c in cases if c.study == s.name and c.seed in seeds] for s in studies}
    result = {name: summary(some) for name, some in chosen.items()}
    for name, metrics in result.items():
        print(f"\n{name}")
        for key, value in metrics.items():
            print(f"  {key:22} {value:.3g}")
    record = {"schema": 1, "summary": result, "cases": [asdict(c) for some in chosen.values() for c in some]}
    write_whole(options.out / "model_updating.json", json.dumps(record, indent=1))
    write_picture(
        {name: [c.distance for c in some] for name, some in chosen.items()},
        {s.name: s.iterations for s in studies},
        options.out,
        options.out / "model_updating.png",
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
