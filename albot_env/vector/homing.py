"""Many `Albot/Homing-v0` stepped together."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Unpack

from albot_env.tasks.homing.task import Homing, HomingConfig
from albot_env.vector.batch import BatchEnv, BatchSettings
from albot_env.vector.settings import Worlds


class HomingVectorEnv(BatchEnv[Homing]):
    """Robots that drive home, each as in a `HomingEnv` of its own. They share outward journeys.

    Args:
        num_envs: How many environments.
        world: A world spec, a world or worlds for all, of which each reset draws one; or
            such for each.
        journeys: How many outward journeys there are from a start, of which each reset draws
            one; 0 for a new one each time.
        config: What actions ask for, how observations are scaled, what is rewarded.
        settings: See `BatchSettings`.

    Raises:
        InputError: As for `BatchEnv`; or there are fewer journeys than none.
    """

    def __init__(
        self,
        num_envs: int,
        world: Worlds | Sequence[Worlds] = "office-ring",
        *,
        journeys: int = 0,
        config: HomingConfig | None = None,
        **settings: Unpack[BatchSettings],
    ) -> None:
        gather = partial(Homing, config=config, journeys=journeys)
        super().__init__(gather, num_envs, world, **settings)
