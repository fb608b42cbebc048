"""Every family that is linear in its parameters, at every place, as columns over the torque residuals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.blind_test.baselines.samples import EquationSamples

DELAYS = (0.002, 0.005, 0.010, 0.020)  # [s], variants of delay and low-pass, each fitted alone
MIDDLE_DELAY = (0.010,)  # [s], the one variant of fits of everything at once
SIGN_VELOCITY = 0.02  # [rad/s], smoothing of the sign
STRIBECK_VELOCITY = 0.1  # [rad/s], middle of the catalogue's range
CONTROLLER, DRIVE, LINK = 0, 1, 2  # residuals of `EquationSamples`


@dataclass(frozen=True, eq=False)
class Candidate:
    """A family at a place: its columns where they are not zero.

    `columns` (N, B, K): B rows per sample, named by `rows` as (residual, joint); `ranges` (K,) is the upper
    end of the catalogue's range of each coefficient.
    """

    family: str
    place: str
    rows: tuple[tuple[int, int], ...]
    columns: np.ndarray
    ranges: np.ndarray


def candidates(s: EquationSamples, delays: Sequence[float]) -> Iterator[Candidate]:
    """Drive effects act between commanded effort and motion, body effects on both efforts."""
    for j, joint in enumerate(s.joints):
        yield from _joint(s, j, f"joint:{joint}", delays)
    both = tuple((r, j) for r in (DRIVE, LINK) for j in range(len(s.joints)))
    for k, link in enumerate(s.links):
        spans = np.array([0.4, 0.04, 0.04, 0.04])  # kg, kg m: 20 % of links of about 2 kg, and 2 cm
        yield Candidate("link_inertia", f"link:{link}", both, _twice(s.regressor[:, :, k, :4]), spans)
    payload = s.regressor[:, :, -1, :4]
    yield Candidate("payload", f"arm:{s.role}", both, _twice(payload), np.array([1.0, 0.1, 0.1, 0.1]))
    yield Candidate("base_tilt", f"arm:{s.role}", both, _twice(s.tilt), np.full(2, np.deg2rad(2.0)))


def _joint(s: EquationSamples, j: int, place: str, delays: Sequence[float]) -> Iterator[Candidate]:
    q, dq, u = s.q[:, j], s.dq[:, j], s.commanded[:, j]
    sign, one = np.tanh(dq / SIGN_VELOCITY), np.ones_like(q)
    drive = ((DRIVE, j),)

    def at(
        family: str, rows: tuple[tuple[int, int], ...], columns: list[np.ndarray], ranges: list[float]
    ) -> Candidate:
        return Candidate(family, place, rows, np.stack(columns, axis=-1)[:, None], np.array(ranges))

    yield at("coulomb_friction", drive, [sign], [1.5])
    yield at("viscous_friction", drive, [dq], [2.0])
    yield at("stribeck_friction", drive, [sign, sign * np.exp(-((dq / STRIBECK_VELOCITY) ** 2))], [1.5, 0.5])
    yield at("load_dependent_friction", drive, [np.abs(s.rigid[:, j]) * sign], [0.1])
    yield at("friction_asymmetry", drive, [np.abs(sign)], [0.5])
    yield at(
        "position_dependent_friction", drive, [sign * np.sin(q), sign * np.cos(q), sign], [0.5, 0.5, 1.5]
    )
    yield at("thermal_friction", drive, [sign, sign * s.time / max(s.time.max(), 1e-9)], [1.5, 0.5])
    yield at("reflected_inertia", drive, [s.ddq[:, j]], [0.1])
    yield at("actuator_gain", drive, [u], [0.1])
    for delay in delays:
        yield at("command_delay", drive, [u - s.delayed[delay][:, j]], [1.0])
        yield at("command_low_pass", drive, [u - s.lagged[delay][:, j]], [1.0])
    yield at(
        "controller_gain", ((CONTROLLER, j),), [s.gain_terms[0][:, j], s.gain_terms[1][:, j]], [0.3, 0.3]
    )
    yield at("torque_sensor_error", ((LINK, j),), [s.rigid[:, j], one], [0.1, 0.5])
    both = ((DRIVE, j), (LINK, j))
    spring = np.stack([q - q.mean(), one], axis=-1)
    yield Candidate("cable", place, both, np.stack([spring, spring], axis=1), np.array([2.0, 2.0]))
    everywhere = tuple((r, i) for r in (DRIVE, LINK) for i in range(len(s.joints)))
    offset = s.position_derivative[:, :, j, None]
    yield Candidate("encoder_offset", place, everywhere, _twice(offset), np.array([0.02]))
    round_ = np.concatenate([offset * np.sin(q)[:, None, None], offset * np.cos(q)[:, None, None]], axis=2)
    yield Candidate("encoder_eccentricity", place, everywhere, _twice(round_), np.array([0.005, 0.005]))


def _twice(columns: np.ndarray) -> np.ndarray:
    """The same columns on the drive's residual and on the link's."""
    return np.concatenate([columns, columns], axis=1)


def whitened(s: EquationSamples) -> np.ndarray:
    """(N, 3, J): residuals as fractions of the joints' effort limits."""
    return np.stack(s.residuals, axis=1) / s.limits


def whitened_columns(s: EquationSamples, c: Candidate) -> np.ndarray:
    """(N, B, K): columns in the same unit as `whitened`."""
    return c.columns / s.limits[[j for _, j in c.rows]][None, :, None]


def picked(residual: np.ndarray, c: Candidate) -> np.ndarray:
    """(N, B): the residual's rows that a candidate acts on."""
    return residual[:, [r for r, _ in c.rows], [j for _, j in c.rows]]
