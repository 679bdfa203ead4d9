"""`Albot/ExploreAndHome-v1`: explore, claim the places that come again, and be home in time."""

from __future__ import annotations

from albot_env.tasks.core.single import SingleEnv
from albot_env.tasks.core.vector import VectorEnv
from albot_env.tasks.mission.task import MissionTask


class MissionEnv(SingleEnv[MissionTask]):
    """A robot explores, claims the places that it comes to again, and must be home in time.

    Description:
        The task is that of `Albot/ExploreAndHome-v0`, with two differences. The robot observes what
        its mapper remembers (`map_patch`, `place_graph`, `matches`), but nothing that a planner
        has worked out of it (`HINTS`). And it may claim on its way to have been where it is
        before. A step is 0.1 s.

    Action space:
        `Box(-1, 1, (4,), float32)`: speed and turn rate, as shares of `MissionActionConfig`, a
        number that, above 0.5, declares home, and one that, above 0.5, claims: "I have been here
        before, where my map says that I was" (see `claims`). `MissionConfig(claims=False)` omits
        the fourth number. Numbers beyond ±1 are clipped. Another shape, NaN and infinity raise an
        `InputError`.

    Observation space:
        By default the parts of `parts_by_map` that the mapper can give, and `time_left` as in
        `Albot/ExploreAndHome-v0`.

    Rewards:
        The sum of the terms of `ExploreAndHomeWeights`; `info["reward_terms"]` holds each term.

    Starting state:
        As in `Albot/ExploreAndHome-v0`.

    Episode end:
        As in `Albot/ExploreAndHome-v0`.

    Info:
        As in `Albot/ExploreAndHome-v0`, and with claims as in `Albot/Explore-v0`.

    Args:
        world: A world spec, a world, or worlds (see `albot_maps.load_worlds`).
        config: Parameters of actions, observations, rewards and the time budget.
        settings: See `Settings`; and `render_mode`.

    Raises:
        InputError: As for `SingleEnv`; or hints are to be observed, which this task bars.
    """

    task = MissionTask


class MissionVectorEnv(VectorEnv[MissionTask]):
    """Robots on missions, each as in its own `MissionEnv`.

    See `MissionEnv` for the task and `VectorEnv` for the further arguments.
    """

    task = MissionTask
