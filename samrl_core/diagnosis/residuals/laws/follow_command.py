"""What of a measured signal follows from the command, and so holds no noise that the residual holds too.

A law is read at measured states. Their noise is in its residual, times the gains; what the drive read and
nobody logged is in it as well, shakes the machine, and comes back in every logged state (closed loop). Either
makes a law with other gains seem to fit better: errors in variables. The command knows nothing of both. So a
term of the law is regressed on signals of the command first, and what they foretell of it stands for it: two
stages of least squares with the command as instrument (Soderstrom and Stoica 1989, chapter 8; for robots
Janot, Vandanjon and Gautier 2014, "A generic instrumental variable approach for industrial robot
identification"). The size that is fitted to it has no bias, whatever the term holds besides.
"""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.basis_functions import smooth_sign
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.residuals.signals.signal_noise import white_noise

LAGS_S = (0.0, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32)  # ASSUMPTION: a loop remembers its command for so long
TURNS = 0.1  # of a command's typical speed: width of the friction's sign
FOREIGN = 0.2  # of a law's own noise: so much that the recorded torque lacks is no noise of the controller
BIASED = 0.005  # share of a term's variance that may be noise: so much is a fitted size off by it
ALIKE = 1e-6  # singular values below this share of the largest are one signal twice


def reads_what_is_logged(motion: RecordedMotion) -> np.ndarray:
    """Joints (J,) whose recorded torque holds what the law makes of the log's noise: it is no error then."""
    if motion.asked is None:
        return np.zeros(motion.joints, dtype=bool)
    return _unlogged_noise(motion) <= FOREIGN * white_noise(motion.described_law.total, motion.rate)


def sure_part(motion: RecordedMotion, terms: np.ndarray) -> np.ndarray:
    """Terms (K, F, J) of a law without noise that its controller did not read itself.

    Terms themselves where that noise is too little to bias a size: what only follows from the command lacks
    what friction makes of it, and where residuals are weighed that passes for a weaker law.
    """
    if motion.asked is None:
        return part_that_follows(motion, terms)
    own = reads_what_is_logged(motion)
    if np.all(own):
        return terms
    # What the drive read and nobody logged shakes the machine: it is in the term as large as it shows.
    unlogged = _unlogged_noise(motion)
    noise = np.stack([np.hypot(unlogged, white_noise(term, motion.rate)) for term in terms])
    seen = np.stack([np.var(motion.reduce(term), axis=0) for term in terms])
    quiet = motion.band_share * noise**2 <= BIASED * seen
    return np.where((own | quiet)[:, None, :], terms, part_that_follows(motion, terms))


def _unlogged_noise(motion: RecordedMotion) -> np.ndarray:
    """Standard deviation (J,) of the noise by which the recorded torque and the law of the log differ."""
    assert motion.asked is not None
    return white_noise(motion.described_law.total - motion.asked, motion.rate)


def part_that_follows(motion: RecordedMotion, terms: np.ndarray) -> np.ndarray:
    """What the command foretells of signals (K, F, J) within the band, joint by joint, (K, F, J)."""
    full = _signals_of_command(motion)
    out = np.empty_like(terms)
    for j in range(motion.joints):
        signals = _lagged(full[:, :, j], motion.rate)
        weights = _weights(motion.reduce(signals), motion.reduce(terms[:, :, j].T))
        out[:, :, j] = (signals @ weights).T
    return out


def span_of_command(motion: RecordedMotion, joint: int) -> np.ndarray:
    """Orthonormal signals (N, S) that span what the command of a joint foretells within the band."""
    seen = motion.reduce(_lagged(_signals_of_command(motion)[:, :, joint], motion.rate))
    size = np.maximum(np.sqrt(np.mean(seen**2, axis=0)), 1e-300)
    basis, values, _ = np.linalg.svd(seen / size, full_matrices=False)
    return np.asarray(basis[:, values > ALIKE * values[0]])


def _weights(seen: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Of signals (N, S), so that they are nearest to others (N, K); (S, K)."""
    size = np.maximum(np.sqrt(np.mean(seen**2, axis=0)), 1e-300)
    return np.asarray(np.linalg.lstsq(seen / size, wanted, rcond=ALIKE)[0] / size[:, None])


def _signals_of_command(motion: RecordedMotion) -> np.ndarray:
    """What a loop may answer to (F, S, J): torque of the model along the command, weight, speed, its sign."""
    command, rigid, step = motion.command, motion.arm, 1.0 / motion.rate
    assert command is not None and command.position is not None and command.velocity is not None
    told = motion.smooth(command.position)
    speed = np.gradient(told, step, axis=0)
    position = told
    assert motion.controller is not None
    unheld = np.broadcast_to(motion.controller.stiffness, (motion.joints,)) <= 0
    if np.any(unheld):  # a speed loop: where it is follows from nothing but where it was
        speed = np.where(unheld, motion.smooth(command.velocity), speed)
        position = np.where(unheld, motion.full_position, told)
    typical = np.maximum(np.sqrt(np.mean(speed**2, axis=0)), 1e-9)
    signals = [np.ones_like(speed), speed, smooth_sign(speed, TURNS * typical)]
    if rigid is not None:
        still = np.zeros_like(speed)
        weight = rigid.inverse_dynamics(position, still, still)
        moved = rigid.inverse_dynamics(position, speed, np.gradient(speed, step, axis=0))
        signals += [weight, moved - weight]
    return np.stack(signals, axis=1)


def _lagged(signals: np.ndarray, rate: float) -> np.ndarray:
    """Signals (F, S) now and some time ago, (F, S times lags); the start is held."""
    count = len(signals)
    shifts = sorted({round(lag * rate) for lag in LAGS_S})
    source = [np.maximum(np.arange(count) - shift, 0) for shift in shifts if shift < count]
    return np.concatenate([signals[index] for index in source], axis=1)
