"""Posterior ranges for domain randomisation: what was named, with its uncertainty, for each target.

`randomise.json` has for each changed number its mean, standard deviation and 95 % range, and the covariance
of all of them, so that draws keep together what the data keep together. `randomise.py` draws from it with
NumPy alone.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.export.correction import BODY, Correction
from samrl_core.diagnosis.simulation.plant_parameters import joint_fields

TEN = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
# Field -> how a target's own randomisation calls it; what has no name there is drawn by randomise.py.
NAMES = {
    "mujoco": {"coulomb": "dof_frictionloss", "viscous": "dof_damping", "rotor_inertia": "dof_armature"},
    "isaaclab": {"coulomb": "friction", "viscous": "viscous_friction", "rotor_inertia": "armature"},
    "pybullet": {"viscous": "jointDamping", "coulomb": "velocity motor's force"},
    "gazebo": {"coulomb": "friction", "viscous": "damping"},
    "urdf": {"coulomb": "dynamics friction", "viscous": "dynamics damping"},
}
SMOOTHING = ("coulomb_velocity",)  # of our own sign, which no target has
_OPERATION = {"actuator_gain": "1 + value, times", "stiffness_scale": "times", "damping_scale": "times"}


def ranges_of(correction: Correction, target: str) -> dict[str, Any]:
    """Content of `randomise.json`.

    Raises:
        InputError: the correction has no samples.
    """
    c = correction
    if not c.samples:
        raise InputError(
            "the correction has no posterior samples: no simulation of it is known; leave out --randomise"
        )
    entries, columns = [], []
    for name, samples in c.samples.items():
        if name in SMOOTHING:
            continue
        best = np.atleast_1d(c.fields[name])
        rows = samples.reshape(len(samples), -1)
        for k, value in enumerate(best.ravel()):
            if np.ptp(rows[:, k]) == 0:
                continue
            place = np.unravel_index(k, best.shape)
            whole, added = _nominal(c, name, place)
            entry = {
                "field": name, "target": NAMES[target].get(name), **_where(c, name, place),
                "unit": joint_fields()[name]["unit"] if name in joint_fields() else "SI",
                "operation": "set" if whole else _OPERATION.get(name, "add"),
                "value": float(value + added), "mean": float(np.mean(rows[:, k]) + added),
                "std": float(np.std(rows[:, k])),
                "range95": (np.quantile(rows[:, k], [0.025, 0.975]) + added).tolist(),
            }  # fmt: skip
            entries.append(entry)
            columns.append(rows[:, k])
    covariance = np.atleast_2d(np.cov(np.array(columns))) if columns else np.zeros((0, 0))
    return {
        "schema": 1, "target": target, "effects": list(c.effects), "draw": entries,
        "covariance": covariance.tolist(), "samples": len(next(iter(c.samples.values()))),
    }  # fmt: skip


def _nominal(c: Correction, name: str, place: tuple[Any, ...]) -> tuple[bool, float]:
    """Whether the number is given whole, and the nominal part that is added for it."""
    nominal = {"coulomb": c.friction, "viscous": c.damping, "rotor_inertia": c.armature}
    if name in nominal:
        return True, float(nominal[name][place[0]])
    return False, 0.0


def _where(c: Correction, name: str, place: tuple[Any, ...]) -> dict[str, Any]:
    if name == BODY:
        return {"place": f"joint:{c.joints[place[0]]}", "element": TEN[place[1]]}
    if name in joint_fields():
        return {"place": f"joint:{c.joints[place[0]]}"}
    return {"place": "cell", "element": int(place[0]) if place else 0}


def as_text(content: dict[str, Any]) -> str:
    """As the file holds it."""
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


SCRIPT = '''"""Draws corrected parameters of randomise.json, one number per entry, in order."""

import json
from pathlib import Path

import numpy as np

CONTENT = json.loads((Path(__file__).parent / "randomise.json").read_text())
ENTRIES = CONTENT["draw"]
TRIES = 256  # draws of which the first within all ranges is taken


def draw(generator=None, within95=True):
    """One draw as [(entry, value), ...], by the covariance, within each 95 % range unless told not to.

    What lies outside is drawn again; only of many numbers that never are all inside the last are cut.
    """
    generator = generator or np.random.default_rng()
    mean = np.array([e["mean"] for e in ENTRIES])
    draws = generator.multivariate_normal(mean, np.array(CONTENT["covariance"]), TRIES, method="svd")
    if not within95:
        return list(zip(ENTRIES, draws[0].tolist()))
    low, high = np.array([e["range95"] for e in ENTRIES]).T
    beyond = np.count_nonzero((draws < low) | (draws > high), axis=1)
    return list(zip(ENTRIES, np.clip(draws[np.argmin(beyond)], low, high).tolist()))


if __name__ == "__main__":
    for entry, value in draw():
        print(entry["place"], entry["field"], entry["operation"], value, entry["unit"])
'''
