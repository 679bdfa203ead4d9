"""The mission: robots that explore, claim places and return home in time, without hints."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.settings import Equipment, chosen_config
from albot_env.tasks.explore_and_home.task import ExploreAndHomeConfig, ExploreAndHomeTask
from albot_env.tasks.homing_by_map.task import without_hints


@dataclass(frozen=True, kw_only=True)
class MissionConfig(ExploreAndHomeConfig):
    """Parameters of actions, observations, rewards and the time budget."""

    claims: bool = True
    """Whether actions have a fourth number, which claims that the place is known (see `claims`)."""
    observations: ObservationConfig | None = None  # type: ignore[assignment]
    """Parts and scales of observations; None for `parts_by_map`, all that the mapper can give, and
    the time left."""
    hints: bool = False
    """Whether what a planner has worked out may be observed (`HINTS`)."""


class MissionTask(ExploreAndHomeTask):
    """Robots that explore, claim places, and return home before their time is up.

    Args:
        robots: Number of robots.
        equipment: Equipment of the robots.
        config: Parameters of actions, observations, rewards and the time budget.

    Raises:
        InputError: The mapper is unknown, or hints are to be observed though `config.hints` is
            false.
    """

    environment: ClassVar[str] = "Albot/ExploreAndHome-v1"

    def __init__(
        self, robots: int, equipment: Equipment, *, config: MissionConfig | None = None
    ) -> None:
        config = chosen_config(config, MissionConfig, self.environment)
        observations = without_hints(config, equipment, "time_left")
        super().__init__(robots, equipment, config=replace(config, observations=observations))
