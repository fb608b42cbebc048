"""What a user asks of `samrl forge`, and the settings that follow."""

from __future__ import annotations

from dataclasses import dataclass

from samrl_core.blind_test.scores.study import Study
from samrl_core.blind_test.worlds.plan import ForgeSettings
from samrl_ros.blind_test.study import KINDS, by_engine, shares, usual_counts

ENGINES = ("mujoco", "pinocchio")  # beside PyBullet


@dataclass(frozen=True)
class AskedStudy:
    """As it was typed; None where nothing was said and the usual holds."""

    worlds: int | None  # in all
    kinds: dict[str, int | None]  # worlds of each of `KINDS`
    engines: dict[str, int | None]  # worlds by each of `ENGINES`
    second_set: bool  # half of the effects by the disturbances that were written anew
    families: tuple[str, ...]  # the only ones; empty: all
    duration_s: float | None  # of each recording
    stated_friction: bool = False  # models state friction, and arms stick

    def settings(self, study: Study, seed: int) -> ForgeSettings:
        """Settings of a study in a folder, which may hold a part of it.

        Raises:
            InputError: families that nobody knows, or too few for the worlds asked for.
        """
        every, counts = ForgeSettings(), self._counts()
        return ForgeSettings(
            seed=seed,
            second_set=self.second_set,
            duration_s=every.duration_s if self.duration_s is None else self.duration_s,
            families=self.families,
            stated_friction=self.stated_friction,
            **by_engine(study, counts, _usual(every), self.engines),
            **counts,
        )

    def _counts(self) -> dict[str, int]:
        """Worlds of each kind."""
        usual = _usual(ForgeSettings())
        counts = {kind: usual[kind] for kind in KINDS}
        if self.families:
            drawn = ForgeSettings(
                single=0, outside=0, double=0, mujoco=0, pinocchio=0,
                second_set=self.second_set, families=self.families,
            )  # fmt: skip
            counts = usual_counts(len(drawn.library), len(drawn.outside_library), usual)
        if self.worlds is not None:
            counts = shares(self.worlds, counts)
        return counts | {kind: count for kind, count in self.kinds.items() if count is not None}


def _usual(every: ForgeSettings) -> dict[str, int]:
    """Worlds of each kind and by each engine where nothing is asked."""
    return {name: getattr(every, name) for name in (*KINDS, *ENGINES)}
