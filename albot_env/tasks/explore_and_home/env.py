"""`Albot/ExploreAndHome-v0`: explore, and be home before the time is up."""

from __future__ import annotations

from albot_env.tasks.core.single import SingleEnv
from albot_env.tasks.core.vector import VectorEnv
from albot_env.tasks.explore_and_home.task import ExploreAndHomeTask


class ExploreAndHomeEnv(SingleEnv[ExploreAndHomeTask]):
    """A robot explores for a limited time, at whose end it must have come home.

    Description:
        The robot of `Albot/Explore-v0` sets out with an empty map and a budget of time. It is to
        cover as much ground and enter as many rooms as it can, to come back to where it
        set out before the budget is spent, and to declare that it is home. A step is 0.1 s.

    Action space:
        `Box(-1, 1, (3,), float32)`: speed and turn rate, as shares of `DeclaringActionConfig`,
        and a number that declares above 0.5: "where I am at the end of this step is home".
        Numbers beyond ±1 count as ±1. Another shape, NaN and infinity are an `InputError`.

    Observation space:
        As in `Albot/Homing-v0`, and a part `time_left`: what is left of the budget, which
        the robot knows, 1 at `ObservationConfig.time_range` (ten minutes) and more,
        -1 when it is spent, in between logarithmic.

    Rewards:
        The sum of the terms of `ExploreAndHomeWeights`; each stands in `info["reward_terms"]`.

    Starting state:
        As in `Albot/Explore-v0`; the budget is drawn from `ExploreAndHomeConfig` (120 to 300 s).

    Episode end:
        Terminated by the declaration, wherever the robot is, or when the budget is spent: that is
        part of the task, not a limit from outside, and what is left of it is observed
        (Pardo et al., Time limits in reinforcement learning, ICML 2018). A success
        is a declaration, and nothing but a declaration, within `ExploreAndHomeConfig.radius` (1 m)
        of the true start, by a robot that has truly covered `ground` (40 m²) or `share` (half) of
        the ground that can be reached, whichever is less. Truncated after
        `max_episode_steps` (never, unless `gymnasium.make` is told).

    Info:
        What `Albot/Explore-v0` gives but of claims, and: `is_success`, `declared`, `time_left` (s),
        `distance_home` (m; the shortest way for a robot of this width, things that move left
        out), `farthest_distance_home` (m; the longest that this has been), `next_turn_home`
        (x, y in the world's frame, m), `spl` (success × `farthest_distance_home` / the
        longer of it and the way driven since the robot was there: how straight it came home), and
        `soft_spl` (the share of `farthest_distance_home` that it has come back, in place of
        success).

    Args:
        world: A world spec, a world, or worlds (see `albot_maps.load_worlds`).
        config: What actions ask for, how observations are scaled, what is rewarded, and how
            long the robot has.
        settings: See `Settings`; and `render_mode`.

    Raises:
        InputError: As for `SingleEnv`.
    """

    task = ExploreAndHomeTask


class ExploreAndHomeVectorEnv(VectorEnv[ExploreAndHomeTask]):
    """Robots that explore and come home, each as in an `ExploreAndHomeEnv` of its own.

    See there for everything, and `VectorEnv` for what it takes besides.
    """

    task = ExploreAndHomeTask
