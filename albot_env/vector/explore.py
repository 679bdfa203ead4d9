"""Many `Albot/Explore-v0` stepped together."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Unpack

from albot_env.tasks.explore.task import Exploration, ExploreConfig
from albot_env.vector.batch import BatchEnv, BatchSettings
from albot_env.vector.settings import Worlds


class ExploreVectorEnv(BatchEnv[Exploration]):
    """Robots that explore, each as in an `ExploreEnv` of its own.

    Args:
        num_envs: How many environments.
        world: A world spec, a world or worlds for all, of which each reset draws one; or
            such for each.
        config: What actions ask for, how observations are scaled, what is rewarded.
        settings: See `BatchSettings`.

    Raises:
        InputError: As for `BatchEnv`.
    """

    def __init__(
        self,
        num_envs: int,
        world: Worlds | Sequence[Worlds] = "office-ring",
        *,
        config: ExploreConfig | None = None,
        **settings: Unpack[BatchSettings],
    ) -> None:
        super().__init__(partial(Exploration, config=config), num_envs, world, **settings)
