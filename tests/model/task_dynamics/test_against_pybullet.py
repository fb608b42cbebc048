"""The tasks' physics against the simulated world: the tip moves as it really did, all else is predicted.

Start poses and the parameters of the task's scene are given to both; the model's own contact is not fitted.
"""

from __future__ import annotations

import numpy as np
import pytest
import torch

from samrl_core.cell.tasks.needle_threading.task import NeedleThreading
from samrl_core.cell.tasks.spatula_flipping.task import SpatulaFlipping
from samrl_core.model.task_dynamics.rigid_task_dynamics import TaskPhysics
from tests.model.task_dynamics.recorded import CELL, SAMPLE, pancake_errors, recorded, replayed, thread_errors

torch.set_num_threads(1)


@pytest.mark.thorough
def test_thread_goes_through_the_eye_as_in_the_world() -> None:
    """Over 2 s, within 0.2 mm on the way; 2 cm of it below the eye at the end."""
    task = NeedleThreading()
    real = recorded(task, 0)
    values = replayed(TaskPhysics(task, CELL), real)
    errors = thread_errors(task, real, values)
    print(f"thread: mean {1e3 * errors.mean():.3f} mm, largest {1e3 * errors.max():.3f} mm")
    assert errors.max() < 2e-4
    assert task.is_done(values[-1], real.tips[-1])


def test_pancake_turns_over_as_in_the_world() -> None:
    """Pushed, wedged and lifted by 60 degrees: within 0.5 mm and 1 degree. Then it stands on its rim, where
    it rolls along the lip by chance, some millimetres; it falls at the same time and comes to lie as there.
    """
    task = SpatulaFlipping()
    real = recorded(task, 0)
    values = replayed(TaskPhysics(task, CELL), real)
    errors = pancake_errors(real, values)
    lifted = np.hypot(values[:, 3], values[:, 4]) > np.pi / 3
    up = int(np.argmax(lifted))
    millimetres, degrees = 1e3 * errors[:, 0], np.degrees(errors[:, 1])
    print(f"pancake until 60 deg: {millimetres[:up].max():.2f} mm, {degrees[:up].max():.2f} deg at most")
    print(
        f"whole motion: {millimetres.max():.2f} mm, {degrees.max():.2f} deg; at rest {millimetres[-1]:.2f} mm"
    )
    assert 20 < up < len(values) - 5
    assert millimetres[:up].max() < 0.5 and degrees[:up].max() < 1.0
    assert millimetres.max() < 5.0 and degrees.max() < 5.0
    away = 1e3 * np.abs(values[-1] - real.values[(len(values) - 1) * SAMPLE])
    assert max(away[0], away[2]) < 2.0 and away[1] < 5.0 and degrees[-1] < 1.0
    assert task.is_done(values[-1], real.tips[-1])
