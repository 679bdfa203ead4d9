"""A robot that rests: all of it that matters for what follows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from albot_core.geometry.types import Pose
from albot_core.mappers.mapper import WayHome
from albot_env.sim.fleet import Halt
from albot_env.tasks.survey import Surveyed


@dataclass(frozen=True, kw_only=True, eq=False)
class Rest:
    """How a robot stands that has come to rest on an expedition, and all that it knows."""

    start: Pose
    """Where it set out (world frame)."""
    path_length: float
    """How far it has driven since (m)."""
    halt: Halt
    """How it stands."""
    surveyed: Surveyed
    """What it has covered and entered."""
    belief: Pose
    """Where it believes to be, in its map's frame."""
    way_home: WayHome
    """The way home that it believes in."""
    memory: dict[str, np.ndarray]
    """Its mapper's state."""
