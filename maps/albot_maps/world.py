"""The world: an immutable, validated floor plan."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Poses, Segments


@dataclass(frozen=True, kw_only=True, eq=False)
class Room:
    """A named part of the floor."""

    name: str
    boundary: Float64[np.ndarray, "corners 2"]
    """Corners of the room's outline (m), a simple polygon."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Exit:
    """An opening between two rooms: a doorway, or the mouth of a corridor."""

    name: str
    segment: Float64[np.ndarray, "4"]
    """The line across the opening x1, y1, x2, y2 (m)."""
    rooms: tuple[str, str]
    """Names of the rooms on its two sides."""


@dataclass(frozen=True, kw_only=True, eq=False)
class World:
    """A building's floor. World frame: x right, y up on the plan, in metres."""

    name: str
    walls: Segments
    """Everything the robot meets: walls and furniture."""
    starts: Poses
    """Poses at which an episode may begin; the first is the default."""
    rooms: tuple[Room, ...] = field(default=())
    exits: tuple[Exit, ...] = field(default=())
    source: str = ""
    """Where the world came from: a file, a catalogue name, a generator's spec."""
