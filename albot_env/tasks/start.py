"""Where an episode begins."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_maps import World


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
        InputError: Another option, or a start that is neither.
    """
    unknown = sorted(set(options) - {"start"})
    if unknown:
        raise InputError(environment, "the option start", ", ".join(unknown), place="options")
    count = len(world.starts)
    start = options.get("start")
    if start is None:
        return np.asarray(world.starts[rng.integers(count)], np.float64)
    expected = f"a start's index below {count}, or x, y, heading"
    try:
        pose = np.asarray(start, np.float64)
    except (TypeError, ValueError):
        raise InputError(environment, expected, repr(start), place="options.start") from None
    if isinstance(start, int | np.integer) and 0 <= start < count:
        return np.asarray(world.starts[start], np.float64)
    if pose.shape != (3,):
        raise InputError(environment, expected, repr(start), place="options.start")
    return pose
