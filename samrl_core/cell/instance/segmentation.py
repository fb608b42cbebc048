"""Segmentation: what a mask says that is not so, beyond the nominal ragged boundary and blobs."""

from __future__ import annotations

from dataclasses import dataclass

from samrl_core.cell.instance.difference import difference

_NETWORK = (
    "ASSUMPTION: a segmenter trained on a few hundred images; miss rates of 1 to 5 % per object and image"
)


@dataclass(frozen=True, eq=False)
class Segmentation:
    """Probabilities are per label and image."""

    miss: float = difference("a label is missing from an image", "-", "share", 0.01, 0.05, _NETWORK)
    merge: float = difference(
        "a label takes part of a neighbour's region", "-", "share", 0.02, 0.08, _NETWORK
    )
    foreign: float = difference("a patch of background has a label", "-", "share", 0.02, 0.08, _NETWORK)
    boundary: float = difference(
        "standard deviation of the boundary's place beyond the nominal 0.6 px",
        "px",
        "share",
        0.3,
        0.9,
        _NETWORK,
    )
    growth: float = difference("boundaries moved outwards all around", "px", "normal", 0.3, 0.8, _NETWORK)
