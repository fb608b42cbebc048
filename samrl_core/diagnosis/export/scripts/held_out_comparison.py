"""What re-simulations in any engine share: held-out recordings read, compared and written. numpy alone.

Lies beside resimulate.py, which is handed to users without the rest of samrl.
"""

from __future__ import annotations

import json

import numpy as np

QUANTITIES = ("position", "velocity", "effort", "commanded_effort")


def impedance(held, gains, clock, period):
    """The controller without gravity: a function of period k, positions and velocities (J,), to efforts (J,).

    The command comes late and through a low-pass, as `gains` says. To be called at k = 0, 1, ... in turn.
    """
    names = ("position", "velocity")
    late = clock - gains["command_delay"][:, None]
    wanted, speed = (_interpolated(late, held["command_time"], held["command_" + name]) for name in names)
    forward = _interpolated([clock] * wanted.shape[1], held["command_time"], held["command_effort"])
    stiffness = held["stiffness"] * gains["stiffness_scale"]
    damping = held["damping"] * gains["damping_scale"]
    blend = 1.0 - np.exp(-2 * np.pi * period * gains["command_cutoff"])
    filtered, filtered_speed = wanted[0].copy(), speed[0].copy()
    reported, share = np.array(held["start_velocity"]), period / (period + held["velocity_lag"])

    def effort(k, q, v):
        reported[:] += share * (v - reported)
        filtered[:] += blend * (wanted[k] - filtered)
        filtered_speed[:] += blend * (speed[k] - filtered_speed)
        return stiffness * (filtered - q) + damping * (filtered_speed - reported) + forward[k]

    return effort


def _interpolated(times, known, values):
    """Values (K, J) at times `known` (K,), at times of each joint's own (J, N); (N, J)."""
    return np.stack([np.interp(t, known, c) for t, c in zip(times, values.T, strict=True)], 1)


def effort_on_its_way(gains, sent, k, period, last, soft):
    """Effort (J,) between controller and drive at period k, as the controller's code would have it.

    `sent` are the efforts of all periods up to k, `last` what reached the drive in the one before (None at
    the start), `soft` the share of a step that the low-pass lets through in one period.
    """
    u = np.empty(len(gains["effort_delay"]))
    for j, delay in enumerate(gains["effort_delay"]):
        at = max(k - delay / period, 0.0)
        low = int(at)
        high = min(low + 1, k)
        u[j] = sent[low][j] * (1 - (at - low)) + sent[high][j] * (at - low)
    if last is not None:
        u = last + soft * (u - last) if np.isfinite(gains["effort_cutoff"]).any() else u
        most = gains["effort_rate_limit"] * period
        u = np.clip(u, last - most, last + most)
    u = np.clip(u, -gains["effort_limit"], gains["effort_limit"])
    return u * (1.0 + gains["actuator_gain"]) + gains["torque_offset"]


def gap(runs, held):
    """Root mean square of (measured - simulated) / scale over everything, and per quantity."""
    squares, parts = [], {}
    for run, one in zip(runs, held, strict=True):
        rows = []
        for name in QUANTITIES:
            if "measured_" + name in one:
                error = ((one["measured_" + name] - run[name]) / one["scale_" + name]) ** 2
                rows.append(error)
                parts.setdefault(name, []).append(error.mean())
        squares.append(np.concatenate(rows, axis=1).mean(axis=1))
    return float(np.sqrt(np.concatenate(squares).mean())), {
        n: float(np.sqrt(np.mean(p))) for n, p in parts.items()
    }


def compare(folder, engine, simulate):
    """Simulate all held-out recordings with both models, compare, write.

    `simulate(name, law, gains, held)` gives one dict of quantities (N, J) for each recording; `name` is
    original or changed, `gains` has what the controller's code does under both names.
    """
    law = json.loads((folder / "law.json").read_text())
    arrays = np.load(folder / "held_out.npz")
    held = [
        {name.split(".", 1)[1]: arrays[name] for name in arrays.files if name.startswith(f"{k}.")}
        for k in range(law["recordings"])
    ]
    names = ("original", "changed")
    gains = {
        name: {k: np.array([np.inf if x is None else x for x in v]) for k, v in law[name].items()}
        for name in names
    }
    gaps, parts, kept = {}, {}, {}
    for name in names:
        runs = simulate(name, law, gains, held)
        gaps[name], parts[name] = gap(runs, held)
        for k, run in enumerate(runs):
            kept |= {f"{k}.{name}.{quantity}": values for quantity, values in run.items()}
    np.savez_compressed(folder / "resimulated.npz", **kept)
    result = {
        "engine": engine,
        "before": gaps["original"],
        "after": gaps["changed"],
        "shrink": 1.0 - gaps["changed"] / gaps["original"],
        "quantities": {
            q: {"before": parts["original"][q], "after": parts["changed"][q]} for q in parts["changed"]
        },
    }
    (folder / "resimulated.json").write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result))
