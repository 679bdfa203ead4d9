"""The effect of the distance between views on `albot1`'s errors and speed, in random worlds."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from jaxtyping import Float32, Float64

from albot_core.mappers.registry import make_mapper
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.parts.sensors import LASER
from albot_env.tasks.explore.task import ExploreConfig

SPACINGS = ((0.0, 0.0), (0.1, 5.0), (0.2, 10.0), (0.3, 15.0), (0.5, 25.0))
"""Distances (m) and turns (degrees) between views."""
KINDS = ("office", "apartment", "hall", "warehouse")
"""Kinds of random worlds."""
TUNING_SEEDS, TEST_SEEDS = range(6000, 6064), range(7000, 7064)
"""Seeds of the worlds in which the spacing was chosen, and of those that are measured."""
STEPS = 900
"""Number of steps of a drive: 90 s."""
NEAR = 0.7
"""The robot turns away from obstacles ahead that are nearer than this (m)."""
FAR = 10.0
"""The robot turns to the side with the larger ranges, each counted up to this (m)."""

Row = dict[str, float | int | str]


class Wanderers:
    """Robots that drive forward, swerve a little, and turn away from obstacles ahead.

    Args:
        count: Number of robots.
        beams: Number of beams of their lasers.
    """

    def __init__(self, count: int, beams: int) -> None:
        self._rng = np.random.default_rng(0)
        self._swerve, self._turning = np.zeros(count), np.zeros(count)
        self._ahead = slice(3 * beams // 8, 5 * beams // 8 + 1)
        self._right, self._left = slice(0, 3 * beams // 8), slice(5 * beams // 8, beams)

    def act(self, ranges: Float64[np.ndarray, "robots beams"]) -> Float32[np.ndarray, "robots 2"]:
        """Return each robot's speed and turn rate, as shares of the maximum."""
        ranges = np.minimum(ranges, FAR)
        count = len(ranges)
        self._swerve = 0.95 * self._swerve + 0.15 * self._rng.normal(size=count)
        is_near = ranges[:, self._ahead].min(axis=1) < NEAR
        left, right = ranges[:, self._left].mean(axis=1), ranges[:, self._right].mean(axis=1)
        side = np.where(left > right, 1.0, -1.0)
        self._turning = np.where(is_near, np.where(self._turning, self._turning, side), 0.0)
        turn = np.where(is_near, self._turning, np.clip(self._swerve, -1.0, 1.0))
        return np.stack((np.where(is_near, 0.0, 0.9), turn), axis=1).astype(np.float32)


def measure_view_spacing(
    seeds: Sequence[int] = TEST_SEEDS,
    steps: int = STEPS,
    kinds: Sequence[str] = KINDS,
    spacings: Sequence[tuple[float, float]] = SPACINGS,
    odometer: str = "pioneer",
) -> list[Row]:
    """Drive robots through random worlds, in the same way with each spacing of views.

    Args:
        seeds: Seeds of the worlds, with one robot each.
        steps: Length of the drive (steps of 0.1 s).
        kinds: The kinds of worlds.
        spacings: Distances (m) and turns (degrees) between views.
        odometer: The preset of the robots' odometers.

    Returns:
        One row per kind and spacing: `kind`, `spacing_m`, `turn_deg`, `views_per_step`;
        `error_median_m` and `error_95_m`, the errors of the estimated positions over all robots and
        steps, and `last_95_m`, of the last ones alone; `rooms`, the number of times that a robot
        entered a room for the first time, `exits`, the number of exit crossings noticed, and
        `places`, the number of places remembered, in all; `us_per_step`, the processor time of a
        robot's step (the median of all steps), and `speed`, the ratio of the first spacing's
        `us_per_step` to it.
    """
    return [row for kind in kinds for row in _of_kind(kind, seeds, steps, spacings, odometer)]


def _of_kind(
    kind: str,
    seeds: Sequence[int],
    steps: int,
    spacings: Sequence[tuple[float, float]],
    odometer: str,
) -> Iterator[Row]:
    first = None
    for spacing, turn in spacings:
        config = {"view_spacing": spacing, "view_turn": float(np.radians(turn))}
        row = _drive(kind, seeds, steps, config, odometer)
        first = first or float(row["us_per_step"])
        setting: Row = {"kind": kind, "spacing_m": spacing, "turn_deg": turn}
        speed: Row = {"speed": first / float(row["us_per_step"])}
        yield setting | row | speed


def _drive(
    kind: str, seeds: Sequence[int], steps: int, config: Mapping[str, float], odometer: str
) -> Row:
    shown = ObservationConfig(parts=("laser",))
    env: Any = gymnasium.make_vec(
        "Albot/Explore-v0",
        num_envs=len(seeds),
        world=[f"random:{kind}:{seed}" for seed in seeds],
        mapper="albot1",
        mapper_config=config,
        odometer=odometer,
        config=ExploreConfig(observations=shown, claims=False),
        max_episode_steps=steps + 1,
        threads=1,
    )
    observation, info = env.reset(seed=0)
    wanderers = Wanderers(len(seeds), env.single_observation_space.shape[0])
    errors, seconds = [], []
    for _ in range(steps):
        shown_ranges = [env.observation_config.decode(LASER, row) for row in observation]
        actions = wanderers.act(np.array(shown_ranges))
        began = time.process_time()
        observation, _, _, _, info = env.step(actions)
        seconds.append(time.process_time() - began)
        errors.append(info["position_error"].copy())
    mappers = []
    for row in range(len(seeds)):
        mapper: Any = make_mapper("albot1", config=config)
        mappers.append(mapper)
        mapper.restore(env.get_state(row).robot.mapper)
    env.close()
    views = [mapper.state()["progress"][0] for mapper in mappers]
    crossed = "NEW", "ENTERED", "RECOGNIZED", "RETURNED"
    return {
        "views_per_step": float(np.mean(views)) / steps,
        "error_median_m": float(np.median(errors)),
        "error_95_m": float(np.quantile(errors, 0.95)),
        "last_95_m": float(np.quantile(errors[-1], 0.95)),
        "rooms": int(np.sum(info["rooms_entered"])),
        "exits": sum(event.kind.name in crossed for mapper in mappers for event in mapper.events),
        "places": sum(len(mapper.snapshot().place_graph.nodes) for mapper in mappers),
        "us_per_step": 1e6 * float(np.median(seconds)) / len(seeds),
    }
