"""A whole training, as small as can be: its stages, and going on where it was."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.common.errors import InputError
from samrl_core.learning.data.fit import FitSettings
from samrl_core.learning.sim.train import CONFIG, train
from samrl_core.learning.sim.train_picture import write_picture
from samrl_core.learning.sim.train_settings import Q_TARGETS, TrainSettings
from samrl_core.policy.networks.weights import load_weights, shipped
from tests.waiting import wait_for

TASK = "peg_insertion"
SMALL = TrainSettings(
    states=100,
    rounds=1,
    round_episodes=2,
    episodes=16,
    judged=1,
    group=2,
    actor=FitSettings(epochs=1, batch_size=16),
    q=FitSettings(epochs=1, batch_size=16),
    workers=1,
)


def test_a_folder_of_another_training_is_refused(tmp_path: Path) -> None:
    (tmp_path / CONFIG).write_text(json.dumps({"schema": 1, "task": TASK, "seed": 5}))
    with pytest.raises(InputError, match="another training"):
        train(TASK, tmp_path, SMALL)
    for broken in ("{", "[1]"):
        (tmp_path / CONFIG).write_text(broken)
        with pytest.raises(InputError, match="cannot be read"):
            train(TASK, tmp_path, SMALL)


@pytest.mark.parametrize("name", ["states", "rounds", "episodes", "judged", "group"])
def test_sizes_below_their_least_are_refused(name: str) -> None:
    with pytest.raises(InputError, match=name):
        replace(SMALL, **{name: -1})


def test_an_unknown_target_of_q_is_refused() -> None:
    with pytest.raises(InputError, match="q_target"):
        replace(SMALL, q_target="luck")
    with pytest.raises(InputError, match="q_loss"):
        replace(SMALL, q_loss="hinge")


def test_what_a_later_stage_could_not_use_is_refused_at_once() -> None:
    with pytest.raises(InputError, match="at least 16"):
        replace(SMALL, episodes=15)
    with pytest.raises(InputError, match="smaller batch"):
        replace(SMALL, actor=FitSettings(batch_size=96))


def test_workers_end_with_their_training(tmp_path: Path) -> None:
    """Also when it is killed outright."""
    script = tmp_path / "parent.py"
    script.write_text(
        "import os, time\nfrom samrl_core.common.executor import worker_pool\n"
        "if __name__ == '__main__':\n"
        "    with worker_pool(1) as pool:\n"
        "        print(pool.submit(os.getpid).result(), flush=True)\n"
        "        time.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        worker = int(parent.stdout.readline())
        os.kill(worker, 0)  # it is there
        parent.kill()

    def is_gone() -> bool:
        try:
            return "Z (zombie)" in Path(f"/proc/{worker}/status").read_text()
        except OSError:
            return True

    wait_for(is_gone, "the worker's end", 0.05)


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("q_target", Q_TARGETS)
def test_a_killed_training_goes_on(tmp_path: Path, q_target: str) -> None:
    """Killed in the middle of its parts; in the end the same weights and figures as one in one go."""
    small = replace(SMALL, q_target=q_target)
    folder, told = tmp_path / "two", []
    moments = ("round-0", "groups", 1), ("round-0", "labelled", 40), ("episodes", "groups", 3)
    for stage, name, most in (*moments, ("judged", "groups", 1)):
        before = len(told)
        told += _killed_at(stage, name, most, q_target, folder)
        assert len(told) > before
    summary = train(TASK, folder, small, lambda at, row: told.append((at, dict(row))))
    # What is there is not made again: each part is told of once when it is made, once where it goes on.
    groups = [row["groups"] for at, row in told if at == "episodes" and "success" in row]
    assert groups == [1, 2, 3, 4, 5, 6, 7, 8]
    assert [row["groups"] for at, row in told if at == "round-0" and "success" in row] == [1, 2]
    assert train(TASK, tmp_path / "one", small) == summary
    one, two = ((tmp_path / f / "round-0" / "labelled.npz").read_bytes() for f in ("one", "two"))
    assert one == two
    for kind in ("sim_actor", "sensing_q"):
        one, two = (
            load_weights(tmp_path / f / f"{TASK}_{kind}.safetensors", kind, TASK, cell_named())
            for f in ("one", "two")
        )
        for name, value in one[0].state_dict().items():
            np.testing.assert_array_equal(value.numpy(), two[0].state_dict()[name].numpy(), err_msg=name)
    write_picture(tmp_path / "two", summary, tmp_path / "two" / "summary.png")
    assert (tmp_path / "two" / "summary.png").stat().st_size > 10_000


def _killed_at(
    stage: str, name: str, most: int, q_target: str, folder: Path
) -> list[tuple[str, dict[str, float]]]:
    """Rows that a training told until it got SIGKILL, at once when a row of `stage` has `most` of `name`."""
    script = (
        "import json, os, signal, sys\nfrom dataclasses import replace\nfrom pathlib import Path\n"
        "sys.path.insert(0, sys.argv[1])\nfrom test_train import SMALL, TASK, train\n"
        "stage, name, most, q_target, folder = sys.argv[2:]\n"
        "def tell(at, row):\n"
        "    print('row', json.dumps([at, dict(row)]), flush=True)\n"
        "    if at == stage and row.get(name) == int(most):\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "if __name__ == '__main__':\n"
        "    train(TASK, Path(folder), replace(SMALL, q_target=q_target), tell)\n"
    )
    file = folder.parent / "killed.py"
    file.write_text(script)
    arguments = [str(Path(__file__).parent), stage, name, str(most), q_target, str(folder)]
    done = subprocess.run([sys.executable, str(file), *arguments], stdout=subprocess.PIPE, text=True)
    assert done.returncode == -signal.SIGKILL, done.stdout
    rows = [json.loads(line[4:]) for line in done.stdout.splitlines() if line.startswith("row ")]
    return [(at, row) for at, row in rows]


@pytest.mark.slow
def test_the_q_of_a_given_actor(tmp_path: Path) -> None:
    """Nothing is drawn or learned for the actor; the folder goes on with the same actor alone."""
    told: list[str] = []
    given = shipped(TASK, "sim_actor")
    train(TASK, tmp_path, SMALL, lambda at, row: told.append(at), given)
    assert "states" not in told and "actor-0" not in told and "q" in told
    kept, _ = load_weights(tmp_path / given.name, "sim_actor", TASK, cell_named())
    wanted, _ = load_weights(given, "sim_actor", TASK, cell_named())
    for name, value in wanted.state_dict().items():
        torch.testing.assert_close(kept.state_dict()[name], value, rtol=0.0, atol=0.0)
    with pytest.raises(InputError, match="given_actor"):
        train(TASK, tmp_path, SMALL)
    with pytest.raises(InputError, match="sim_actor"):
        train(TASK, tmp_path / "other", SMALL, given=shipped(TASK, "sensing_q"))
