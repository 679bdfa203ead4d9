"""Episode snapshots: the state from which another robot can continue an episode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from albot_core.geometry.types import Pose
from albot_core.mappers.mapper import WayHome
from albot_env.sim.batch_simulator import RobotSnapshot
from albot_env.tasks.core.observation_builder import ProgressSnapshot


@dataclass(frozen=True, kw_only=True, eq=False)
class EpisodeSnapshot:
    """The state of a robot at rest and its knowledge: all that its future depends on."""

    start: Pose
    """Pose at the start of the episode (world frame)."""
    path_length: float
    """Distance driven since the start (m)."""
    body: RobotSnapshot
    """State of its body, sensors and obstacles."""
    progress: ProgressSnapshot
    """The ground covered and the rooms entered so far."""
    belief: Pose
    """Estimated pose, in its map's frame."""
    way_home: WayHome
    """The way home by its mapper."""
    memory: dict[str, np.ndarray]
    """Its mapper's state."""
