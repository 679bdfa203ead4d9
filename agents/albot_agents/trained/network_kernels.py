"""Compiled arithmetic of networks, the same to the last bit on every processor.

BLAS adds up a product in the order that suits the processor's vectors, and numpy's exponential and
hyperbolic tangent differ between processors, too. After some hundred steps an agent's way differs
then. Here a sum is added up in the order of its terms, and functions are made of additions,
multiplications and divisions, which IEEE 754 defines to the last bit; numba does not fuse them.
This was tried on x86 processors alone, with and without AVX.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.kernels.compiled import kernel

_LARGEST = 150.0
"""Exponents beyond ± this give 0 or infinity in single precision."""
_POWERS = 2.0 ** np.arange(-220.0, 221.0)
"""Powers of two, by their exponent plus half of the array's length."""
_LN2_HIGH, _LN2_LOW = 0.693147180369123816490, 1.90821492927058770002e-10
"""The logarithm of two in two parts; the first has so few digits that its multiples are exact
(Cody and Waite, Software manual for the elementary functions, 1980)."""
_TERMS = np.array([1.0 / math.factorial(k) for k in range(13, -1, -1)])
"""Coefficients of the series of the exponential, from the highest power."""


@kernel()
def _exponential(value: float) -> float:
    """Return e to a value, which is clipped to ±150, with a relative error below 1e-14.

    The series converges to double precision up to half a power of two.
    """
    if math.isnan(value):  # It has no place among the powers; a network of huge weights makes it.
        return value
    value = min(max(value, -_LARGEST), _LARGEST)
    power = math.floor(value / (_LN2_HIGH + _LN2_LOW) + 0.5)
    rest = (value - power * _LN2_HIGH) - power * _LN2_LOW
    total = 0.0
    for term in _TERMS:
        total = total * rest + term
    scale: float = _POWERS[int(power) + len(_POWERS) // 2]
    return total * scale


@kernel()
def _hyperbolic_tangent(value: float) -> float:
    less = _exponential(-2.0 * abs(value))
    return math.copysign((1.0 - less) / (1.0 + less), value)


@kernel(arrays=True)
def multiply(rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the product of two matrices, added up in double precision.

    Args:
        rows: The first (rows, terms), in single precision.
        columns: The second (terms, columns), in single precision.
    """
    products = np.empty((rows.shape[0], columns.shape[1]), np.float32)
    totals = np.empty(columns.shape[1])
    for row in range(rows.shape[0]):
        totals[:] = 0.0
        for term in range(rows.shape[1]):
            factor = np.float64(rows[row, term])
            if factor != 0.0:  # The rim of a filtered patch, and what a ReLU has cut off.
                for column in range(len(totals)):  # Independent sums: compiled to vectors.
                    totals[column] += factor * np.float64(columns[term, column])
        for column in range(len(totals)):
            products[row, column] = totals[column]
    return products


@kernel(arrays=True)
def exponential(values: np.ndarray) -> np.ndarray:
    """Return e to each of some values, in single precision."""
    powers = np.empty(values.shape, np.float32)
    for place, value in np.ndenumerate(values):
        powers[place] = _exponential(np.float64(value))
    return powers


@kernel(arrays=True)
def hyperbolic_tangent(values: np.ndarray) -> np.ndarray:
    """Return the hyperbolic tangent of each of some values, in single precision."""
    tangents = np.empty(values.shape, np.float32)
    for place, value in np.ndenumerate(values):
        tangents[place] = _hyperbolic_tangent(np.float64(value))
    return tangents


@kernel(arrays=True)
def softmax(scores: np.ndarray) -> np.ndarray:
    """Return the softmax of each row of scores, in single precision."""
    shares = np.empty(scores.shape, np.float32)
    for row in range(len(scores)):
        largest, total = np.float64(scores[row].max()), 0.0
        for column in range(scores.shape[1]):
            total += _exponential(np.float64(scores[row, column]) - largest)
        for column in range(scores.shape[1]):
            share = _exponential(np.float64(scores[row, column]) - largest)
            shares[row, column] = share / total
    return shares
