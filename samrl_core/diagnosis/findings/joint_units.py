"""Units of a result where joints slide: effects are written for joints that turn."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import replace

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.diagnosis.recordings.units import joint_kinds
from samrl_core.diagnosis.result import Curve, Diagnosis, LeastSize, NamedEffect

_UNIT = re.compile(r"(?<=\[)[^\]]*(?=\]$)")  # at the end of an axis' label
_QUANTITY = re.compile(r"(?<=\d )(rad/s|rad|N m)\b")  # in a sentence


def with_joint_units(diagnosis: Diagnosis, arm: ArmDescription) -> Diagnosis:
    """The same result with m for rad and N for N m at the joints that the URDF calls prismatic."""
    kinds = {} if arm.urdf is None else joint_kinds(arm.urdf)
    sliding = {name for name in arm.joints if name in kinds and kinds[name].prismatic}
    if not sliding:
        return diagnosis
    d, gap = diagnosis, diagnosis.gap
    if gap is not None:
        all_slide = sliding == set(arm.joints)
        channels = tuple(
            (quantity, sliding_unit(unit) if all_slide else _either(unit), *values)
            for quantity, unit, *values in gap.channels
        )
        gap = replace(gap, channels=channels)
    return replace(
        d,
        reasons=tuple(_sentence(text, sliding) for text in d.reasons),
        alarms=tuple(_sentence(text, sliding) for text in d.alarms),
        effects=tuple(_effect(e, sliding) for e in d.effects),
        runner_ups=tuple(_effect(e, sliding) for e in d.runner_ups),
        tracked=tuple(_effect(e, sliding) for e in d.tracked),
        nearest=None if d.nearest is None else _effect(d.nearest, sliding),
        gap=gap,
        least_sizes=tuple(_least_size(one, sliding) for one in d.least_sizes),
        curves=tuple(_curve(c, sliding) for c in d.curves),
        overlays=tuple(
            replace(o, unit=sliding_unit(o.unit)) if o.joint in sliding else o for o in d.overlays
        ),
    )


def sliding_unit(unit: str) -> str:
    """The unit for a sliding joint: `N m s/rad` becomes `N s/m`."""
    return unit.replace("kg m2", "kg").replace("N m", "N").replace("rad", "m")


def _either(unit: str) -> str:
    other = sliding_unit(unit)
    return unit if other == unit else f"{unit} or {other}"


def _sentence(text: str, sliding: Collection[str]) -> str:
    """Quantities of a sentence about an effect at one joint."""
    place = re.search(r"@joint:(\S+?)\b(?=[ :,]|$)", text)
    if place is None or place.group(1) not in sliding:
        return text
    return _QUANTITY.sub(lambda m: sliding_unit(m.group()), text)


def _effect(effect: NamedEffect, sliding: Collection[str]) -> NamedEffect:
    parameters = {}
    for name, estimate in effect.parameters.items():
        slides = _joint_of(effect.place, name) in sliding
        parameters[name] = replace(estimate, unit=sliding_unit(estimate.unit)) if slides else estimate
    return replace(effect, parameters=parameters)


def _least_size(one: LeastSize, sliding: Collection[str]) -> LeastSize:
    slides = _joint_of(one.effect.partition("@")[2], one.parameter) in sliding
    return replace(one, unit=sliding_unit(one.unit)) if slides else one


def _joint_of(place: str, parameter: str) -> str:
    """The joint that a parameter is of: an arm's effect names it with each value."""
    return parameter.partition("[")[2].rstrip("]") or place.removeprefix("joint:")


def _curve(curve: Curve, sliding: Collection[str]) -> Curve:
    joint = curve.y_label.partition(" [")[0].rpartition(" ")[2]  # "... residual of JOINT [unit]"
    if joint not in sliding:
        return curve
    x, y = (_UNIT.sub(lambda m: sliding_unit(m.group()), label) for label in (curve.x_label, curve.y_label))
    return replace(curve, x_label=x, y_label=y)
