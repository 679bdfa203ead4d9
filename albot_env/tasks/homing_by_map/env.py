"""`Albot/HomingByMap-v0`: find the way home by the map, in a building that may have changed."""

from __future__ import annotations

from albot_env.tasks.core.single import SingleEnv
from albot_env.tasks.core.vector import VectorEnv
from albot_env.tasks.homing_by_map.task import HomingByMapTask


class HomingByMapEnv(SingleEnv[HomingByMapTask]):
    """A robot that has explored drives home by its map, and nobody tells it the way.

    Description:
        The task is that of `Albot/Homing-v0`, with three differences. The robot observes what its
        mapper remembers (`map_patch`, `place_graph`, `matches`), but nothing that a planner has
        worked out of it: no exit to take next, no point ahead on the way (`HINTS`). Something may
        have been changed after the way out, of which it is told nothing (`ChangesConfig`): a door
        was shut, or opened, the robot was carried to another room, or furniture was moved. And it
        may claim on its way to have been where it is before. A step is 0.1 s.

    Action space:
        `Box(-1, 1, (4,), float32)`: speed and turn rate, as shares of `MissionActionConfig`, a
        number that, above 0.5, declares home, and one that, above 0.5, claims: "I have been here
        before, where my map says that I was" (see `claims`). The outward journey counts.
        `HomingByMapConfig(claims=False)` omits the fourth number. Numbers beyond ±1 are clipped.
        Another shape, NaN and infinity raise an `InputError`.

    Observation space:
        As in `Albot/Homing-v0`; by default the parts of `parts_by_map` that the mapper can give.

    Rewards:
        The sum of the terms of `HomingWeights`; `info["reward_terms"]` holds each term.

    Starting state:
        As in `Albot/Homing-v0`, after the change. The shortest way home, and so `distance_home`
        and the reward, are those of the changed building.

    Episode end:
        As in `Albot/Homing-v0`.

    Info:
        As in `Albot/Homing-v0`; with claims as in `Albot/Explore-v0`; and `change`: `none`,
        `door_shut`, `door_opened`, `carried` or `furniture_moved`. Where the change that was drawn
        is impossible, it is `none`.

    Args:
        world: A world spec, a world, or worlds (see `albot_maps.load_worlds`).
        journeys: Number of outward journeys per start, from which each reset draws one; 0 for a
            new one each time.
        config: Parameters of actions, observations, rewards, outward journeys and changes.
        settings: See `Settings`; and `render_mode`.

    Raises:
        InputError: As for `Albot/Homing-v0`; or hints are to be observed, which this task bars.
    """

    task = HomingByMapTask


class HomingByMapVectorEnv(VectorEnv[HomingByMapTask]):
    """Robots that drive home by their maps, each as in its own `HomingByMapEnv`.

    See `HomingByMapEnv` for the task and `VectorEnv` for the further arguments.
    """

    task = HomingByMapTask
