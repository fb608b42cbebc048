"""The learners by name, and their settings as files hold them."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import torch

from samrl_core.common.errors import InputError
from samrl_core.learning.residual.learner import Learner, LearnerSettings
from samrl_core.learning.residual.td3 import TD3
from samrl_core.policy.networks.networks import Encoder

LEARNERS: dict[str, type[Learner]] = {
    "td3": TD3,
}
DEFAULT_LEARNER = "td3"


def create_settings(name: str, **values: Any) -> LearnerSettings:
    """Settings of a learner, its defaults where no value is given.

    Raises:
        InputError: no learner has this name, or a value is outside its limits.
    """
    return _learner_named(name).Settings(**values)


def create_learner(
    settings: LearnerSettings, encoder: Encoder, seed: int, device: torch.device | str = "cpu"
) -> Learner:
    """The learner that these settings belong to, with weights sampled from the seed."""
    return LEARNERS[name_of(settings)](settings, encoder, seed, device)


def name_of(settings: LearnerSettings) -> str:
    """The name of the learner that settings belong to.

    Raises:
        InputError: they belong to none in `LEARNERS`.
    """
    for name, learner in LEARNERS.items():
        if learner.Settings is type(settings):
            return name
    raise InputError(f"no learner has settings {type(settings).__name__}; there are {', '.join(LEARNERS)}")


def settings_to_json(settings: LearnerSettings) -> dict[str, Any]:
    """The learner's name and its settings, as files hold them."""
    return {"name": name_of(settings), **asdict(settings)}


def update_names(found: dict[str, Any]) -> dict[str, Any]:
    """What an earlier version wrote, by the names of today; TD3 was the only learner then.

    Raises:
        InputError: no learner has the name in it.
    """
    name = found.get("name", "td3")
    old = _learner_named(name).OLD_NAMES
    return {"name": name, **{old.get(key, key): value for key, value in found.items() if key != "name"}}


def settings_from_json(found: dict[str, Any]) -> LearnerSettings:
    """What `settings_to_json` gave.

    Raises:
        InputError: no such learner, or a value outside its limits.
        TypeError: a setting is unknown.
    """
    values = update_names(found)
    return create_settings(values.pop("name"), **values)


def _learner_named(name: str) -> type[Learner]:
    if name not in LEARNERS:
        raise InputError(f"learner is {name!r}, must be one of: {', '.join(LEARNERS)}")
    return LEARNERS[name]
