"""How good a map must be to come home: success of episodes against their own error of home."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float64

from albot_agents.benchmark.cell import EpisodeResult
from albot_agents.benchmark.folder import CellResults
from albot_agents.benchmark.mappers import WORLDS, home_radius, is_carried
from albot_agents.benchmark.table import Estimate
from albot_agents.registry import BY_MAP
from albot_core.errors import InputError
from albot_core.evaluation.intervals import wilson
from albot_core.evaluation.logistic import Logistic, bootstrap_logistic, fit_logistic

LEVELS = (0.9, 0.5)
"""Probabilities of success for which the error is told."""
EDGES = (0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, np.inf)
"""Errors of home between which episodes are counted together (m)."""
LEAST = 0.01
"""Smallest error that is told apart from others (m)."""
_FEWEST = 5
"""Smallest number of episodes that are counted together."""
_FARTHEST = 3.0
"""Largest decimal logarithm of an error that an interval tells."""
_SEED = 0
"""Seed of the bootstrap."""


@dataclass(frozen=True, kw_only=True)
class Bin:
    """Episodes with about the same error of home."""

    error: float
    """Geometric mean of the errors (m)."""
    episodes: int
    """Number of episodes."""
    success: Estimate
    """Share of successes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HomingCurve:
    """Success of all episodes of a driver against the error of home when the return begins."""

    errors: Float64[np.ndarray, "episodes"]
    """The error of home of each episode (m)."""
    success: Bool[np.ndarray, "episodes"]
    """Whether each came home."""
    fit: Logistic
    """Probability of success by the decimal logarithm of the error (m)."""
    levels: Mapping[float, Estimate]
    """Error (m) at which the fit has each of `LEVELS`, as far as it is within those measured."""
    bins: Sequence[Bin]
    """The episodes counted together by their errors."""
    failures: int
    """Number of episodes that failed."""
    lost: int
    """Number of those at whose end home was believed farther off than counts as home."""
    keys: int
    """Number of different episodes of the protocol among them: mappers meet the same ones."""


def fit_curve(results: Iterable[CellResults], driver: str) -> HomingCurve | None:
    """Return the curve of a driver over all mappers and odometers; None without two errors.

    Episodes before which the robot was carried are left out: its map may be perfect, and yet it
    cannot know where it is.
    """
    episodes = [
        one
        for found in results
        if (found.cell.task, found.cell.agent, found.cell.worlds) == (BY_MAP, driver, WORLDS)
        for one in found.episodes
        if not is_carried(one) and one.info.get("home_error_begin") is not None
    ]
    errors = np.array([max(one.info["home_error_begin"], LEAST) for one in episodes], np.float64)
    success = np.array([bool(one.info["is_success"]) for one in episodes], np.bool_)
    x = np.log10(errors)
    try:
        fit = fit_logistic(x, success)
    except InputError:  # Fewer than two errors.
        return None
    rng = np.random.default_rng(_SEED)
    keys = [(one.world, one.seed) for one in episodes]
    fits = bootstrap_logistic(x, success, keys, rng)
    radius = home_radius()
    return HomingCurve(
        errors=errors,
        success=success,
        fit=fit,
        levels={level: found for level in LEVELS if (found := _level(fit, fits, level, errors))},
        bins=list(_bins(errors, success)),
        failures=int((~success).sum()),
        lost=sum(_is_lost(one, radius) for one in episodes),
        keys=len(set(keys)),
    )


def _level(
    fit: Logistic, fits: Sequence[Logistic], level: float, errors: Float64[np.ndarray, "episodes"]
) -> Estimate | None:
    """Return the error with a probability of success; None beyond the errors measured.

    Its interval counts a resample in which success does not fall with the error, and which so has
    no such error, as the farthest.
    """
    x, (low, high) = fit.x_at(level), np.log10((errors.min(), errors.max())).tolist()
    if fit.slope >= 0 or not low <= x <= high or not fits:
        return None
    found = np.clip(
        [one.x_at(level) if one.slope < 0 else _FARTHEST for one in fits], -_FARTHEST, _FARTHEST
    )
    low, high = (10 ** np.quantile(found, (0.025, 0.975))).tolist()
    return Estimate(value=10.0**x, ci95=(low, high))


def _bins(
    errors: Float64[np.ndarray, "episodes"], success: Bool[np.ndarray, "episodes"]
) -> Iterable[Bin]:
    for low, high in pairwise(EDGES):
        inside = (errors >= low) & (errors < high)
        count, home = int(inside.sum()), int(success[inside].sum())
        if count >= _FEWEST:
            yield Bin(
                error=float(np.exp(np.log(errors[inside]).mean())),
                episodes=count,
                success=Estimate(value=home / count, ci95=wilson(home, count)),
            )


def _is_lost(episode: EpisodeResult, radius: float) -> bool:
    """Return whether an episode failed with home believed farther off than the radius of home."""
    error = episode.info.get("home_error")
    return not episode.info["is_success"] and error is not None and error > radius
