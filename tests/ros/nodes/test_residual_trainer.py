"""The trainer's node: what it records of the cell's messages, what it announces, and how it ends."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.observation import ArmReading
from samrl_core.common.errors import InputError, SolveError
from samrl_core.learning.images.packed_images import network_images
from samrl_core.learning.residual.replay import End, Replay
from samrl_core.learning.residual.training import Announcement, replay_of
from samrl_core.policy.networks.network_image import observed_image
from samrl_core.policy.networks.weights import sha256_of
from samrl_ros.contract.topics import arm_topic, camera_topic, cell_topic
from tests.waiting import PATIENCE_S

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros
CELL = cell_named()
EXECUTED, OUTCOME = cell_topic("manipulator/executed_action"), cell_topic("supervisor/outcome")
REQUEST, ACTION = cell_topic("supervisor/request"), cell_topic("policy/nominal_action")
FRAME = "camera_color_optical_frame"


class Ears:
    """An outbox that remembers."""

    def __init__(self) -> None:
        self.weights: list[dict[str, Any]] = []
        self.logs: list[str] = []

    def publish(self, topic: str, message: Any) -> None:
        assert topic == cell_topic("residual_trainer/weights")
        self.weights.append(json.loads(message.data))

    def log(self, level: str, text: str) -> None:
        self.logs.append(text)

    def call(self, service: str, request: Any, on_response: Any) -> None:
        raise AssertionError("it calls no service")


class NoProcess:
    """Stands for the training, which a test of the records does not need."""

    def __init__(self, folder: Path, task: str, cell: str, weights: str) -> None:
        self.stopped = 0

    def check(self) -> None:
        pass

    def stop(self) -> bool:
        self.stopped += 1
        return True


class FakeCell:
    """Says what the other nodes say, to one trainer; stamps count in steps of 0.1 s."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch | None, **settings: Any) -> None:
        from samrl_ros.conversions import to_message
        from samrl_ros.nodes import residual_trainer as module

        if monkeypatch is not None:
            monkeypatch.setattr(module, "TrainingProcess", NoProcess)
        self.ears, self.folder = Ears(), folder
        self.settings = module.ResidualTrainerSettings(
            train=True, folder=str(folder), capacity=100, first_steps=2, batch=2, publish_every=2, **settings
        )
        self.trainer = module.ResidualTrainer(self.settings, self.ears)
        self.trainer.start()
        self.now = 0
        self.lens = CELL.intrinsics
        self.images: dict[tuple[int, int], np.ndarray] = {}
        self.trainer.handle(camera_topic("calibration"), to_message.calibration(CELL))

    def look(self, rng: np.random.Generator) -> int:
        """One frame of `self.lens` with joint states; returns its stamp."""
        from samrl_ros.conversions import to_message

        self.now += 100_000_000
        k, start = self.lens, task_named("peg_insertion").start_joints(CELL)
        depth = rng.uniform(0.3, 0.5, (k.height, k.width)).astype(np.float32)
        self.color = rng.integers(0, 256, (k.height, k.width, 3), dtype=np.uint8)
        mask = np.zeros((k.height, k.width), dtype=np.uint8)
        self.trainer.handle(
            camera_topic("color/image_raw"), to_message.image(self.color, "rgb8", self.now, FRAME)
        )
        self.trainer.handle(
            camera_topic("depth/image_rect_raw"), to_message.image(depth, "32FC1", self.now, FRAME)
        )
        self.trainer.handle(camera_topic("mask/image_raw"), to_message.image(mask, "mono8", self.now, FRAME))
        self.trainer.handle(camera_topic("color/camera_info"), to_message.camera_info(k, self.now, FRAME))
        for role in ROLES:
            joints = start[role] + rng.uniform(-0.01, 0.01, 7)
            reading = ArmReading(self.now, joints, np.zeros(7), np.zeros(7))
            names = CELL.arm(role).joint_names
            self.trainer.handle(arm_topic(role, "joint_states"), to_message.joint_state(reading, names))
        return self.now

    def act(
        self,
        episode: int,
        step: int,
        *,
        seen: bool = True,
        residual: float = 0.001,
        given_up: bool = False,
        chosen_again: bool = False,
    ) -> None:
        """Update, choice and motion of one step."""
        from samrl_msgs.msg import StepRequest, ToolAction

        from samrl_ros.conversions import to_message

        rng = np.random.default_rng([episode, step])
        self.look(rng)  # before it was asked for: not to be used
        request = StepRequest(
            header=to_message.header(self.now + 1), episode=episode, step=step, stage="update"
        )
        self.trainer.handle(REQUEST, request)
        stamp = self.look(rng)
        self.images[episode, step] = self.color
        self.look(rng)
        stamp = stamp if seen else stamp + 5
        action = ToolAction(header=to_message.header(stamp), episode=episode, step=step)
        action.nominal = to_message.vector(np.array([0.004, 0.0, 0.001 * step]))
        action.residual = to_message.vector(np.array([0.0, residual, 0.0]))
        self.trainer.handle(ACTION, action)
        if chosen_again:
            other = ToolAction(header=to_message.header(stamp), episode=episode, step=step)
            self.trainer.handle(ACTION, other)
        if given_up:
            return
        action.header = to_message.header(self.now)
        action.executed = to_message.vector(np.array([0.004, 0.0009, 0.0]))
        self.trainer.handle(EXECUTED, action)

    def end(self, episode: int, detected: bool, reason: str) -> None:
        from samrl_msgs.msg import Outcome

        outcome = Outcome(episode=episode, detected_success=detected, reason=reason)
        self.trainer.handle(OUTCOME, outcome)

    def replay(self) -> Replay:
        return Replay.read(*replay_of(self.folder, "peg_insertion", CELL, self.settings.training()))


def test_every_action_is_recorded_with_the_image_it_came_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cell = FakeCell(tmp_path, monkeypatch)
    for step in range(3):
        cell.act(0, step)
    cell.end(0, True, "done")
    replay = cell.replay()
    numbers, episodes, steps, ends = replay.outline()
    assert numbers.tolist() == [1, 2, 3] and steps.tolist() == [0, 1, 2] and set(episodes) == {0}
    assert ends.tolist() == [End.OPEN, End.OPEN, End.SUCCESS]
    rows = replay.bodies(numbers)
    for step, row in enumerate(rows):
        assert np.array_equal(row["color"], cell.images[0, step])
        assert np.allclose(row["nominal"], [0.004, 0.0, 0.001 * step])
        assert np.allclose(row["residual"], [0.0, 0.001, 0.0])
        assert np.allclose(row["executed"], [0.004, 0.0009, 0.0])
        assert 0.05 < row["tip"][2] < 0.25  # 0.14 m at the start of the task
    seen = network_images(rows["color"], rows["depth"], rows["camera"], rows["tip"], CELL)
    assert seen.shape == (3, 6, 128, 128) and float(seen[:, 3:].abs().mean()) > 0.1
    assert cell.trainer.status()["transitions"] == "3" and cell.trainer.status()["detected_successes"] == "1"


def test_the_stored_image_is_what_the_policy_saw(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The policy's image of an observation, and the replay's, to the rounding of depth."""
    cell = FakeCell(tmp_path, monkeypatch)
    cell.act(0, 0)
    observation = cell.trainer._frames[next(iter(cell.trainer._frames))]
    row = cell.replay().bodies(np.array([1]))
    stored = network_images(row["color"], row["depth"], row["camera"], row["tip"], CELL)[0]
    wanted = observed_image(observation, row["tip"][0], CELL)
    assert np.allclose(stored.numpy(), wanted.numpy(), atol=2e-3)


def test_ends_are_told_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cell = FakeCell(tmp_path, monkeypatch)
    for episode, (detected, reason) in enumerate(
        [(False, "action_limit"), (False, "error: no answer"), (True, "done")]
    ):
        cell.act(episode, 0)
        cell.end(episode, detected, reason)
    assert cell.replay().outline()[3].tolist() == [End.FAILURE, End.CUT, End.SUCCESS]


def test_an_action_that_was_given_up_cuts_the_chain(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After the reset of an emergency stop the step begins anew; it does not follow from the last action."""
    cell = FakeCell(tmp_path, monkeypatch)
    cell.act(0, 0)
    cell.act(0, 1, given_up=True)
    cell.act(0, 1)
    numbers, episodes, steps, ends = cell.replay().outline()
    assert steps.tolist() == [0, 1] and ends.tolist() == [End.CUT, End.OPEN]
    assert len(set(episodes.tolist())) == 2
    assert np.array_equal(cell.replay().bodies(numbers)[1]["color"], cell.images[0, 1])


def test_an_action_that_was_chosen_twice_is_not_learnt_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A policy was started anew and chose again: what was executed is not what its last image led to."""
    cell = FakeCell(tmp_path, monkeypatch)
    cell.act(0, 0, chosen_again=True)
    assert cell.trainer.status()["missed"] == "1"


def test_an_action_whose_image_was_missed_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cell = FakeCell(tmp_path, monkeypatch)
    cell.act(0, 0)
    cell.act(0, 1, seen=False)
    cell.end(0, True, "done")  # the success belongs to the action that is not there
    assert cell.replay().outline()[3].tolist() == [End.OPEN]
    assert cell.trainer.status()["missed"] == "1" and any("not seen" in text for text in cell.ears.logs)


def test_a_restart_goes_on_in_the_same_replay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = FakeCell(tmp_path, monkeypatch)
    first.act(0, 0)
    first.end(0, False, "action_limit")
    with pytest.raises(InputError, match="another process"):
        FakeCell(tmp_path, monkeypatch)
    first.trainer.stop()
    (tmp_path / "residual_v000007.safetensors").write_bytes(b"weights")
    said = Announcement("peg_insertion", 7, "residual_v000007.safetensors", "ab")
    (tmp_path / "announced.json").write_text(json.dumps(said.__dict__))
    second = FakeCell(tmp_path, monkeypatch)
    assert [w["version"] for w in first.ears.weights + second.ears.weights] == [0, 7]
    # What a run explores with is drawn from this: each one begins at another place.
    assert [w["steps"] for w in first.ears.weights + second.ears.weights] == [0, 1]
    second.act(0, 0)
    second.end(0, True, "done")
    _, episodes, _, ends = second.replay().outline()
    assert episodes.tolist() == [0, 1] and ends.tolist() == [End.FAILURE, End.SUCCESS]


def test_a_new_version_is_announced_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cell = FakeCell(tmp_path, monkeypatch)
    cell.act(0, 0)
    file = tmp_path.resolve() / "x"
    file.write_bytes(b"weights")
    (tmp_path / "announced.json").write_text(
        json.dumps(Announcement("peg_insertion", 1, file.name, "ab").__dict__)
    )
    cell.act(0, 1)
    cell.act(0, 2)
    assert [w["version"] for w in cell.ears.weights] == [0, 1]
    said = {"task": "peg_insertion", "version": 1, "file": str(file), "sha256": "ab", "steps": 2}
    assert cell.ears.weights[1] == said


def test_the_end_of_the_training_is_noticed_between_two_actions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the next message of any kind, such as joint states, which come all the time."""
    cell = FakeCell(tmp_path, monkeypatch)
    cell.act(0, 0)

    def ended() -> None:
        raise SolveError("the training was killed by SIGKILL")

    monkeypatch.setattr(cell.trainer._process, "check", ended)
    with pytest.raises(SolveError, match="SIGKILL"):
        cell.look(np.random.default_rng(0))


@pytest.mark.parametrize(
    "lens",
    [
        replace(CELL.intrinsics, fx=1.01 * CELL.intrinsics.fx),
        replace(CELL.intrinsics, cx=CELL.intrinsics.cx + 0.5),
        Intrinsics.from_fov(64, 64, 0.7),
    ],
    ids=["longer", "off centre", "smaller"],
)
def test_images_of_another_camera_are_not_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lens: Intrinsics
) -> None:
    """Their points would be worked out with the cell's lens when they are learnt from."""
    cell = FakeCell(tmp_path, monkeypatch)
    cell.act(0, 0)
    assert cell.trainer._replay is not None and len(cell.trainer._replay) == 1
    cell.lens = lens
    cell.act(0, 1)
    assert len(cell.trainer._replay) == 1
    assert any(f"the camera publishes {lens}, the cell's is" in text for text in cell.ears.logs)


def test_zero_residuals_alone_are_warned_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cell = FakeCell(tmp_path, monkeypatch)
    for step in range(3):
        cell.act(0, step, residual=0.0)
    assert sum("exploration" in text for text in cell.ears.logs) == 1


def test_by_default_nothing_is_kept_and_the_residual_is_zero() -> None:
    from samrl_ros.nodes.residual_trainer import ResidualTrainer, ResidualTrainerSettings

    ears = Ears()
    trainer = ResidualTrainer(ResidualTrainerSettings(), ears)
    trainer.start()
    assert ears.weights == [{"task": "peg_insertion", "version": 0, "file": "", "sha256": "", "steps": 0}]
    assert camera_topic("color/image_raw") not in trainer.inputs
    trainer.stop()
    with pytest.raises(InputError, match="needs `folder`"):
        ResidualTrainer(ResidualTrainerSettings(train=True), Ears())


def test_a_file_that_is_given_is_in_force_and_stays(tmp_path: Path) -> None:
    from samrl_ros.nodes.residual_trainer import ResidualTrainer, ResidualTrainerSettings

    file = tmp_path / "mine.safetensors"
    file.write_bytes(b"weights")
    ears = Ears()
    trainer = ResidualTrainer(ResidualTrainerSettings(residual=str(file)), ears)
    trainer.start()
    wanted = {"version": 1, "file": str(file.resolve()), "sha256": sha256_of(file), "task": "peg_insertion"}
    assert len(ears.weights) == 1 and wanted.items() <= ears.weights[0].items()
    for other in ({"train": True, "folder": str(tmp_path)}, {"folder": str(tmp_path)}):
        with pytest.raises(InputError, match="stays as it is"):
            ResidualTrainer(ResidualTrainerSettings(residual=str(file), **other), Ears())
    file.unlink()
    with pytest.raises(InputError, match="no residual at"):
        ResidualTrainer(ResidualTrainerSettings(residual=str(file)), Ears()).start()


@pytest.mark.slow
def test_a_process_trains_publishes_and_saves(tmp_path: Path) -> None:
    """The real thing: steps go in, a version comes out; killed, it says so; started anew, it goes on."""
    cell = FakeCell(tmp_path, None, updates_per_step=2.0)
    deadline, step = time.monotonic() + PATIENCE_S, 0
    while len(cell.ears.weights) < 2 and time.monotonic() < deadline:
        cell.act(0, step)
        step += 1
        time.sleep(2.0 if step > 4 else 0.0)
    assert cell.ears.weights[-1]["version"] >= 1 and Path(cell.ears.weights[-1]["file"]).is_file()
    process = cell.trainer._process
    assert process is not None
    process._child.kill()
    process._child.wait()
    with pytest.raises(SolveError, match="killed by SIGKILL"):
        cell.act(0, step)
    cell.trainer.stop()
    again = FakeCell(tmp_path, None)
    assert again.ears.weights[0]["version"] >= cell.ears.weights[-1]["version"]
    again.trainer.stop()
    assert (tmp_path / "settings.json").is_file()
