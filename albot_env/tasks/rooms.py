"""The rooms of a world as `find_room` takes them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64

from albot_maps.world import Room


def outlines_of(
    rooms: tuple[Room, ...],
) -> tuple[Float64[np.ndarray, "corners 2"], Int64[np.ndarray, "rooms 2"]]:
    """The corners of all rooms' outlines one after another, where each room's begin and end."""
    outlines = [np.asarray(room.boundary, np.float64) for room in rooms]
    ends = np.cumsum([0, *(len(outline) for outline in outlines)], dtype=np.int64)
    spans = np.stack((ends[:-1], ends[1:]), axis=1)
    return np.concatenate([np.empty((0, 2)), *outlines]), spans
