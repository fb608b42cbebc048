"""The list of all jobs: whole, in an order that can be run, and with commands that the program knows."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from samrl_core.cell.tasks import OCCLUDED_TASKS, TASKS
from samrl_core.common.errors import InputError
from samrl_core.policy.networks.weights import weights_name
from samrl_core.studies.job_queue import DEVICE, WORKERS, JobQueue, Resources
from samrl_core.studies.registry import experiment_named
from samrl_core.studies.reproduction import KINDS, SEEDS, Reproduction
from samrl_ros.cli.commands import app

TRAININGS = len(TASKS) * len(SEEDS) + len(OCCLUDED_TASKS)


def test_everything_is_made_and_nothing_before_what_it_needs(tmp_path: Path) -> None:
    jobs = Reproduction(tmp_path, ("samrl",), True).jobs()
    JobQueue(jobs, Resources(1), tmp_path, print)  # which refuses names that are missing or twice
    names = [job.name for job in jobs]
    assert all(names.index(need) < k for k, job in enumerate(jobs) for need in job.needs)
    assert sum(name.startswith("train-") for name in names) == TRAININGS
    asked: dict[str, list[str]] = {}
    for job in jobs[TRAININGS:]:
        name = job.command[job.command.index("experiment") + 1]
        given = [job.command[k + 1] for k, part in enumerate(job.command) if part == "--task"]
        known = experiment_named(name)
        assert set(given) <= {*known.tasks, *known.on_request} and job.makes.name == f"{name}.json"
        asked.setdefault(name, []).extend(given or known.tasks)
    assert set(asked) == {"table1", "table1_world", "fig6", "fig7", "fig8d", "sample_efficiency"}
    assert all(set(TASKS) <= set(tasks) for tasks in asked.values())
    assert set(OCCLUDED_TASKS) <= set(asked["table1"])


def test_the_program_knows_every_command(tmp_path: Path) -> None:
    """Each is refused for its device alone, which is nowhere."""
    for job in Reproduction(tmp_path, (), True).jobs():
        filled = {DEVICE: "cuda:99", WORKERS: "1"}
        command = [filled.get(part, part) for part in job.command]
        if DEVICE in job.command:
            result = CliRunner().invoke(app, command)
            assert result.exit_code != 0 and "cuda:99" in str(result.exception), job.name


def test_what_is_trained_is_taken_over(tmp_path: Path) -> None:
    """Both networks: copied. The actor alone: its Q is trained. None: all of it."""
    trained, out = tmp_path / "trained", tmp_path / "out"
    (trained / "seed-2").mkdir(parents=True)
    for kind in KINDS:
        (trained / "seed-2" / weights_name("peg_insertion", kind)).write_text(kind)
    (trained / "seed-2" / weights_name("spatula_flipping", KINDS[0])).write_text("actor")
    (trained / "seed-2" / weights_name("needle_threading", KINDS[1])).write_text("Q")  # of no use alone
    jobs = {job.name: job for job in Reproduction(out, ("samrl",), False, trained).jobs()}
    whole = jobs["train-peg_insertion-2"]
    assert whole.makes.exists() and not whole.command
    assert whole.then is not None
    whole.then()
    assert sorted(file.name for file in (out / "weights" / "seed-2").iterdir()) == sorted(
        weights_name("peg_insertion", kind) for kind in KINDS
    )
    actor = str(trained / "seed-2" / "spatula_flipping_sim_actor.safetensors")
    half, none = jobs["train-spatula_flipping-2"].command, jobs["train-needle_threading-2"].command
    assert half[half.index("--actor") + 1] == actor and "--actor" not in none and "--kept" not in none
    epochs = [jobs[f"train-spatula_flipping-{seed}"].command for seed in (1, 3)]
    assert [command[command.index("--actor-epochs") + 1] for command in epochs] == ["16", "8"]
    with pytest.raises(InputError, match="no folder of trained networks"):
        Reproduction(out, ("samrl",), False, tmp_path / "nowhere")
