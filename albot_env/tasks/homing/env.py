"""`Albot/Homing-v0`: find the way home from an outward journey."""

from __future__ import annotations

from albot_env.tasks.core.single import SingleEnv
from albot_env.tasks.core.vector import VectorEnv
from albot_env.tasks.homing.task import HomingTask


class HomingEnv(SingleEnv[HomingTask]):
    """A robot that has explored drives home, and says when it is there.

    Description:
        The robot of `Albot/Explore-v0` has set out somewhere and explored, by the gap
        explorer of `albot_core.planning`, for a way drawn from `OutwardJourneyConfig`. Its mapper
        has followed. Now it is to come back to where it set out, as straight as it can, and
        to declare that it is home. A step is 0.1 s.

    Action space:
        `Box(-1, 1, (3,), float32)`: speed and turn rate, as shares of `DeclaringActionConfig`,
        and a number that declares above 0.5: "where I am at the end of this step is home".
        Numbers beyond ±1 count as ±1. Another shape, NaN and infinity are an `InputError`.

    Observation space:
        As in `Albot/Explore-v0`. Home is where the mapper believes it to be.

    Rewards:
        The sum of the terms of `HomingWeights`; each stands in `info["reward_terms"]`.

    Starting state:
        At rest where an outward journey ended. World and start are drawn, or chosen by
        `options`, as in `Albot/Explore-v0`; the start is where the journey began. `journeys`
        says from how many journeys from that start one is drawn. Each is made when it
        is first asked for, which takes a second or more, and the last 256 MiB of them
        are kept. A journey is a function of its world, start and number alone; all noise
        after it is the episode's own.

    Episode end:
        Terminated by the declaration: a success within `HomingConfig.radius` (1 m) of
        the true start. Truncated after `max_episode_steps` (3000, five minutes).

    Info:
        What `Albot/Explore-v0` gives but of claims (`path_length`, `coverage` and `rooms_entered`
        count the outward journey too; `time` does not), and: `is_success`, `declared`,
        `distance_home` and
        `initial_distance_home` (m; the shortest way for a robot of this width, things
        that move left out), `way_driven` (m, since the beginning), `spl` (success ×
        `initial_distance_home` / the longer of it and `way_driven`), `soft_spl` (the share of
        `initial_distance_home` that is covered, in place of success), `next_turn_home`
        (x, y in the world's frame, m: where the shortest way turns next, home itself
        where it is in sight), `outward_length` (m), `outward_cut_short` (whether the robot
        got stuck on the outward journey, which is then shorter than was drawn).

    Args:
        world: A world spec, a world, or worlds (see `albot_maps.load_worlds`).
        journeys: How many outward journeys there are from a start, of which each reset draws
            one; 0 for a new one each time.
        config: What actions ask for, how observations are scaled, what is rewarded.
        settings: See `Settings`; and `render_mode`.

    Raises:
        InputError: As for `SingleEnv`; or there are fewer journeys than none.
    """

    task = HomingTask


class HomingVectorEnv(VectorEnv[HomingTask]):
    """Robots that drive home, each as in a `HomingEnv` of its own. They share outward journeys.

    See there for everything, and `VectorEnv` for what it takes besides.
    """

    task = HomingTask
