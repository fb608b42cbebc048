"""What shows in images and is no effect of the library: it passes under no other name, nor as no gap."""

from __future__ import annotations

from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.image_forms import AddedColumns, ImageColumns
from samrl_core.diagnosis.kinds.suspects import Suspect, explained, strongest
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit

_MASKS = "masks are larger or smaller than what they show"
_OUTLINES = ("outline_object", "outline_tip")
# In words, the columns that it is made of, and standard deviations of its amplitudes before any data: one
# for all columns together (a segmenter grows everything alike), or one each.
SUSPECTS: tuple[tuple[str, tuple[str, ...], tuple[float, ...]], ...] = (
    ("the tool sits elsewhere in the hand", ("held",), (*(0.005,) * 3, *(0.02,) * 3)),
    (_MASKS, _OUTLINES, (2.0,)),
    (_MASKS, _OUTLINES, (2.0, 2.0)),
    ("depth lies beside colour", ("depth_shift",), (0.02, 0.02)),
    ("the light has another hue, or the white balance is off", ("tint",), (0.2, 0.2)),
)


class ImageSuspect(Suspect[ImageTrial]):
    """Errors of `SUSPECTS`."""

    acts_on = "reading"

    def forms(self, trial: ImageTrial, place: Place) -> tuple[Form[ImageTrial], ...]:
        return tuple(
            (AddedColumns if len(spreads) == 1 else ImageColumns)(
                name=words, place=place, amplitudes=tuple("abcdef"[: len(spreads)]), columns_of=names,
                spreads=spreads,
            )
            for words, names, spreads in SUSPECTS
        )  # fmt: skip


def image_suspicions(evidence: Evidence, chosen: Fit | None, least: float) -> list[str]:
    """The suspect that explains the images better than what was chosen, or than nothing, in words."""
    trial = evidence.likelihood.trials[0]
    assert isinstance(trial, ImageTrial)
    return strongest(explained(evidence, ImageSuspect(), trial), chosen, least, ": that")
