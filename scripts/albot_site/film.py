"""The moving picture of the README: an agent explores, and its map grows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from PIL import Image

import albot_env
from albot_agents.agent import EnvironmentConfigs
from albot_agents.registry import make_agent
from albot_core.files import atomic_write

assert albot_env.__doc__  # Importing it registers the environments.

_WIDTH, _COLOURS = 800, 64


def film(path: Path, *, world: str, seed: int, steps: int, every: int) -> int:
    """Film the agent `gap-explorer` with the mapper `albot1`, and return the number of pictures.

    Args:
        path: The GIF.
        world: Spec of the world.
        seed: Seed of the episode.
        steps: Largest number of steps of the episode (0.1 s each).
        every: Steps from picture to picture.

    Raises:
        InputError: There is no such world.
        OSError: The disk is full.
    """
    env = gymnasium.make("Albot/Explore-v0", world=world, mapper="albot1", render_mode="rgb_array")
    agent = make_agent("gap-explorer", EnvironmentConfigs.of(env))
    observation, info = env.reset(seed=seed)
    agent.reset(np.random.default_rng(seed), env.action_space)
    pictures = [_picture(env)]
    for step in range(1, steps + 1):
        observation, _, terminated, truncated, info = env.step(agent.act(observation, info))
        if step % every == 0:
            pictures.append(_picture(env))
        if terminated or truncated:
            break
    env.close()
    # An octree keeps the colours of thin lines, which the median cut takes for grey.
    palette = pictures[-1].quantize(_COLOURS, Image.Quantize.FASTOCTREE)
    drawn = [each.quantize(palette=palette, dither=Image.Dither.NONE) for each in pictures]
    stay = [80] * (len(drawn) - 1) + [2500]
    with atomic_write(path) as stream:
        drawn[0].save(
            stream, "GIF", save_all=True, append_images=drawn[1:], duration=stay, loop=0,
            optimize=True,
        )  # fmt: skip
    return len(drawn)


def _picture(env: gymnasium.Env[Any, Any]) -> Image.Image:
    picture = Image.fromarray(np.asarray(env.render()))
    picture.thumbnail((_WIDTH, _WIDTH), Image.Resampling.LANCZOS)
    return picture
