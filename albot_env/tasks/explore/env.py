"""`Albot/Explore-v0`: cover an unknown building."""

from __future__ import annotations

from albot_env.tasks.core.single import SingleEnv
from albot_env.tasks.core.vector import VectorEnv
from albot_env.tasks.explore.task import ExploreTask


class ExploreEnv(SingleEnv[ExploreTask]):
    """A robot explores a building with a mapper inside.

    Description:
        A Pioneer 3-DX with a laser, sonars and a noisy odometer starts with an empty map. Its task
        is to cover as much ground and enter as many rooms as it can. A step is 0.1 s.

    Action space:
        `Box(-1, 1, (3,), float32)`: speed and turn rate, as shares of `ActionConfig`, and a number
        that, above 0.5, claims: "I have been here before, where my map says that I was". The
        first claim on a visit to a room counts. It is right if the robot has truly come back to
        the room, and if the reading that its mapper matches with the present one was taken here
        on an earlier visit (see `claims` and `albot_maps.same_place`). With a mapper that does
        not recognise places, it is right if the robot has come back.
        `ExploreConfig(claims=False)` omits the third number. Numbers beyond ±1 are clipped.
        Another shape, NaN and infinity raise an `InputError`.

    Observation space:
        With `observation="dict"` the parts described in `ObservationConfig`, by default the same
        in one row (`ObservationConfig.split` splits it). All float32 in [-1, 1]. They are a
        function of the readings alone.

    Rewards:
        The sum of the terms of `ExploreWeights`; `info["reward_terms"]` holds each term.

    Starting state:
        At rest at one of the world's starts, drawn at random; `reset(options={"start": k})` selects
        the k-th, `{"start": (x, y, heading)}` a pose. With several worlds
        (`random:office:0..99`) each reset draws one; `{"world": k}` selects the k-th.

    Episode end:
        Never terminated; truncated after `max_episode_steps` (6000, ten minutes), an argument of
        `gymnasium.make`.

    Info:
        The truth, for evaluation: `world` (its name), `pose`, `start` and `belief` (m, rad; the
        belief in the map frame, whose origin is the true start), `position_error` (m), `room`
        (empty between rooms), `rooms_entered`, `coverage` (share of the reachable ground),
        `collided`, `path_length` (m), `time` (s), `updates`, `surfaces`, `re_entries`,
        `right_claims`, `false_claims`, `reward_terms`.

    Args:
        world: A world spec, a world, or worlds (see `albot_maps.load_worlds`).
        config: Parameters of actions, observations and rewards.
        settings: See `Settings`; and `render_mode`.

    Raises:
        InputError: As for `SingleEnv`.
    """

    task = ExploreTask


class ExploreVectorEnv(VectorEnv[ExploreTask]):
    """Robots that explore, each as in its own `ExploreEnv`.

    See `ExploreEnv` for the task and `VectorEnv` for the further arguments.
    """

    task = ExploreTask
