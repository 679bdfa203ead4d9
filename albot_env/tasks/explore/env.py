"""`Albot/Explore-v0`: cover a building that was never seen before."""

from __future__ import annotations

from albot_env.tasks.core.single import SingleEnv
from albot_env.tasks.core.vector import VectorEnv
from albot_env.tasks.explore.task import ExploreTask


class ExploreEnv(SingleEnv[ExploreTask]):
    """A robot explores a building with a mapper inside.

    Description:
        A Pioneer 3-DX with a laser, sonars and a noisy odometer sets out with an empty map. It
        is to cover as much ground and enter as many rooms as it can. A step is 0.1 s.

    Action space:
        `Box(-1, 1, (3,), float32)`: speed and turn rate, as shares of `ActionConfig`, and a number
        that claims, above 0.5: "I have been here before, where my map says that I was". The first
        claim on a visit to a room counts. It is right where the robot has truly come back to the
        room, and the reading that its mapper matches with the present one was taken here on an
        earlier visit (see `claims` and `albot_maps.same_place`); with a mapper that recognises no
        places, where it has come back. `ExploreConfig(claims=False)` leaves the third number out.
        Numbers beyond ±1 count as ±1. Another shape, NaN and infinity are an `InputError`.

    Observation space:
        With `observation="dict"` the parts that `ObservationConfig` tells of, by default
        the same in one row (`ObservationConfig.split` takes it apart). All float32 in
        [-1, 1]. They are a function of the readings alone.

    Rewards:
        The sum of the terms of `ExploreWeights`; each stands in `info["reward_terms"]`.

    Starting state:
        At rest at one of the world's starts, drawn at random;
        `reset(options={"start": k})` sets out from the k-th, `{"start": (x, y, heading)}`
        from a pose. With several worlds (`random:office:0..99`) each reset draws one;
        `{"world": k}` asks for the k-th.

    Episode end:
        Never by itself; truncated after `max_episode_steps` (6000, ten minutes), which
        `gymnasium.make` takes.

    Info:
        The truth, for evaluation: `world` (its name), `pose`, `start` and `belief`
        (m, rad; the belief in the map's frame, which lies at the true start), `position_error` (m),
        `room` (empty between rooms), `rooms_entered`, `coverage` (share of the reachable
        ground), `collided`, `path_length` (m), `time` (s), `updates`, `surfaces`,
        `re_entries`, `right_claims`, `false_claims`, `reward_terms`.

    Args:
        world: A world spec, a world, or worlds (see `albot_maps.load_worlds`).
        config: What actions ask for, how observations are scaled, what is rewarded.
        settings: See `Settings`; and `render_mode`.

    Raises:
        InputError: As for `SingleEnv`.
    """

    task = ExploreTask


class ExploreVectorEnv(VectorEnv[ExploreTask]):
    """Robots that explore, each as in an `ExploreEnv` of its own.

    See there for everything, and `VectorEnv` for what it takes besides.
    """

    task = ExploreTask
