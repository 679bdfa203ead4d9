"""`Albot/ExploreAndHome-v1`: explore, and return home before the time is up."""

from __future__ import annotations

from albot_env.tasks.core.single import SingleEnv
from albot_env.tasks.core.vector import VectorEnv
from albot_env.tasks.explore_and_home.task import ExploreAndHomeTask


class ExploreAndHomeEnv(SingleEnv[ExploreAndHomeTask]):
    """A robot explores for a limited time and must be home at the end of it.

    Description:
        The robot of `Albot/Explore-v0` starts with an empty map and a time budget. Its task is to
        cover as much ground and enter as many rooms as it can, to claim the places that it comes to
        again, to return to the start before the budget is spent, and to declare that it is home.
        A step is 0.1 s.

    Action space:
        `Box(-1, 1, (4,), float32)`: speed and turn rate, as shares of `MissionActionConfig`, a
        number that, above 0.5, declares: "my position at the end of this step is home", and one
        that, above 0.5, claims: "I have been here before, where my map says that I was" (see
        `claims`). `ExploreAndHomeConfig(claims=False)` omits the fourth number. Numbers beyond ±1
        are clipped. Another shape, NaN and infinity raise an `InputError`.

    Observation space:
        The robot's sensors, where it believes home to be, what its mapper remembers (`map_patch`,
        `place_graph`, `matches`), as far as the mapper can give it, and `time_left`, the remaining
        budget, which the robot knows: 1 at `ObservationConfig.time_range` (ten minutes) and more,
        -1 when it is spent, logarithmic in between. What a planner has worked out (`HINTS`) is
        barred unless `ExploreAndHomeConfig(hints=True)`.

    Rewards:
        The sum of the terms of `ExploreAndHomeWeights`; `info["reward_terms"]` holds each term.

    Starting state:
        As in `Albot/Explore-v0`; the budget is drawn from `ExploreAndHomeConfig` (120 to 300 s).

    Episode end:
        Terminated by the declaration, wherever the robot is, or when the budget is spent. The
        latter is termination, not truncation, because the budget is part of the task and the
        remaining time is observed (Pardo et al., Time limits in reinforcement learning, ICML
        2018). The only success is a declaration within `ExploreAndHomeConfig.radius` (1 m) of the
        true start, by a robot that has truly covered `ground` (40 m²) or `share` (half) of the
        reachable ground, whichever is less. Truncated after `max_episode_steps` (never, unless
        `gymnasium.make` is given a number).

    Info:
        The same as in `Albot/Explore-v0`, and: `is_success`, `declared`,
        `time_left` (s), `distance_home` (m; the shortest path for a robot of this width, without
        dynamic obstacles), `farthest_distance_home` (m; the maximum of `distance_home` so far),
        `next_turn_home` (x, y in the world frame, m), `spl` (success × `farthest_distance_home` /
        max(`farthest_distance_home`, path length since the robot was there): how straight it
        came home), and `soft_spl` (the same with the share of `farthest_distance_home` that it
        has come back in place of success).

    Args:
        world: A world spec, a world, or worlds (see `albot_maps.load_worlds`).
        config: Parameters of actions, observations, rewards and the time budget.
        settings: See `Settings`; and `render_mode`.

    Raises:
        InputError: As for `SingleEnv`; or hints are to be observed, which this task bars.
    """

    task = ExploreAndHomeTask


class ExploreAndHomeVectorEnv(VectorEnv[ExploreAndHomeTask]):
    """Robots that explore and come home, each as in its own `ExploreAndHomeEnv`.

    See `ExploreAndHomeEnv` for the task and `VectorEnv` for the further arguments.
    """

    task = ExploreAndHomeTask
