"""A rotor at a fixed base and its link turn alike, whatever noise the velocity has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.diagnosis.effects.drive.reflected_inertia import EFFECT as ROTOR
from samrl_core.diagnosis.effects.load.link_inertia import EFFECT as LINK
from tests.diagnosis import worlds
from tests.diagnosis.cases import find_form

SHAKE = 6e-4  # speed of what shakes the base at 15 Hz, a little above the reading's noise [rad/s]
HZ = 15.0
ABOUT_Z = 9  # of a link's inertial parameters: about the vertical


def test_the_first_joints_rotor_and_its_link_have_one_column() -> None:
    """Up to 13 Hz alone the rotor had it: of a lighter one in a Panda's base the link was named, for sure."""
    (recording,) = worlds.world(3, "B")
    time, position, velocity = recording.states.time, recording.states.position, recording.states.velocity
    assert position is not None and velocity is not None
    turned = np.zeros_like(velocity)
    turned[:, worlds.TURN] = 1.0
    phase = (2.0 * np.pi * HZ * time)[:, None]
    states = replace(
        recording.states,
        position=position - SHAKE / (2.0 * np.pi * HZ) * np.cos(phase) * turned,
        velocity=velocity + SHAKE * np.sin(phase) * turned,
        effort=None,
    )
    (trial,) = worlds.trials([replace(recording, states=states)])
    rotor = find_form(ROTOR, trial, "joint:turn", "").columns(trial, {})
    link = find_form(LINK, trial, "link:post", "").columns(trial, {})
    (key,) = set(rotor) & {k for k in link if k[1] == worlds.TURN}
    missing = rotor[key][0] - link[key][ABOUT_Z]
    shaken = SHAKE * 2.0 * np.pi * HZ / np.sqrt(2.0)  # rms [rad/s2]
    assert np.sqrt(np.mean(missing**2)) < 0.1 * shaken
