"""Compiled random numbers: a counter-based generator, so a function of a key and of a counter.

SplitMix64 (Steele, Lea and Flood, Fast splittable pseudorandom number generators, OOPSLA
2014) adds a constant to its state and scrambles the sum, so its n-th number can be had
without the ones before. Nothing is kept but the key and a count, and a robot draws the same
bits alone and among a thousand others.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from scipy.special import ndtri

from albot_core.kernels.compiled import kernel

NORMALS = 4096
"""Length of the table of normal numbers: as many as 12 bits can choose from."""

_STEP = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)


@kernel()
def draw(key: np.uint64, counter: int) -> np.uint64:
    """The 64 random bits of this key (uint64) and counter."""
    bits = key + _STEP * np.uint64(counter)
    bits = (bits ^ (bits >> np.uint64(30))) * _FIRST
    bits = (bits ^ (bits >> np.uint64(27))) * _SECOND
    return bits ^ (bits >> np.uint64(31))


@kernel()
def draw_uniform(key: np.uint64, counter: int) -> float:
    """A number in [0, 1), each as likely as the others."""
    return np.float64(draw(key, counter) >> np.uint64(11)) * 2.0**-53


@kernel()
def draw_normals(key: np.uint64, counter: int) -> tuple[float, float]:
    """Two independent normal numbers, from two counters (Box and Muller's transform)."""
    first, second = draw_uniform(key, counter), draw_uniform(key, counter + 1)
    radius = np.sqrt(-2.0 * np.log(1.0 - first))
    angle = 2.0 * np.pi * second
    return radius * np.cos(angle), radius * np.sin(angle)


def normal_table(deviation: float) -> Float64[np.ndarray, "numbers"]:
    """Numbers that, each as likely as the others, are normal with this standard deviation.

    The middles of as many parts of the normal distribution, all equally likely; scaled, for
    the middles of the outermost leave a little of the variance out.
    """
    quantiles = ndtri((np.arange(NORMALS) + 0.5) / NORMALS)
    return np.asarray(deviation * quantiles / quantiles.std())
