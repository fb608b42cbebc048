"""Mass of a pancake from pushes (the paper's Fig. 10), the simulated cell as the real one.

Each case samples a mass and a friction, builds a world with them, pushes twice with different forces, and
fits from a guess that is 50 % off: to the first push alone, then from there on to both. What the fit gets is
what drivers and Real2Sim give; observations are the true position with white noise. Truth is read here alone,
after the fits. Run it with `python -m samrl_core.studies.model.mass_from_pushes --out DIR`; a second run goes
on where the first one ended.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks.spatula_flipping.task import PANCAKE, SpatulaFlipping
from samrl_core.cell.world.pose_sensor import PoseSensor
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.table import TABLE_FRICTION
from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole
from samrl_core.model.physical_parameters.identifiability import (
    Combination,
    PhysicalParameter,
    describe_parameters,
)
from samrl_core.model.physical_parameters.identify import Identified, IdentifySettings, identify
from samrl_core.model.physical_parameters.push_record import Disc, PushRecord
from samrl_core.studies.model.mass_picture import write_picture
from samrl_core.studies.model.push_driver import PushDriver, PushSettings

SCHEMA = 2
FORCES = (6.0, 8.0)  # of the first and the second push [N]
START_GAP = 0.004  # between blade and rim, at least [m]
HALF_RANGE = 0.003  # of the pancake's start about its middle [m]
RANGES = {"heavy": (0.5, 1.0), "light": (0.08, 0.08)}  # mass [kg]
FRICTION_RANGE = (0.30, 0.45)  # between pancake and table; all of them slide under the smaller force [-]


@dataclass(frozen=True)
class PushCase:
    """Sampled parameters of one case."""

    name: str
    group: str
    index: int
    mass: float  # [kg]
    friction: float  # between pancake and table [-]
    guess: float  # [kg]


def sample_case(group: str, index: int, seed: int) -> PushCase:
    """Mass, friction and side of the guess at random."""
    rng = np.random.default_rng([seed, list(RANGES).index(group), index])
    mass, friction = float(rng.uniform(*RANGES[group])), float(rng.uniform(*FRICTION_RANGE))
    guess = mass * (1.5 if rng.random() < 0.5 else 0.5)
    return PushCase(f"{group}_{index:02d}", group, index, mass, friction, guess)


def pushing_scene(mass: float, friction: float) -> SpatulaFlipping:
    """The pancake on the table before an upright blade; the lip stands beyond its reach."""
    radius = 0.05
    return SpatulaFlipping(
        pancake_radius=radius,
        pancake_mass=mass,
        pancake_friction=friction**2 / TABLE_FRICTION,  # the world takes the geometric mean
        blade_tilt=math.radians(90.0),
        blade_length=0.05,
        edge_ahead=0.0,
        center_x=0.50,
        half_range=(HALF_RANGE, HALF_RANGE),
        start_behind=radius + HALF_RANGE + START_GAP,
        start_height=0.0035,
        lip_x=0.88,
    )


def push_twice(case: PushCase, seed: int, settings: IdentifySettings) -> list[PushRecord]:
    """Records of both pushes, each from a scene laid anew."""
    cell, task = cell_named(), pushing_scene(case.mass, case.friction)
    world = PyBulletWorld(task, cell)
    driver = PushDriver(cell, task.scene(cell).tool, PushSettings())
    records = []
    for k, force in enumerate(FORCES):
        rng = np.random.default_rng([seed, list(RANGES).index(case.group), case.index, k + 1])
        world.reset(int(rng.integers(2**31)))
        records.append(driver.push(world, force, PoseSensor(world, PANCAKE, settings.seen_noise, rng)))
    world.close()
    return records


def run_case(case: PushCase, seed: int, settings: IdentifySettings) -> dict[str, Any]:
    """Both fits of a case beside its truth."""
    task = pushing_scene(1.0, 1.0)
    disc = Disc(task.pancake_radius, task.pancake_thickness, task.pancake_radius - task.pancake_rounding)
    pushes = push_twice(case, seed, settings)
    fits, found = {}, None
    for name, used in (("one_push", pushes[:1]), ("two_pushes", pushes)):
        began = time.process_time()
        found = identify(used, disc, case.guess, settings, found)
        fits[name] = summary(found, case) | {"cpu_s": time.process_time() - began}
    return {"schema": SCHEMA, "seed": seed, "case": asdict(case), "fits": fits}


def summary(found: Identified, case: PushCase) -> dict[str, Any]:
    """A fit and how far it is from the truth."""
    mass, friction = found.parameter("mass"), found.parameter("table_friction")
    return {
        "why_stopped": found.why_stopped,
        "misfit": found.misfit,
        "mass_path_kg": found.mass_path.tolist(),
        "wander": {n: getattr(found.wander, n) for n in ("friction", "force", "time_s")},
        "start_error": abs(case.guess / case.mass - 1),
        "error": mass.value / case.mass - 1,
        "half_width": mass.half_width,
        "covered": mass.lower <= case.mass <= mass.upper,
        "friction_error": friction.value / case.friction - 1,
        "friction_half_width": friction.half_width,
        "friction_covered": friction.lower <= case.friction <= friction.upper,
        "attributes": [asdict(a) | {"determined": a.determined} for a in found.parameters],
        "combinations": [asdict(c) for c in found.combinations],
    }


def conclusions(fit: dict[str, Any]) -> tuple[str, ...]:
    """The sentences of a stored fit."""
    fields = [{k: v for k, v in a.items() if k != "determined"} for a in fit["attributes"]]
    return describe_parameters(
        [PhysicalParameter(**f) for f in fields], [Combination(**c) for c in fit["combinations"]]
    )


def aggregate(results: list[dict[str, Any]]) -> dict[str, Any]:
    """Per group and fit: errors, coverage, and what was determined how often."""
    table: dict[str, Any] = {}
    for group in RANGES:
        rows = [r["fits"] for r in results if r["case"]["group"] == group]
        for name in ("one_push", "two_pushes") if rows else ():
            fits = [row[name] for row in rows]
            error = np.abs([f["error"] for f in fits])
            names = [a["name"] for a in fits[0]["attributes"]]
            table[f"{group}, {name}"] = {
                "cases": len(fits),
                "start_error": float(np.mean([f["start_error"] for f in fits])),
                "error_median": float(np.median(error)),
                "error_90": float(np.quantile(error, 0.9)),
                "error_max": float(error.max()),
                "error_mean": float(np.mean([f["error"] for f in fits])),
                "within_5_percent": int((error <= 0.05).sum()),
                "half_width_median": float(np.median([f["half_width"] for f in fits])),
                "covered": int(sum(f["covered"] for f in fits)),
                "friction_error_median": float(np.median(np.abs([f["friction_error"] for f in fits]))),
                "friction_error_mean": float(np.mean([f["friction_error"] for f in fits])),
                "friction_covered": int(sum(f["friction_covered"] for f in fits)),
                "converged": int(sum(f["why_stopped"] == "converged" for f in fits)),
                "determined": {
                    n: int(sum(f["attributes"][i]["determined"] for f in fits)) for i, n in enumerate(names)
                },
            }
    return table


def main(arguments: list[str] | None = None) -> int:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=20, help="with 0.5-1 kg")
    parser.add_argument("--light", type=int, default=5, help="with 0.08 kg")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(arguments)
    run_study(options.out, options.cases, options.light, options.seed)
    return 0


def run_study(out: Path, heavy: int, light: int, seed: int) -> None:
    """Run what is left, print a table, write mass_from_pushes.json and .png.

    Args:
        out: folder; a case that is in it is not run again.
        heavy: cases with 0.5-1 kg.
        light: cases with 0.08 kg.
        seed: of everything random.

    Raises:
        InputError: no case, or a negative number.
    """
    if heavy < 0 or light < 0 or heavy + light < 1 or seed < 0:
        raise InputError(
            f"--cases {heavy} and --light {light} must be at least 0 and not both 0, --seed {seed} at least 0"
        )
    folder = out / "cases"
    folder.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)  # the arrays are too small to share
    settings = IdentifySettings()
    cases = [sample_case("heavy", i, seed) for i in range(heavy)]
    cases += [sample_case("light", i, seed) for i in range(light)]
    results = []
    for count, case in enumerate(cases, 1):
        path = folder / f"{case.name}.json"
        result = json.loads(path.read_text()) if path.is_file() else {}
        if result.get("schema") != SCHEMA or result.get("seed") != seed:
            result = run_case(case, seed, settings)
            write_whole(path, json.dumps(result, indent=1))
        results.append(result)
        shown = "  ".join(
            f"{name} {100 * f['error']:+.2f} +- {100 * f['half_width']:.2f} % ({f['why_stopped']})"
            for name, f in result["fits"].items()
        )
        print(
            f"{count}/{len(cases)} {case.name} {case.mass:.3f} kg, friction {case.friction:.3f}: {shown}",
            flush=True,
        )
    table = aggregate(results)
    print(f"\n{'':24} start  median   90 %    max  <=5 %  interval  covered  friction  covered  converged")
    for name, row in table.items():
        print(
            f"{name:24} {100 * row['start_error']:4.0f} % {100 * row['error_median']:5.2f} % "
            f"{100 * row['error_90']:5.2f} % {100 * row['error_max']:5.2f} %  "
            f"{row['within_5_percent']:2}/{row['cases']:2}  +-{100 * row['half_width_median']:4.1f} %    "
            f"{row['covered']:2}/{row['cases']:2}  {100 * row['friction_error_median']:6.2f} %    "
            f"{row['friction_covered']:2}/{row['cases']:2}      {row['converged']:2}/{row['cases']:2}"
        )
        print(f"{'':24} determined: " + ", ".join(f"{n} {c}" for n, c in row["determined"].items()))
    sentences = {r["case"]["name"]: {n: conclusions(f) for n, f in r["fits"].items()} for r in results}
    record = {
        "schema": SCHEMA,
        "seed": seed,
        "forces_N": FORCES,
        "table": table,
        "said": sentences,
        "cases": results,
    }
    write_whole(out / "mass_from_pushes.json", json.dumps(record, indent=1))
    write_picture(results, out / "mass_from_pushes.png")


if __name__ == "__main__":
    raise SystemExit(main())
