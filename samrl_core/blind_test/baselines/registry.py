"""The baselines by name; each takes the recordings that may be fitted and names one cause or none."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from samrl_core.blind_test.baselines.claim import Claim
from samrl_core.blind_test.baselines.least_squares import all_parameters, argmin_rmse
from samrl_core.blind_test.baselines.mujoco_sysid import mujoco_sysid
from samrl_core.blind_test.baselines.sparse_regression import sparse_regression
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.common.errors import InputError

BASELINES: dict[str, Callable[[Sequence[ArmRecording]], Claim]] = {
    "argmin_rmse": argmin_rmse,
    "all_parameters": all_parameters,
    "sparse_regression": sparse_regression,
    "mujoco_sysid": mujoco_sysid,
}


def baseline(name: str) -> Callable[[Sequence[ArmRecording]], Claim]:
    """By name. Raises `InputError` with the known ones."""
    if name not in BASELINES:
        raise InputError(f"no baseline {name}; there are {sorted(BASELINES)}")
    return BASELINES[name]
