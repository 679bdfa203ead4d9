"""What figures of episodes are computed from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

from albot_core.geometry.types import Pose


@runtime_checkable
class MeasuredEpisode(Protocol):
    """The measurements of an episode that just ran (`Outcome`) or was read from a file."""

    @property
    def agent(self) -> str:
        """The agent's name."""

    @property
    def world(self) -> str:
        """Name of the world."""

    @property
    def seed(self) -> int:
        """Seed of the episode."""

    @property
    def info(self) -> Mapping[str, Any]:
        """Single values of the last info: the ground truth at the end."""

    @property
    def start(self) -> Pose:
        """Pose of home (world frame)."""

    @property
    def begin(self) -> Pose:
        """Pose at the beginning of the episode (world frame)."""

    @property
    def driven(self) -> float:
        """Length of the agent's path (m)."""

    @property
    def collisions(self) -> int:
        """Number of times that the robot came into contact with something."""

    @property
    def rooms(self) -> int:
        """Number of rooms that the robot can reach; 0 if the task measures no exploring."""

    @property
    def coverage_auc(self) -> float | None:
        """Mean share of ground covered over the first 200 m; None if the task measures none."""
