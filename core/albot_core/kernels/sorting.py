"""Shell sort in compiled code: numba takes seconds to compile its own sort."""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel


@kernel()
def sort(values: np.ndarray, count: int) -> None:
    """Sort the first `count` values in place."""
    gap = count // 2
    while gap > 0:
        for i in range(gap, count):
            value, at = values[i], i
            while at >= gap and values[at - gap] > value:
                values[at] = values[at - gap]
                at -= gap
            values[at] = value
        gap //= 2


@kernel()
def sort_order(keys: np.ndarray, order: np.ndarray) -> None:
    """Fill `order` with the indices that sort the keys in ascending order."""
    for k in range(order.shape[0]):
        order[k] = k
    gap = order.shape[0] // 2
    while gap > 0:
        for i in range(gap, order.shape[0]):
            moved, at = order[i], i
            while at >= gap and keys[order[at - gap]] > keys[moved]:
                order[at] = order[at - gap]
                at -= gap
            order[at] = moved
        gap //= 2
