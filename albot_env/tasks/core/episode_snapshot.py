"""Episode snapshots: what a robot hands on with which another one can go on in its place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from albot_core.geometry.types import Pose
from albot_core.mappers.mapper import WayHome
from albot_env.sim.batch_simulator import RobotSnapshot
from albot_env.tasks.core.observation_builder import ProgressSnapshot


@dataclass(frozen=True, kw_only=True, eq=False)
class EpisodeSnapshot:
    """The state of a robot at rest and all that it knows: what its future depends on."""

    start: Pose
    """Where it set out (world frame)."""
    path_length: float
    """How far it has driven since (m)."""
    body: RobotSnapshot
    """Its body, sensors and obstacles."""
    progress: ProgressSnapshot
    """What it has covered and entered."""
    belief: Pose
    """Where it believes to be, in its map's frame."""
    way_home: WayHome
    """The way home that it believes in."""
    memory: dict[str, np.ndarray]
    """Its mapper's state."""
