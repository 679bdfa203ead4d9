"""Shell sort, against Python's own."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from albot_core.kernels.sorting import sort, sort_order


@given(st.lists(st.integers(-9, 9) | st.floats(-9, 9), max_size=40))
def test_values_are_sorted(values):
    array, order = np.array(values, float), np.empty(len(values), np.int64)
    sort_order(array, order)
    assert sorted(order.tolist()) == list(range(len(values)))
    assert array[order].tolist() == sorted(array.tolist())
    first = sorted(array[:5].tolist()) + array[5:].tolist()
    sort(array, min(5, len(values)))
    assert array.tolist() == first
