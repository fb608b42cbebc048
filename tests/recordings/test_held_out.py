from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.recordings import block, check_held_out, split


def other(motion: ArmRecording, seed: int = 1) -> ArmRecording:
    assert motion.states.position is not None
    noise = np.random.default_rng(seed).normal(size=(600, 7)) * 1e-6
    return replace(
        motion, sha256=f"{seed}" * 64, states=replace(motion.states, position=motion.states.position + noise)
    )


def test_another_recording_passes(motion: ArmRecording) -> None:
    check_held_out([motion], [other(motion)])


def test_the_same_file_is_refused(motion: ArmRecording) -> None:
    with pytest.raises(InputError, match=r"is the fitted .*hold out another"):
        check_held_out([other(motion), motion], [replace(motion, name="copy")])


def test_the_same_content_under_another_name_is_refused(motion: ArmRecording) -> None:
    copied = replace(motion, source="copy.mcap", sha256="f" * 64)
    with pytest.raises(InputError, match=r"100 % of the held-out recording copy\.mcap is also in the fitted"):
        check_held_out([motion], [copied])


def test_an_overlapping_block_is_refused_and_a_separate_one_passes(motion: ArmRecording) -> None:
    fit, held_out = split(motion, held_out_share=0.3, gap_s=0.2)
    assert fit.states.time[-1] < 1.9 and held_out.states.time[0] >= 2.0
    assert fit.command is not None and held_out.command is not None
    check_held_out([fit], [held_out])
    with pytest.raises(InputError, match="% of the held-out"):
        check_held_out([block(motion, 0.0, 2.5)], [held_out])


def test_the_other_arm_of_the_same_bag_passes(motion: ArmRecording) -> None:
    check_held_out([motion], [replace(motion, arm=replace(motion.arm, role="camera_arm"))])


def test_coarse_encoders_are_not_taken_for_copies(motion: ArmRecording) -> None:
    def coarse(phase: float, sha: str) -> ArmRecording:
        time = np.arange(2000) * 0.001
        position = np.round(0.3 * np.sin((5 + phase) * time + phase)[:, None] * 4096 / 6.28) * 6.28 / 4096
        arm = replace(motion.arm, joints=("x",))
        return replace(motion, sha256=sha, arm=arm, states=JointSignal(time, position))

    check_held_out([coarse(0.0, "a")], [coarse(0.7, "b")])


@pytest.mark.parametrize(("share", "gap"), [(0.0, 0.1), (1.0, 0.1), (0.3, 5.0), (0.3, -1.0)])
def test_impossible_splits_are_refused(motion: ArmRecording, share: float, gap: float) -> None:
    with pytest.raises(InputError):
        split(motion, share, gap)


def test_an_empty_block_is_refused(motion: ArmRecording) -> None:
    with pytest.raises(InputError, match="lasts"):
        block(motion, 10.0, 20.0)
