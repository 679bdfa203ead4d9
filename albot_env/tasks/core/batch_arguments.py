"""Arguments of a batch of environments, checked: autoreset mode, worlds, seeds and reset masks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from jaxtyping import Bool, Int64

from albot_core.errors import InputError
from albot_env.tasks.core.settings import Worlds, check_seed
from albot_maps import WorldSet, load_worlds


def choose_mode(mode: str | AutoresetMode, environment: str) -> AutoresetMode:
    """Return the autoreset mode."""
    try:
        return AutoresetMode(mode)
    except ValueError:
        names = ", ".join(m.value for m in AutoresetMode)
        raise InputError(
            environment, f"one of {names}", str(mode), place="autoreset_mode"
        ) from None


def choose_worlds(
    world: Worlds | Sequence[Worlds | list[str]], count: int, environment: str, robot_radius: float
) -> list[WorldSet]:
    """Return the worlds of each environment; those of one spec are the same objects."""
    if isinstance(world, Sequence) and not isinstance(world, str):
        specs = list(world)
    else:
        specs = [world] * count
    if len(specs) != count:
        raise InputError(environment, f"{count} worlds", str(len(specs)), place="world")
    loaded: dict[Any, WorldSet] = {}
    chosen = []
    for row, spec in enumerate(specs):
        key: Any = spec if isinstance(spec, Worlds) else None
        if isinstance(spec, list) and all(isinstance(each, str) for each in spec):
            key = tuple(spec)
        try:
            found = loaded.get(key) or load_worlds(spec, robot_radius)
        except InputError as error:
            raise named(error, f"{environment}, world of environment {row}") from None
        loaded[key] = found  # Never for None: such a spec was refused.
        chosen.append(found)
    return chosen


def named(error: InputError, environment: str) -> InputError:
    """Return the same error with the environment named in it."""
    if error.source == environment:
        return error
    place = f"{error.source}, {error.place}" if error.place else error.source
    return InputError(environment, error.expected, error.found, place=place)


def choose_mask(mask: Any, count: int, environment: str) -> Bool[np.ndarray, "environments"]:
    """Return which environments a reset is for; by default all."""
    if mask is None:
        return np.ones(count, np.bool_)
    expected = f"an array of {count} bool, one of them true"
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (count,):
        raise InputError(environment, expected, repr(mask), place="options.reset_mask")
    if not mask.any():
        raise InputError(environment, expected, "none true", place="options.reset_mask")
    return mask


def choose_seeds(
    seed: Any, count: int, rows: Int64[np.ndarray, "some"], environment: str
) -> list[int | None]:
    """Return the seeds of the environments `rows` out of `count`."""
    if seed is None:
        seeds: list[int | None] = [None] * count
    elif isinstance(seed, Sequence | np.ndarray) and not isinstance(seed, str):
        seeds = list(np.atleast_1d(np.asarray(seed, object)))
    else:
        first = check_seed(seed, environment)
        seeds = [first + k for k in range(count)]
    if len(seeds) != count:
        raise InputError(environment, f"{count} seeds", str(len(seeds)), place="seed")
    seeds = [
        None
        if its_seed is None
        else check_seed(its_seed, environment, f"seed of environment {row}")
        for row, its_seed in enumerate(seeds)
    ]
    return [seeds[row] for row in rows.tolist()]
