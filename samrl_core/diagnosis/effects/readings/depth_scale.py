"""42: depth scale."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.reading_forms import Polynomial, needs
from samrl_core.diagnosis.residuals.readings.reading_trial import ReadingTrial

FORMS = {"scale": "a", "offset": "b", "square": "c", "line": "ab", "parabola": "abc"}
SPREAD = {"a": 0.02, "b": 0.01, "c": 0.01}  # at 1 m, of what depth cameras are known for


class DepthScale(Effect[ReadingTrial]):
    """Depth is off by a factor, an offset or a part that grows with its square."""

    family, number, title = "depth_scale", 42, "Depth scale"
    meaning = "Depth readings are off by a factor or an offset."
    remedy = "Correct depth by the fitted coefficients, or calibrate on a plane at three or more distances."
    formula = "z_read = (1 + a) z + b + c z^2"
    source = "Intel states 2 % at 2 m; 1.87 % was measured of a D435"
    acts_on = "reading"
    place_kind = "sensor"
    excitation = "a plane at three distances or more"
    confounded_with = ("hand_eye", "intrinsics", "object_geometry")
    parameters = (
        Parameter("a", "1", -0.05, 0.05, "factor less one"),
        Parameter("b", "m", -0.03, 0.03, "offset"),
        Parameter("c", "1/m", -0.03, 0.03, "growth with the square"),
    )
    simulated = False

    def why_unobservable(self, trial: ReadingTrial) -> str | None:
        return needs(trial, "depth")

    def forms(self, trial: ReadingTrial, place: Place) -> tuple[Form[ReadingTrial], ...]:
        powers = {"a": 1, "b": 0, "c": 2}
        return tuple(
            Polynomial(
                name=name, place=place, amplitudes=tuple(terms), powers=tuple(powers[t] for t in terms),
                spreads=tuple(SPREAD[t] for t in terms), surprise=0.0 if name == "scale" else 1.0,
            )
            for name, terms in FORMS.items()
        )  # fmt: skip


EFFECT = DepthScale()
