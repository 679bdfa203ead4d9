"""Taking a view from a scan, with its landmarks (algorithm 4, lines 2 to 4). Compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.perceptual_map.memory import LocatedView
from albot_core.matching.lines import line_length
from albot_core.sensing.beam_model import BeamModel
from albot_core.sensing.view import NO_EDGE, ViewBuffers, extract_surfaces


class ViewSettings(NamedTuple):
    """What views are constructed with."""

    directions: np.ndarray
    """(beams, 2) float64: unit vectors of the beams in the robot's frame."""
    beam_model: BeamModel
    """What is known of the beams."""
    mount: tuple[float, float]
    """Where the laser is in the robot's frame (m)."""
    max_range: float
    """Points at or beyond this distance are dropped (m)."""
    thresholds: np.ndarray
    """(7,) float64: see `ViewConfig.thresholds`."""
    fit_lines: bool
    grazing_ends: bool
    cut_ends: bool
    """See `ViewConfig`."""


@kernel()
def take_view(
    ranges: np.ndarray,
    settings: ViewSettings,
    limits: Albot1Limits,
    current: LocatedView,
    view_buffers: ViewBuffers,
) -> None:
    """Construct the view from a scan, and find its landmarks (algorithm 4, lines 2 to 4)."""
    current.size[0] = extract_surfaces(
        ranges,
        settings.directions,
        settings.mount[0],
        settings.mount[1],
        settings.max_range,
        settings.beam_model,
        settings.thresholds,
        settings.fit_lines,
        settings.grazing_ends,
        settings.cut_ends,
        view_buffers,
        current.surfaces,
        current.edges,
    )
    # Section 3.1.4: landmarks are long surfaces with an occluding or corner point.
    for k in range(current.size[0]):
        current.landmark[k] = line_length(current.surfaces[k]) >= limits.landmark_length and (
            current.edges[k, 0] != NO_EDGE or current.edges[k, 1] != NO_EDGE
        )
