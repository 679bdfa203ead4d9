"""Many `Albot/ExploreAndHome-v0` stepped together."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Unpack

from albot_env.tasks.explore_and_home.task import RoundTrip, RoundTripConfig
from albot_env.vector.batch import BatchEnv, BatchSettings
from albot_env.vector.settings import Worlds


class ExploreAndHomeVectorEnv(BatchEnv[RoundTrip]):
    """Robots that explore and come home, each as in an `ExploreAndHomeEnv` of its own.

    Args:
        num_envs: How many environments.
        world: A world spec, a world or worlds for all, of which each reset draws one; or
            such for each.
        config: What actions ask for, how observations are scaled, what is rewarded,
            and how long robots have.
        settings: See `BatchSettings`.

    Raises:
        InputError: As for `BatchEnv`.
    """

    def __init__(
        self,
        num_envs: int,
        world: Worlds | Sequence[Worlds] = "office-ring",
        *,
        config: RoundTripConfig | None = None,
        **settings: Unpack[BatchSettings],
    ) -> None:
        super().__init__(partial(RoundTrip, config=config), num_envs, world, **settings)
