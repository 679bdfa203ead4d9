"""Where an episode begins."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_maps import World, WorldSet


def choose_world(
    worlds: WorldSet, rng: np.random.Generator, options: Mapping[str, Any], environment: str
) -> World:
    """The world that the options of a reset ask for; by default one of the set, at random.

    Args:
        worlds: The worlds. Of one alone, nothing is drawn.
        rng: Draws the world.
        options: `{"world": k}` for the k-th of the set, or nothing.
        environment: Id of the environment, for the errors.

    Raises:
        InputError: Another option than `world` and `start`, or a world that is none.
    """
    if not isinstance(options, Mapping):
        raise InputError(environment, "a mapping", repr(options), place="options")
    unknown = sorted(set(options) - {"start", "world"})
    if unknown:
        expected = "the options start and world"
        raise InputError(environment, expected, ", ".join(unknown), place="options")
    number = options.get("world")
    if number is None:
        number = rng.integers(len(worlds)) if len(worlds) > 1 else 0
    if not _is_whole(number) or not 0 <= number < len(worlds):
        expected = f"a world's number below {len(worlds)}"
        raise InputError(environment, expected, repr(number), place="options.world")
    return worlds[int(number)]


def choose_start(
    world: World, rng: np.random.Generator, options: Mapping[str, Any], environment: str
) -> Pose:
    """The start that the options of a reset ask for; by default one of the world's, at random.

    Args:
        world: The world.
        rng: Draws the start.
        options: `{"start": k}` for the world's k-th start, `{"start": (x, y, heading)}` for
            a pose in the world's frame (m, rad), or nothing.
        environment: Id of the environment, for the errors.

    Raises:
        InputError: A start that is neither.
    """
    count = len(world.starts)
    start = options.get("start")
    if start is None:
        return np.asarray(world.starts[rng.integers(count)], np.float64)
    expected = f"a start's index below {count}, or x, y, heading"
    try:
        pose = np.asarray(start, np.float64)
    except (TypeError, ValueError):
        raise InputError(environment, expected, repr(start), place="options.start") from None
    if _is_whole(start) and 0 <= start < count:
        return np.asarray(world.starts[start], np.float64)
    if pose.shape != (3,):
        raise InputError(environment, expected, repr(start), place="options.start")
    return pose


def _is_whole(value: object) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
