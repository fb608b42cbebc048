"""Held-out data must be unseen: same file, same content or overlapping blocks are refused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.common.errors import InputError

SHARE = 0.3  # of a recording that is alone, held out
GAP_S = 0.5  # between its fitted part and the other [s]
_RUN = 32  # samples compared at a time; quantised positions alone repeat by chance
_DISTINCT = 8  # different rows that a run needs: an arm at rest is no evidence
_SHARED = 0.05  # share of runs found in the fitted data from which they count as the same


def check_held_out(fit: Sequence[ArmRecording], held_out: Sequence[ArmRecording]) -> None:
    """Blocks of one recording pass as long as they do not overlap.

    Raises:
        InputError: a held-out recording is one that is fitted, or shares samples with it.
    """
    for unseen in held_out:
        for seen in fit:
            if unseen.arm.role != seen.arm.role:
                continue
            if unseen is seen or (_same_file(unseen, seen) and _same_span(unseen, seen)):
                raise InputError(
                    f"held-out recording {unseen.source} is the fitted {seen.source} (sha256"
                    f" {unseen.sha256[:12]}); hold out another recording, or a block of it"
                )
            share = shared_samples(seen, unseen)
            if share > _SHARED:
                raise InputError(
                    f"{100 * share:.0f} % of the held-out recording {unseen.source} is also in the fitted"
                    f" {seen.source}, limit {100 * _SHARED:.0f} %; hold out what was not fitted"
                )


def _same_file(a: ArmRecording, b: ArmRecording) -> bool:
    return bool(a.sha256) and a.sha256 == b.sha256


def _same_span(a: ArmRecording, b: ArmRecording) -> bool:
    return len(a.states) == len(b.states) and bool(np.array_equal(a.states.time, b.states.time))


def shared_samples(seen: ArmRecording, unseen: ArmRecording) -> float:
    """Share of the moving parts of `unseen` whose samples occur, bit for bit and in order, in `seen`."""
    if seen.arm.joints != unseen.arm.joints:
        return 0.0
    quantities = [q for q in ("position", "velocity", "effort") if _has(seen, q) and _has(unseen, q)]
    a, b = (np.hstack([getattr(r.states, q) for q in quantities]) for r in (seen, unseen))
    return shared_runs(a, b, _RUN, _DISTINCT)


def shared_runs(seen: np.ndarray, unseen: np.ndarray, run: int, distinct: int) -> float:
    """Share of the runs of `run` rows of `unseen` (M, K) that occur, bit for bit, in `seen` (N, K).

    Runs of fewer than `distinct` different rows do not count: they repeat by chance.
    """
    a, b = _row_hashes(seen), _row_hashes(unseen)
    if min(len(a), len(b)) < run:
        return 0.0
    places = np.arange(0, len(b) - run + 1, run)
    places = np.array([k for k in places if len(np.unique(b[k : k + run])) >= distinct], dtype=int)
    if not len(places):
        return 0.0
    return float(np.isin(_run_hashes(b, run)[places], _run_hashes(a, run)).mean())


def _has(recording: ArmRecording, quantity: str) -> bool:
    return getattr(recording.states, quantity) is not None


def _row_hashes(values: np.ndarray) -> np.ndarray:
    rows = np.ascontiguousarray(values + 0.0)  # no minus zero
    odd = np.random.default_rng(0).integers(1, 2**62, rows.shape[1], dtype=np.uint64) * 2 + 1
    return (rows.view(np.uint64) * odd).sum(axis=1, dtype=np.uint64)


def _run_hashes(rows: np.ndarray, run: int) -> np.ndarray:
    count = len(rows) - run + 1
    odd = np.random.default_rng(1).integers(1, 2**62, run, dtype=np.uint64) * 2 + 1
    total = np.zeros(count, dtype=np.uint64)
    for k in range(run):
        mixed = rows[k : k + count] ^ (rows[k : k + count] >> np.uint64(29))
        total += mixed * odd[k]
    return total


def block(recording: ArmRecording, begin_s: float, end_s: float) -> ArmRecording:
    """The part between two times [s] of the recording's own axis, which is kept.

    Raises:
        InputError: nothing lies between them.
    """

    def cut(signal: JointSignal | None) -> JointSignal | None:
        if signal is None:
            return None
        keep = (signal.time >= begin_s) & (signal.time < end_s)
        parts = {f.name: getattr(signal, f.name) for f in fields(signal) if f.name != "time"}
        return JointSignal(signal.time[keep], **{q: None if v is None else v[keep] for q, v in parts.items()})

    states = cut(recording.states)
    if states is None or not len(states):
        raise InputError(
            f"no sample of {recording.name} lies between {begin_s} and {end_s} s; it lasts"
            f" {recording.states.time[0]:.3f} to {recording.states.time[-1]:.3f} s"
        )
    return replace(
        recording,
        states=states,
        command=cut(recording.command),
        commanded_effort=cut(recording.commanded_effort),
        phases=tuple(mark for mark in recording.phases if begin_s <= mark[0] < end_s),
    )


def split(
    recording: ArmRecording, held_out_share: float = SHARE, gap_s: float = GAP_S
) -> tuple[ArmRecording, ArmRecording]:
    """First part to fit, last part to hold out, with a gap [s] between, so that they share no transient.

    Raises:
        InputError: a share outside 0.1 to 0.9, or a recording too short for the gap.
    """
    begin, end = recording.states.time[0], recording.states.time[-1]
    if not 0.1 <= held_out_share <= 0.9:
        raise InputError(f"held_out_share is {held_out_share}, must be between 0.1 and 0.9")
    border = end - held_out_share * (end - begin)
    if not 0 <= gap_s < 0.5 * (border - begin):
        raise InputError(
            f"a gap of {gap_s} s does not fit a recording of {end - begin:.2f} s; shorten it or record longer"
        )
    return block(recording, begin, border - gap_s), block(recording, border, np.inf)
