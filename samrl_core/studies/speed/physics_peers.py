"""The physics beside MuJoCo, Newton and Nimble: the free chain, and the sliding disc in contact."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from samrl_core.common.errors import InputError
from samrl_core.model.physics.physics_model import PhysicsModel
from samrl_core.model.physics.state import PhysicsState
from samrl_core.studies.speed import physics_scenes as scenes
from samrl_core.studies.speed.batches import STEPS, rollout_jobs
from samrl_core.studies.speed.timing import TimedCall, in_turn

FRAMES = 10  # of 1/240 s of the disc; Newton needs about four steps for one
ENVIRONMENTS = 64
_NIMBLE = Path(__file__).with_name("peers") / "nimble_chain.py"


def chain_end() -> np.ndarray:
    """Angles (20,) of our chain after `STEPS` steps, float64, for the peers to be held against."""
    return _chain_rollout(PhysicsModel(scenes.free_chain(), torch.float64), 1).q[-1, 0].numpy()


def graph_job(environments: int) -> TimedCall:
    """Our chain's recorded forward pass alone, without the border to torch."""
    model = PhysicsModel(scenes.free_chain())
    _chain_rollout(model, environments)  # writes start and parameters into the workspace
    return TimedCall("samrl graph", model.workspace(environments, STEPS).forward, environments * STEPS)


def _chain_rollout(model: PhysicsModel, environments: int) -> PhysicsState:
    start = scenes.moving_start(model, environments)
    with torch.no_grad():
        return model.rollout(start, model.no_action(environments, STEPS), model.parameters(environments))


def chain_alone(rounds: int) -> dict[str, Any]:
    """One chain beside MuJoCo: steps per second, and what the two end states differ by."""
    from samrl_core.studies.speed.peers.mujoco_chain import MujocoChain

    peer = MujocoChain(STEPS)
    ours = {f"samrl {job.name}": job for job in rollout_jobs(scenes.free_chain(), 1, "cpu")}
    jobs = [TimedCall(name, job.run, STEPS) for name, job in ours.items()]
    jobs += [
        graph_job(1),
        TimedCall("mujoco forward", peer.forward, STEPS),
        TimedCall("mujoco both", peer.both, STEPS),
    ]
    timings = in_turn(jobs, 5 * rounds)
    peer.forward()
    return {
        **{f"{name.replace(' ', '_')}_per_second": t.per_second for name, t in timings.items()},
        "ratio_forward": timings["samrl forward"].times_faster(timings["mujoco forward"]),
        "ratio_graph": timings["samrl graph"].times_faster(timings["mujoco forward"]),
        "ratio_both": timings["samrl both"].times_faster(timings["mujoco both"]),
        "largest_difference_rad": float(np.abs(peer.last - chain_end()).max()),
    }


def _beside_newton(
    ours: list[TimedCall], peer: Any, last: Callable[[Any], Any], amount: float, rounds: int
) -> dict[str, Any]:
    forward, both = peer.recorded(peer.run), peer.recorded(lambda: peer.run_both(last))
    jobs = [TimedCall(f"samrl {job.name}", job.run, job.amount, job.finish) for job in ours]
    finish = ours[0].finish
    jobs += [
        TimedCall("newton forward", forward, amount, finish),
        TimedCall("newton both", both, amount, finish),
    ]
    timings = in_turn(jobs, rounds)
    return {
        **{f"{name.replace(' ', '_')}_per_second": t.per_second for name, t in timings.items()},
        "ratio_forward": timings["samrl forward"].times_faster(timings["newton forward"]),
        "ratio_both": timings["samrl both"].times_faster(timings["newton both"]),
    }


def chain_beside_newton(rounds: int, device: str = "cpu", environments: int = ENVIRONMENTS) -> dict[str, Any]:
    """Many chains beside Newton's Featherstone solver, both as graphs."""
    from samrl_core.studies.speed.peers import newton_physics

    peer = newton_physics.chain(environments, STEPS, device)
    ours = rollout_jobs(scenes.free_chain(), environments, device)
    result = _beside_newton(ours, peer, lambda s: s.joint_q, environments * STEPS, rounds)
    end = peer.last.joint_q.numpy().reshape(environments, -1)[0]
    return {
        "environments": environments,
        **result,
        "largest_difference_rad": float(np.abs(end - chain_end()).max()),
    }


def disc_beside_newton(rounds: int, device: str = "cpu", environments: int = ENVIRONMENTS) -> dict[str, Any]:
    """Sliding discs beside Newton's semi-implicit solver with its general collision, per frame of 1/240 s."""
    from samrl_core.studies.speed.peers import newton_physics

    peer = newton_physics.disc(environments, FRAMES, device)
    ours = rollout_jobs(scenes.disc_on_plane(), environments, device)
    result = _beside_newton(ours, peer, lambda s: s.body_q, environments * FRAMES, rounds)
    position = peer.last.body_q.numpy()[0, :3]
    seconds = FRAMES * scenes.STEP_S
    closed = scenes.DISC_SPEED * seconds - 0.5 * scenes.DISC_FRICTION * 9.81 * seconds**2
    return {
        "environments": environments,
        **result,
        "newton_way_m": float(position[0]),
        "closed_form_way_m": closed,
        "newton_height_m": float(position[2]),
    }


def chain_beside_nimble(python: Path, rounds: int) -> dict[str, Any]:
    """One chain beside Nimble, which runs in an environment of its own just after ours.

    Raises:
        InputError: that environment cannot run it.
    """
    q, v = scenes.chain_start()
    numbers = {
        "links": scenes.LINKS,
        "length": scenes.LENGTH,
        "mass": scenes.MASS,
        "damping": scenes.DAMPING,
        "step_s": scenes.STEP_S,
        "inertia": scenes.cylinder_inertia(scenes.MASS, scenes.RADIUS, scenes.LENGTH).tolist(),
        "q": q.tolist(),
        "v": v.tolist(),
        "steps": STEPS,
        "rounds": rounds,
    }
    timings = in_turn(rollout_jobs(scenes.free_chain(), 1, "cpu"), 5 * rounds)
    run = subprocess.run(
        [str(python), str(_NIMBLE), json.dumps(numbers)], capture_output=True, text=True, check=False
    )
    if run.returncode:
        raise InputError(f"{python} cannot run Nimble: {run.stderr.strip().splitlines()[-1:]}")
    peer = json.loads(run.stdout.strip().splitlines()[-1])
    end = np.array(peer["last"])[: 2 * scenes.LINKS]
    return {
        **{f"samrl_{n}_per_second": t.per_second for n, t in timings.items()},
        **{f"nimble_{n}_per_second": 1.0 / peer[n] for n in ("forward", "both")},
        **{f"ratio_{n}": peer[n] / timings[n].seconds for n in ("forward", "both")},
        "largest_difference_rad": float(np.abs(end - chain_end()).max()),
    }
