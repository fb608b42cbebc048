"""An effort limit of the description that the machine does not have, told by torques beyond it that act.

A URDF's `effort` is often a placeholder, and an MJCF's range that of another gear. Where the torque is
computed by a law, all beyond the limit is taken off, and what the motion shows of it looks like a cause at
every fast move. The equation of torques says whether it acts: its residual is then what was taken off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from xml.etree import ElementTree

import numpy as np

from samrl_core.cell.robots.urdf_text import parse_urdf
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.result import HeldOutGap, NamedEffect, ParameterEstimate

SHOWS = 0.05  # of the limit, that is taken off, from which on a sample counts
LEAST = 30  # such samples: half a second of a fast move
ACTS = (0.8, 1.25)  # share of what is taken off that the residual holds
MARGIN = 1.2  # of a limit over all that a law asked for in fitted recordings
LEAVES = 0.2  # of the residual's power at those samples, at most, once nothing is taken off


@dataclass(frozen=True)
class ExceededLimits:
    """Joints whose stated limit the log exceeds, and the largest torques that acted there."""

    joints: tuple[int, ...]
    limits: tuple[float, ...]  # of each, as stated [N m]
    reached: tuple[tuple[float, float], ...]  # of each: exceeded by a tenth of those samples, and the largest
    beyond: tuple[float, ...]  # of each: limits that clip nothing of these recordings
    says: str
    before: float  # share of the torque's power that is left at those samples, on fitted recordings
    after: float  # and without the limits
    family: str = "torque_saturation"

    def corrected(self, recording: ArmRecording) -> ArmRecording:
        """The recording with a description whose limits are beyond all that was asked for.

        None at all would leave tolerances, which are shares of a limit, without their unit.
        """
        arm = recording.arm
        wider = {arm.joints[j]: x for j, x in zip(self.joints, self.beyond, strict=True)}
        assert arm.urdf is not None
        root = parse_urdf(arm.urdf, "the URDF")
        for joint in root.findall("joint"):
            if (name := joint.get("name")) in wider and (limit := joint.find("limit")) is not None:
                limit.set("effort", repr(wider[name]))
        controller = arm.controller
        if controller is not None and controller.effort_limit is not None:
            limits = np.array(np.broadcast_to(controller.effort_limit, (len(arm.joints),)), dtype=float)
            limits[list(self.joints)] = self.beyond
            controller = replace(controller, effort_limit=limits)
        text = ElementTree.tostring(root, encoding="unicode")
        return replace(recording, arm=replace(arm, urdf=text, controller=controller))

    def named(self, arm: str, joints: Sequence[str]) -> tuple[NamedEffect, ...]:
        """As effects of the report: the limit is at least what was reached."""
        certain = float(np.clip(1.0 - self.after / max(self.before, 1e-9), 0.0, 0.99))
        return tuple(
            NamedEffect(
                self.family, f"joint:{joints[j]}", certain,
                {"L": ParameterEstimate(most, "N m", (usual, most))}, 0.0, "",
                "secondary" if k else "primary",
            )
            for k, (j, (usual, most)) in enumerate(zip(self.joints, self.reached, strict=True))
        )  # fmt: skip

    def gap(self, trials: Sequence[Trial]) -> HeldOutGap | None:
        """How far the residual shrinks beyond the limits on recordings that were not looked at.

        None where no such recording goes beyond one.
        """
        seen = [Beyond.of(trials, j, limit) for j, limit in zip(self.joints, self.limits, strict=True)]
        if not sum(len(one.off) for one in seen):
            return None
        before, after = (np.sqrt(np.mean(np.concatenate(x) ** 2)) for x in zip(*(
            (one.rest, one.rest + one.off) for one in seen
        ), strict=True))  # fmt: skip
        return HeldOutGap(
            "residual torque where the law asks for more than the stated limit, RMS", "N m", float(before),
            float(after), None, None, 1.0 - float(after / before) if before > 0 else 0.0, None, None, (),
            tuple(t.recording.name for t in trials),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Beyond:
    """Samples (n,) of a joint at which the law asks for more than its stated limit [N m]."""

    off: np.ndarray  # what the limit takes off
    rest: np.ndarray  # residual of the equation with what is left
    asked: np.ndarray  # magnitude of the law's torque

    @classmethod
    def of(cls, trials: Sequence[Trial], joint: int, limit: float) -> Beyond:
        """Of some recordings."""
        off, rest, asked = [], [], []
        for trial in trials:
            law = trial.motion.described_law.total[:, joint]
            beyond = trial.motion.reduce(law - np.clip(law, -limit, limit))
            some = np.abs(beyond) > SHOWS * limit
            off.append(beyond[some])
            rest.append(trial.residual["dynamics"][some, joint])
            asked.append(np.abs(trial.motion.reduce(law)[some]))
        return cls(*map(np.concatenate, (off, rest, asked)))

    @property
    def acts(self) -> bool:
        """Whether what the limit takes off is what the residual holds."""
        power = float(self.rest @ self.rest)
        if len(self.off) < LEAST or power == 0.0:
            return False
        share = -float(self.off @ self.rest) / float(self.off @ self.off)
        return ACTS[0] <= share <= ACTS[1] and self.left <= LEAVES * power

    @property
    def fits_better(self) -> bool:
        """Whether the equation holds better there without the limit."""
        return self.left < float(self.rest @ self.rest)

    @property
    def left(self) -> float:
        """Power of the residual without the limit."""
        return float(np.sum((self.rest + self.off) ** 2))


def find_exceeded_limits(trials: Sequence[Trial]) -> ExceededLimits | None:
    """The stated limits that these recordings exceed; None where every one may stand."""
    first = trials[0]
    if first.rigid is None or not all(t.motion.computed and "dynamics" in t.channels for t in trials):
        return None
    limits = first.motion.limit()
    finite = [j for j in range(first.joints) if np.isfinite(limits[j])]
    beyond = {j: Beyond.of(trials, j, float(limits[j])) for j in finite}
    if not any(one.acts for one in beyond.values()):
        return None
    # One that is a placeholder is seldom alone. Another joint's own cause may hide that its limit is one.
    found = {j: one for j, one in beyond.items() if one.acts or one.fits_better}
    names, worst = first.recording.arm.joints, {j: float(one.asked.max()) for j, one in found.items()}
    said = ", ".join(
        f"{limits[j]:.3g} N m of {names[j]}, where {most:.3g} N m act" for j, most in worst.items()
    )
    power = sum(float(one.asked @ one.asked) for one in found.values())
    before = sum(float(one.rest @ one.rest) for one in found.values()) / power
    after = sum(one.left for one in found.values()) / power
    reached = tuple((float(np.quantile(one.asked, 0.9)), worst[j]) for j, one in found.items())
    stated = tuple(float(limits[j]) for j in found)
    laws = [np.abs(trial.motion.described_law.total).max(axis=0) for trial in trials]
    wider = tuple(MARGIN * float(np.max(laws, axis=0)[j]) for j in found)
    return ExceededLimits(
        tuple(found), stated, reached, wider, f"no torque is limited to {said}", before, after
    )
