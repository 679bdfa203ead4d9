"""Views: when a scan becomes one, and its surfaces and landmarks (algorithm 4, lines 2 to 4).

Compiled.
"""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.perceptual_map.memory import LocatedView
from albot_core.mappers.albot1.perceptual_map.odometer_error import HAS_MOVED
from albot_core.matching.lines import line_length
from albot_core.sensing.view import NO_EDGE, ViewBuffers, ViewSettings, extract_surfaces

SECTORS = 16
"""Number of sectors of a scan; scans are compared by the nearest range in each sector."""
SECTOR_CHANGE = 0.1
"""A scan has changed if the nearest range in a sector has changed by more than this (m)."""
FAR = 100.0
"""Nearest range of a sector without an echo (m)."""
STANDING = 0.005
"""A robot stands still if a reading reports a motion no larger than this (m, rad)."""


@kernel()
def is_view_due(
    ranges: np.ndarray,
    since: np.ndarray,
    motion: np.ndarray,
    odometer: np.ndarray,
    sectors: np.ndarray,
    limits: Albot1Limits,
) -> bool:
    """Return whether a scan must become a view, by the motion `since` the last view.

    Below `view_spacing` and `view_turn` it must only where the odometer cannot be trusted.
    `albot1`, which works without an odometer, makes every scan a view until the odometer has
    reported a motion (`odometer`). After that it does so where the last `motion` is zero although
    the scan has changed since the last view (`sectors`).
    """
    square = since[0] * since[0] + since[1] * since[1]
    if square >= limits.view_spacing**2 or abs(since[2]) >= limits.view_turn:
        return True
    if not limits.submap_matching:
        return False
    if odometer[HAS_MOVED] == 0.0:
        return True
    is_standing = max(abs(motion[0]), abs(motion[1]), abs(motion[2])) <= STANDING
    return is_standing and _has_changed(ranges, sectors)


_nearest = scratch(SECTORS)


@kernel()
def _has_changed(ranges: np.ndarray, sectors: np.ndarray) -> bool:
    """Return whether the nearest range in any sector differs from that of `sectors`."""
    nearest, most = _nearest(), 0.0
    note_sectors(ranges, nearest)
    for k in range(SECTORS):
        most = max(most, abs(nearest[k] - sectors[k]))
    return most > SECTOR_CHANGE


@kernel()
def note_sectors(ranges: np.ndarray, sectors: np.ndarray) -> None:
    """Write the nearest range in each sector (m), at most FAR."""
    beams = ranges.shape[0]
    for k in range(SECTORS):
        nearest = FAR
        for beam in range(k * beams // SECTORS, (k + 1) * beams // SECTORS):
            if ranges[beam] < nearest:
                nearest = ranges[beam]
        sectors[k] = nearest


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
        ranges, settings, view_buffers, current.surfaces, current.edges
    )
    # Section 3.1.4: landmarks are long surfaces with an occluding or corner point.
    for k in range(current.size[0]):
        current.landmark[k] = line_length(current.surfaces[k]) >= limits.landmark_length and (
            current.edges[k, 0] != NO_EDGE or current.edges[k, 1] != NO_EDGE
        )
