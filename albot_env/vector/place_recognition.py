"""Many `Albot/PlaceRecognition-v0` stepped together."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Unpack

from albot_env.tasks.place_recognition.task import Judging, JudgingConfig
from albot_env.vector.batch import BatchEnv, BatchSettings
from albot_env.vector.settings import Worlds


class PlaceRecognitionVectorEnv(BatchEnv[Judging]):
    """Robots that judge where they are, each as in a `PlaceRecognitionEnv`. They share tours.

    Args:
        num_envs: How many environments.
        world: A world spec, a world or worlds for all, of which each reset draws one; or
            such for each.
        journeys: How many tours there are from a start, of which each reset draws one; 0 for
            a new one each time.
        config: Where tours lead, what is rewarded, and what is a success.
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
        config: JudgingConfig | None = None,
        **settings: Unpack[BatchSettings],
    ) -> None:
        gather = partial(Judging, config=config, journeys=journeys)
        super().__init__(gather, num_envs, world, **settings)
