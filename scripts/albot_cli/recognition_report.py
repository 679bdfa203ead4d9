"""What `albot map --recognition` tells: how surely places are recognised."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from albot_core.evaluation.recognition import draw_precision_recall, measure_recognition
from albot_core.evaluation.trajectory import Trajectory
from albot_core.logs.log import Log

_TOLERANCE = 0.01
"""Stamps of one moment differ by no more than this (s)."""


def recognition_figures(
    log: Log, truth: Trajectory | None, believed: Trajectory
) -> dict[str, Any] | None:
    """How surely the log's places are recognised; None where the truth is not known throughout.

    `recall` is the share of the queries that are recognised without any false alarm, and with
    one claim in a hundred, and in twenty, false; `curve` holds recall and precision. `detection`
    is the share of the pairs near each other that are found with no false alarm among all others,
    and with one in a hundred.
    """
    if truth is None:
        return None
    at = np.clip(np.searchsorted(truth.stamps, log.stamps - _TOLERANCE), 0, len(truth.stamps) - 1)
    if (np.abs(truth.stamps[at] - log.stamps) > _TOLERANCE).any():
        return None
    found = measure_recognition(log.readings, truth.poses[at], believed.poses)
    return {
        "queries": found.queries,
        "claims": len(found.scores),
        "recall": {share: found.recall_at(float(share)) for share in ("1.00", "0.99", "0.95")},
        "curve": found.curve.tolist(),
        "pairs": {
            "near": int(found.pair_near.sum()),
            "others": int((~found.pair_near).sum()),
            "detection": {rate: found.detection_at(float(rate)) for rate in ("0.00", "0.01")},
        },
    }


def draw_recognition(folder: Path, title: str, figures: dict[str, Any]) -> str:
    """Draw the curve into a folder; return the picture's path."""
    path = folder / "recognition.png"
    draw_precision_recall(path, title, np.reshape(figures["curve"], (-1, 2)).astype(float))
    return str(path)


def recognition_row(figures: dict[str, Any]) -> str:
    """The figures as a line to read."""
    recall, pairs = figures["recall"], figures["pairs"]
    detection = pairs["detection"]
    return (
        f"recognised of {figures['queries']} places seen before: {recall['1.00']:.0%} without a "
        f"false alarm, {recall['0.99']:.0%} with 1 % of them, {recall['0.95']:.0%} with 5 %; of "
        f"{pairs['near']} pairs of one place {detection['0.00']:.0%} without a false alarm among "
        f"{pairs['others']} others, {detection['0.01']:.0%} with 1 % of them"
    )
