"""The map's grid against a slow search through all surfaces."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.mappers.albot1.perceptual_map.memory import (
    ALIVE,
    CELL,
    USED,
    PerceptualMap,
    add_surface,
    bucket_of,
    clear_map,
    empty_map,
    find_surfaces,
    living,
    move_surface,
    remove_surface,
    room_left,
)
from albot_core.mappers.albot1.state import MAP, enlarged_map, rebuilt_map, stored_map

coordinate = st.floats(-30, 30)
surface = st.tuples(coordinate, coordinate, coordinate, coordinate).map(np.array)
EDGES = np.zeros(2, np.int8)


def slow_search(pm: PerceptualMap, box: np.ndarray) -> list[int]:
    def inside(x: float, y: float) -> bool:
        return bool(box[0] <= x <= box[2] and box[1] <= y <= box[3])

    return [
        slot
        for slot in np.flatnonzero(living(pm)).tolist()
        for x1, y1, x2, y2 in [pm.surfaces[slot]]
        if inside(x1, y1) or inside(x2, y2)
    ]


def ending_in(pm: PerceptualMap, box: np.ndarray) -> list[int]:
    found = np.full(2 * pm.counts[ALIVE] + 2, -7)
    slots = found[: find_surfaces(pm, box, found[:-1])].tolist()
    assert found[-1] == -7  # It has kept to its room.
    return slots


@settings(deadline=None, max_examples=60)
@given(
    st.lists(st.tuples(st.sampled_from("aaarm"), surface, st.integers(0, 10**6)), max_size=80),
    st.tuples(coordinate, coordinate, st.floats(0, 40), st.floats(0, 40)),
)
def test_the_grid_finds_what_the_slow_search_finds(
    acts: list[tuple[str, np.ndarray, int]], where: tuple[float, float, float, float]
) -> None:
    pm = empty_map(4)
    for act, ends, pick in acts:
        pm = pm if room_left(pm) else enlarged_map(pm)
        slots = np.flatnonzero(living(pm))
        if act == "a" or len(slots) == 0:
            add_surface(pm, ends, EDGES)
        elif act == "r":
            remove_surface(pm, int(slots[pick % len(slots)]))
        else:
            move_surface(pm, int(slots[pick % len(slots)]), ends, EDGES)
    box = np.array([where[0], where[1], where[0] + where[2], where[1] + where[3]])
    assert ending_in(pm, box) == slow_search(pm, box)
    assert pm.counts[ALIVE] == living(pm).sum()
    assert room_left(pm) == len(pm.ids) - living(pm).sum()


@pytest.mark.parametrize("side", [4.0, 18.0, 40.0])
def test_few_and_many_surfaces_are_found_alike(side: float) -> None:
    # Two ways of searching: through all surfaces, and cell by cell.
    rng = np.random.default_rng(0)
    pm = empty_map(512)
    for ends in rng.uniform(0, 30, (500, 4)):
        add_surface(pm, ends, EDGES)
    box = np.array([5.0, 5.0, 5.0 + side, 5.0 + side])
    found = ending_in(pm, box)
    assert found == slow_search(pm, box)
    assert 0 < len(found) < 500
    assert (side < 20) == (pm.counts[USED] >= 4 * (side / CELL) ** 2)


def test_where_cells_share_a_bucket_no_surface_is_found_twice() -> None:
    pm, cells = empty_map(512), list(product(range(11), repeat=2))
    buckets = [bucket_of(column, row, len(pm.heads)) for column, row in cells]
    shared = [cell for cell, k in zip(cells, buckets, strict=True) if buckets.count(k) > 1]
    assert shared
    for k in range(500):
        corner = CELL * np.array(shared[k % len(shared)], float)
        add_surface(pm, np.array([*corner + 0.5, *corner + 1.0]), EDGES)
    box = np.array([0.0, 0.0, 10.9 * CELL, 10.9 * CELL])
    assert pm.counts[USED] >= 4 * (10.9) ** 2  # It searches cell by cell.
    assert ending_in(pm, box) == list(range(500))


def test_a_map_that_forgot_is_as_new() -> None:
    pm = rebuilt_map(stored())
    clear_map(pm)
    assert len(living(pm)) == 0
    assert ending_in(pm, np.array([-1.0, -1.0, 9.0, 1.5])) == []
    assert ending_in(pm, np.array([-90.0, -90.0, 90.0, 90.0])) == []
    assert add_surface(pm, np.zeros(4), EDGES) == pm.ids[0] == 0


def test_ids_are_never_used_twice() -> None:
    pm = empty_map(4)
    first = add_surface(pm, np.zeros(4), EDGES)
    first_id = int(pm.ids[first])
    remove_surface(pm, first)
    again = add_surface(pm, np.zeros(4), EDGES)
    assert again == first
    assert pm.ids[again] == first_id + 1


def test_a_grown_map_uses_its_slots_in_the_same_order() -> None:
    small, large = empty_map(2), empty_map(512)
    for k in range(200):
        small = small if room_left(small) else enlarged_map(small)
        ends = np.array([k, 0.0, k, 1.0])
        assert add_surface(small, ends, EDGES) == add_surface(large, ends, EDGES)


def stored() -> dict[str, np.ndarray]:
    pm = empty_map(8)
    for k in range(5):
        add_surface(pm, np.array([k, 0.0, k, 1.0]), EDGES)
    remove_surface(pm, 2)
    return {name: array.copy() for name, array in stored_map(pm).items()}


def test_a_rebuilt_map_finds_the_same() -> None:
    pm = rebuilt_map(stored())
    assert ending_in(pm, np.array([0.5, -1.0, 9.0, 0.5])) == [1, 3, 4]


@pytest.mark.parametrize(
    ("field", "index", "value"),
    [
        ("free", 0, 99),
        ("ids", 0, 1),
        ("ids", 0, 77),
        ("counts", 0, 3),
        ("counts", 3, 4),
        ("surfaces", 0, np.nan),
        ("surfaces", 2, 0.0),
        ("surfaces", (2, 0), 0.0),
    ],
)
def test_contradictions_are_refused(field: str, index: Any, value: float) -> None:
    arrays = stored()
    MAP.check(arrays)
    arrays[f"memory.{field}"][index] = value
    with pytest.raises(InputError, match="memory"):
        MAP.check(arrays)
