"""What a page keeps of a changing map, against the states that it was told."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.maps.layers import OccupancyGridLayer
from albot_env.recording.layers import UNKNOWN
from albot_env.rendering.page.tables import (
    FrameTable,
    GridTable,
    LifetimeTable,
    millimetres,
)

ROWS = st.lists(st.tuples(*[st.integers(0, 3)] * 2), max_size=6)
CELLS = st.lists(st.sampled_from([0.0, 0.5, 1.0, np.nan]), min_size=6, max_size=6)


@given(st.lists(ROWS, max_size=8))
def test_the_rows_alive_at_a_version_are_those_it_was_told(states: list[list]) -> None:
    table = LifetimeTable(2)
    for version, state in enumerate(states):
        table.update(version, np.array(state, np.int32).reshape(-1, 2))
    arrays = table.arrays
    assert (np.diff(arrays["births"]) >= 0).all()
    for version, state in enumerate(states):
        alive = (arrays["births"] <= version) & (
            (arrays["deaths"] < 0) | (arrays["deaths"] > version)
        )
        assert sorted(map(tuple, arrays["rows"][alive].tolist())) == sorted(set(state))


def test_a_row_that_stays_is_kept_once() -> None:
    table = LifetimeTable(4)
    for version in range(50):
        table.update(version, np.array([[1, 2, 3, 4], [5, 6, 7, version // 25]], np.int32))
    assert len(table.arrays["rows"]) == 3


@given(st.lists(ROWS, max_size=8))
def test_frames_are_found_by_their_ends(states: list[list]) -> None:
    table = FrameTable(2)
    for version, state in enumerate(states):
        table.update(2 * version, np.array(state).reshape(-1, 2))
    arrays = table.arrays
    begins = np.append(0, arrays["ends"])
    for number, state in enumerate(states):
        rows = arrays["rows"][begins[number] : begins[number + 1]]
        assert list(map(tuple, rows.tolist())) == state
    assert arrays["versions"].tolist() == [2 * k for k in range(len(states))]


def _grid(cells: list[float], x: float = 0.0) -> OccupancyGridLayer:
    occupancy = np.array(cells, np.float32).reshape(2, 3)
    return OccupancyGridLayer(origin=np.array((x, 0.0, 0.0)), resolution=0.5, occupancy=occupancy)


def _read(arrays: dict[str, np.ndarray], version: int) -> np.ndarray:
    """The grid at a version, by the rule of the table's docstring."""
    whole = arrays["whole"]
    number = np.flatnonzero(whole[:, 0] <= version)[-1]
    sizes = whole[:, 1] * whole[:, 2]
    begin = sizes[:number].sum()
    cells = arrays["cells"][begin : begin + sizes[number]].copy()
    begins = np.append(0, arrays["ends"])
    for k, at in enumerate(arrays["versions"]):
        if whole[number, 0] <= at <= version:
            span = slice(begins[k], begins[k + 1])
            cells[arrays["changed"][span]] = arrays["values"][span]
    return cells


@given(st.lists(st.tuples(CELLS, st.sampled_from([0.0, 1.0])), min_size=1, max_size=10))
@settings(max_examples=60)
def test_a_grid_is_what_it_was_at_each_version(states: list) -> None:
    table = GridTable()
    for version, (cells, x) in enumerate(states):
        table.update(version, _grid(cells, x))
    arrays = table.arrays
    for version, (cells, x) in enumerate(states):
        expected = [UNKNOWN if np.isnan(cell) else round(254 * cell) for cell in cells]
        assert _read(arrays, version).tolist() == expected
        number = np.flatnonzero(arrays["whole"][:, 0] <= version)[-1]
        assert arrays["places"][number].tolist() == [x, 0.0, 0.0, 0.5]
    # No reader applies more changes than there are cells.
    assert len(arrays["changed"]) <= len(arrays["whole"]) * 6


def test_lengths_beyond_32_bits_stay_at_their_end() -> None:
    assert millimetres(np.array((1.2345, -1e12, 1e12))).tolist() == [1234, -(2**31 - 1), 2**31 - 1]
