"""`Albot/Homing-v0`: find the way home from an outward journey."""

from __future__ import annotations

from albot_env.tasks.core.single import SingleEnv
from albot_env.tasks.core.vector import VectorEnv
from albot_env.tasks.homing.task import HomingTask


class HomingEnv(SingleEnv[HomingTask]):
    """A robot that has explored drives home and declares when it is there.

    Description:
        The robot of `Albot/Explore-v0` has explored from a start, controlled by the gap explorer
        of `albot_core.planning`, over a distance drawn from `OutwardJourneyConfig`. Its mapper
        has built a map on the way. Its task is to return to the start, as straight as it can, and
        to declare that it is home. A step is 0.1 s.

    Action space:
        `Box(-1, 1, (3,), float32)`: speed and turn rate, as shares of `DeclaringActionConfig`,
        and a number that, above 0.5, declares: "my position at the end of this step is home".
        Numbers beyond ±1 are clipped. Another shape, NaN and infinity raise an `InputError`.

    Observation space:
        As in `Albot/Explore-v0`. Home is at the position that the mapper believes in.

    Rewards:
        The sum of the terms of `HomingWeights`; `info["reward_terms"]` holds each term.

    Starting state:
        At rest at the end of an outward journey. World and start are drawn, or chosen by
        `options`, as in `Albot/Explore-v0`; the start is the start of the journey. The journey is
        drawn from `journeys` journeys per start. Each journey is made when it is first drawn,
        which takes a second or more, and the most recently used GiB of them is cached. Where
        it leads is a function of its world, start and number alone, whatever the robot carries,
        maps and observes. All noise after it is the episode's own.

    Episode end:
        Terminated by the declaration, which is a success within `HomingConfig.radius` (1 m) of
        the true start. Truncated after `max_episode_steps` (3000, five minutes).

    Info:
        The same as in `Albot/Explore-v0` except for claims (`path_length`, `coverage` and
        `rooms_entered` include the outward journey; `time` does not), and: `is_success`,
        `declared`, `distance_home` and `initial_distance_home` (m; the shortest path for a robot
        of this width, without dynamic obstacles), `way_driven` (m, since the beginning), `spl`
        (success × `initial_distance_home` / max(`initial_distance_home`, `way_driven`)),
        `soft_spl` (the same with the share of `initial_distance_home` that is covered in place of
        success), `next_turn_home` (x, y in the world frame, m: the next turn of the shortest
        path, or home itself if it is in sight), `outward_length` (m), `outward_cut_short`
        (whether the robot got stuck on the outward journey, which is then shorter than drawn).

    Args:
        world: A world spec, a world, or worlds (see `albot_maps.load_worlds`).
        journeys: Number of outward journeys per start, from which each reset draws one; 0 for a
            new one each time.
        config: Parameters of actions, observations, rewards and outward journeys.
        settings: See `Settings`; and `render_mode`.

    Raises:
        InputError: As for `SingleEnv`; or `journeys` is negative.
    """

    task = HomingTask


class HomingVectorEnv(VectorEnv[HomingTask]):
    """Robots that drive home, each as in its own `HomingEnv`. They share outward journeys.

    See `HomingEnv` for the task and `VectorEnv` for the further arguments.
    """

    task = HomingTask
