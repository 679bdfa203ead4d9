"""Frames per second of painting an environment's picture, beside an empty picture."""

from __future__ import annotations

from collections.abc import Sequence

import gymnasium
import pygame

from albot_agents.agent import EnvironmentConfigs, begin_episode, choose_action
from albot_agents.registry import find_agent, make_agent
from albot_benchmarks.timing import Workload, best_rates
from albot_env.rendering.canvas import paint_array, pixels_of
from albot_env.rendering.frame import Frame
from albot_env.rendering.scene import lay_out
from albot_env.tasks.core.single import SingleEnv

ENVIRONMENT = "Albot/Explore-v0"
AGENT, WORLD = "gap-explorer", "office-ring"
MAPPERS = "albot1", "scan-matching"
"""A map of surfaces and one of cells."""
SIZE = 800, 600
"""Width and height of the pictures (pixels)."""
FRAMES = 20
"""Pictures per turn."""

Row = dict[str, float | int | str]


def measure_painting(
    mappers: Sequence[str] = MAPPERS, steps: int = 600, rounds: int = 6
) -> list[Row]:
    """Time the painting of the last moment of an explorer's episode.

    The baseline runs in the same rounds: a picture of the same size that is only filled with a
    colour and read back as an array.

    Args:
        mappers: Names of the mappers.
        steps: Number of steps of the episode.
        rounds: Number of turns; the best counts.

    Returns:
        One row per mapper: `id`, `mapper`, `width` and `height` (pixels), `frames_per_second`,
        `frames_per_cpu_second`, and `ratio`, how many times as long as the empty picture it takes
        by processor time.
    """
    workloads = {name: _workload(last_frame(name, steps)) for name in mappers}
    rates = best_rates({_EMPTY: _fill, **workloads}, rounds)
    return [
        {
            "id": ENVIRONMENT,
            "mapper": name,
            "width": SIZE[0],
            "height": SIZE[1],
            "frames_per_second": rates[name].wall_clock,
            "frames_per_cpu_second": rates[name].cpu,
            "ratio": rates[_EMPTY].cpu / rates[name].cpu,
        }
        for name in mappers
    ]


_EMPTY = "an empty picture"


def last_frame(mapper: str, steps: int) -> Frame:
    """Return the frame after so many steps of the explorer."""
    settings = find_agent(AGENT).environment(ENVIRONMENT, {"world": WORLD, "mapper": mapper})
    env = gymnasium.make(ENVIRONMENT, render_mode="rgb_array", max_episode_steps=steps, **settings)
    agent = make_agent(AGENT, EnvironmentConfigs.of(env))
    observation, info = begin_episode(env, agent, 1)
    for _ in range(steps):
        observation, *_, info = env.step(choose_action(agent, observation, info))
    inside = env.unwrapped
    assert isinstance(inside, SingleEnv)
    frame = inside.frame
    env.close()
    return frame


def _workload(frame: Frame) -> Workload:
    def workload() -> int:
        for _ in range(FRAMES):
            paint_array(lay_out(frame), SIZE)
        return FRAMES

    return workload


def _fill() -> int:
    for _ in range(FRAMES):
        canvas = pygame.Surface(SIZE, depth=32)
        canvas.fill((0, 0, 0))
        pixels_of(canvas)
    return FRAMES
