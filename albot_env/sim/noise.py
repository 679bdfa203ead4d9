"""Compiled random numbers: a counter-based generator, a pure function of key and counter.

SplitMix64 (Steele, Lea and Flood, Fast splittable pseudorandom number generators, OOPSLA
2014) adds a constant to its state and scrambles the sum, so its n-th number can be computed
without the ones before it. The only state is the key and a counter, so a robot draws the same
bits alone or in a large batch.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from scipy.special import ndtri

from albot_core.kernels.compiled import kernel

NORMALS = 4096
"""Length of the table of normal numbers: it is indexed by 12 random bits."""

_STEP = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)


@kernel()
def draw(key: np.uint64, counter: int) -> np.uint64:
    """Return the 64 random bits of a key (uint64) and counter."""
    bits = key + _STEP * np.uint64(counter)
    bits = (bits ^ (bits >> np.uint64(30))) * _FIRST
    bits = (bits ^ (bits >> np.uint64(27))) * _SECOND
    return bits ^ (bits >> np.uint64(31))


@kernel()
def draw_uniform(key: np.uint64, counter: int) -> float:
    """Return a uniformly distributed number in [0, 1)."""
    return np.float64(draw(key, counter) >> np.uint64(11)) * 2.0**-53


@kernel()
def draw_normals(key: np.uint64, counter: int) -> tuple[float, float]:
    """Return two independent standard normal numbers, from two counters (Box-Muller transform)."""
    first, second = draw_uniform(key, counter), draw_uniform(key, counter + 1)
    radius = np.sqrt(-2.0 * np.log(1.0 - first))
    angle = 2.0 * np.pi * second
    return radius * np.cos(angle), radius * np.sin(angle)


def normal_table(deviation: float) -> Float64[np.ndarray, "numbers"]:
    """Return equally likely numbers whose distribution is normal with this standard deviation.

    They are the medians of NORMALS equally likely parts of the normal distribution, scaled up
    slightly because the medians of the outermost parts lose a little of the variance.
    """
    quantiles = ndtri((np.arange(NORMALS) + 0.5) / NORMALS)
    return np.asarray(deviation * quantiles / quantiles.std())
