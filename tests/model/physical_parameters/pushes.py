"""Pushes made by the model itself, whose every parameter is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from samrl_core.model.physical_parameters.identify import IdentifySettings
from samrl_core.model.physical_parameters.push_record import Disc, PushRecord
from samrl_core.model.physical_parameters.push_scene import PushContactSettings, PushScene
from samrl_core.model.physical_parameters.sensitivity import trajectory

DISC = Disc(0.05, 0.012, 0.046)
ARM_MASS = 1.2
PERIOD = 0.0015
CONTACT = PushContactSettings(substeps=2)
SETTINGS = IdentifySettings(contact=CONTACT)
STIFFNESS = 5.0e4


def drive(force: float, push_s: float, total_s: float) -> PushRecord:
    """A blade at rest at 0, pushed by `force` [N], then braked and drawn back; nothing measured yet."""
    steps, push_steps = round(total_s / PERIOD), round(push_s / PERIOD)
    acceleration = np.zeros(steps)
    acceleration[:push_steps] = force / ARM_MASS
    acceleration[push_steps : push_steps + 40] = -20.0
    seen_step = np.arange(0, steps + 1, 20)
    mass = np.full(steps, ARM_MASS)
    return PushRecord(
        PERIOD, push_steps, np.zeros(steps), acceleration, mass, seen_step, np.zeros(len(seen_step))
    )


def theta(mass: float, friction: float, start: float = 0.053) -> torch.Tensor:
    """Parameters of a uniform disc; the blade's face is 1 mm before its tip, so it stands 2 mm off."""
    logs = np.log([mass, friction, 1.0, 0.15, STIFFNESS, 20.0, 1.0, 1.0])
    return torch.tensor([*logs, 0.0, start], dtype=torch.float64)


def made_push(
    mass: float,
    friction: float,
    force: float,
    *,
    push_s: float = 0.16,
    total_s: float = 0.36,
    seed: int = 0,
    settings: IdentifySettings = SETTINGS,
) -> PushRecord:
    """A record with the noise that the settings state."""
    bare = drive(force, push_s, total_s)
    states = trajectory(PushScene(DISC, bare, CONTACT), theta(mass, friction)).numpy()[:: CONTACT.substeps]
    rng = np.random.default_rng(seed)
    tip = states[:-1, 0] + settings.tip_noise * rng.standard_normal(len(states) - 1)
    tip[0] = states[0, 0]
    seen = states[bare.seen_step, 1] + settings.seen_noise * rng.standard_normal(len(bare.seen_step))
    return replace(bare, tip=tip, seen=seen)
