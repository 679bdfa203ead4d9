"""What the arrays of Albot0's state may be, but those of its maps (see `GeometricMap.restore`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from albot_core.errors import InputError
from albot_core.mappers.albot0.paths import SAMPLE
from albot_core.mappers.stored_arrays import Shape

SHAPES: dict[str, Shape] = {
    "pose": (3,),
    "counts": (4,),
    "path.samples": ("samples", SAMPLE),
    "path.numbers": (2,),
    "path.before": ("paths",),
    "confidences": ("regions",),
    "beliefs": ("beliefs", 4),
    "believed": ("beliefs", 2),
    "rng": (6,),
}
"""The arrays of a state, but those of the maps and the weights."""


def check_path(state: Mapping[str, np.ndarray], readings: int) -> None:
    """Raise InputError unless a robot path in progress is one."""
    samples = state["path.samples"]
    if len(state["path.before"]) > 1:
        raise InputError("path.before", "one heading at most", str(len(state["path.before"])))
    if len(samples) and (
        not np.isin(samples[:, 6:8], (0.0, 1.0)).all()
        or samples[:, 8].min() <= 0
        or samples[:, 9].min() < 0
        or samples[:, 9].max() >= readings
        or (np.diff(samples[:, 9]) < 0).any()
    ):
        raise InputError("path.samples", f"samples of {readings} readings", "others")


def check_beliefs(state: Mapping[str, np.ndarray], regions: int, readings: int) -> None:
    """Raise InputError unless the beliefs are about the ASRs of the way out."""
    weights, beliefs = state["weights"], state["beliefs"]
    if (weights < 0).any() or abs(weights.sum() - 1.0) > 1e-6:
        raise InputError("weights", "shares that sum to 1", str(weights.tolist()))
    if len(state["confidences"]) != regions:
        found = str(len(state["confidences"]))
        raise InputError("confidences", f"one for each of {regions} ASRs", found)
    if (len(beliefs) > 0) != (regions > 0):
        raise InputError("beliefs", "some on the way home only", str(len(beliefs)))
    if len(beliefs) and (
        beliefs[:, :2].min() < 0
        or beliefs[:, 2].min() < -1
        or beliefs[:, 1:3].max() >= regions
        or beliefs[:, 0].max() >= max(readings, 1)
        or (np.diff(beliefs[:, 0]) < 0).any()
        or not np.isin(beliefs[:, 3], (0, 1)).all()
    ):
        raise InputError("beliefs", f"beliefs about {regions} ASRs", "others")
