"""What a batch makes of its settings, of seeds and of masks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from jaxtyping import Bool, Int64

from albot_core.errors import InputError
from albot_maps import World, WorldSet, load_worlds

Worlds = str | Path | World | WorldSet


def choose_mode(mode: str | AutoresetMode, task: str) -> AutoresetMode:
    """The mode in which episodes follow each other."""
    try:
        return AutoresetMode(mode)
    except ValueError:
        names = ", ".join(m.value for m in AutoresetMode)
        raise InputError(task, f"one of {names}", str(mode), place="autoreset_mode") from None


def choose_worlds(world: Worlds | Sequence[Worlds], count: int, task: str) -> list[WorldSet]:
    """The worlds of each environment; those of one spec are the same objects."""
    if isinstance(world, Sequence) and not isinstance(world, str):
        specs = list(world)
    else:
        specs = [world] * count
    if len(specs) != count:
        raise InputError(task, f"{count} worlds", str(len(specs)), place="world")
    loaded: dict[Any, WorldSet] = {}
    for row, spec in enumerate(specs):
        try:
            loaded[spec] = loaded.get(spec) or load_worlds(spec)
        except InputError as error:
            raise told(error, f"{task}, world of environment {row}") from None
    return [loaded[spec] for spec in specs]


def told(error: InputError, environment: str) -> InputError:
    """The same error, which says in which environment."""
    if error.source == environment:
        return error
    place = f"{error.source}, {error.place}" if error.place else error.source
    return InputError(environment, error.expected, error.found, place=place)


def choose_mask(mask: Any, count: int, task: str) -> Bool[np.ndarray, "environments"]:
    """Which environments a reset is for: all of them by default."""
    if mask is None:
        return np.ones(count, np.bool_)
    expected = f"an array of {count} bool, one of them true"
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (count,):
        raise InputError(task, expected, repr(mask), place="options.reset_mask")
    if not mask.any():
        raise InputError(task, expected, "none true", place="options.reset_mask")
    return mask


def choose_seeds(
    seed: Any, count: int, rows: Int64[np.ndarray, "some"], task: str
) -> list[int | None]:
    """The seeds of some environments out of `count`."""
    if seed is None:
        seeds: list[int | None] = [None] * count
    elif isinstance(seed, int | np.integer):
        seeds = [int(seed) + k for k in range(count)]
    else:
        seeds = list(np.atleast_1d(np.asarray(seed, object)))
    if len(seeds) != count:
        raise InputError(task, f"{count} seeds", str(len(seeds)), place="seed")
    for row, its_seed in enumerate(seeds):
        whole = isinstance(its_seed, int | np.integer) and not isinstance(its_seed, bool)
        if its_seed is not None and not (whole and its_seed >= 0):
            place = f"seed of environment {row}"
            raise InputError(task, "a whole number from 0", repr(its_seed), place=place)
    seeds = [None if its_seed is None else int(its_seed) for its_seed in seeds]
    return [seeds[row] for row in rows.tolist()]
