"""The map's grid against a slow search through all surfaces."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.albot1.memory import (
    ALIVE,
    FREE,
    STORED,
    Memory,
    add_surface,
    empty_memory,
    move_surface,
    rebuilt_memory,
    remove_surface,
    surfaces_ending_in,
    with_room,
)
from albot_core.errors import InputError

coordinate = st.floats(-30, 30)
surface = st.tuples(coordinate, coordinate, coordinate, coordinate).map(np.array)
EDGES = np.zeros(2, np.int8)


def slow_search(memory: Memory, box: np.ndarray) -> list[int]:
    def inside(x: float, y: float) -> bool:
        return bool(box[0] <= x <= box[2] and box[1] <= y <= box[3])

    return [
        slot
        for slot, (x1, y1, x2, y2) in enumerate(memory.surfaces)
        if memory.ids[slot] >= 0 and (inside(x1, y1) or inside(x2, y2))
    ]


@settings(deadline=None, max_examples=60)
@given(
    st.lists(st.tuples(st.sampled_from("aaarm"), surface, st.integers(0, 10**6)), max_size=80),
    st.tuples(coordinate, coordinate, st.floats(0, 40), st.floats(0, 40)),
)
def test_the_grid_finds_what_the_slow_search_finds(
    acts: list[tuple[str, np.ndarray, int]], where: tuple[float, float, float, float]
) -> None:
    memory = empty_memory(4)
    for act, ends, pick in acts:
        memory = with_room(memory, 1)
        living = np.flatnonzero(memory.ids >= 0)
        if act == "a" or len(living) == 0:
            add_surface(memory, ends, EDGES)
        elif act == "r":
            remove_surface(memory, int(living[pick % len(living)]))
        else:
            move_surface(memory, int(living[pick % len(living)]), ends, EDGES)
    box = np.array([where[0], where[1], where[0] + where[2], where[1] + where[3]])
    assert surfaces_ending_in(memory, box).tolist() == slow_search(memory, box)
    assert memory.counts[ALIVE] == (memory.ids >= 0).sum()
    assert memory.counts[FREE] == (memory.ids < 0).sum()


def test_ids_are_never_used_twice() -> None:
    memory = empty_memory(4)
    first = add_surface(memory, np.zeros(4), EDGES)
    first_id = int(memory.ids[first])
    remove_surface(memory, first)
    again = add_surface(memory, np.zeros(4), EDGES)
    assert again == first
    assert memory.ids[again] == first_id + 1


def test_a_grown_map_uses_its_slots_in_the_same_order() -> None:
    small, large = empty_memory(2), empty_memory(512)
    for k in range(200):
        small = with_room(small, 1)
        ends = np.array([k, 0.0, k, 1.0])
        assert add_surface(small, ends, EDGES) == add_surface(large, ends, EDGES)


def stored() -> dict[str, np.ndarray]:
    memory = empty_memory(8)
    for k in range(5):
        add_surface(memory, np.array([k, 0.0, k, 1.0]), EDGES)
    remove_surface(memory, 2)
    return {field: getattr(memory, field).copy() for field in STORED}


def test_a_rebuilt_map_finds_the_same() -> None:
    memory = rebuilt_memory(stored())
    assert surfaces_ending_in(memory, np.array([0.5, -1.0, 9.0, 0.5])).tolist() == [1, 3, 4]


@pytest.mark.parametrize(
    ("field", "index", "value"),
    [("free", 0, 99), ("ids", 0, 1), ("ids", 0, 77), ("counts", 0, 3), ("surfaces", 0, np.nan)],
)
def test_contradictions_are_refused(field: str, index: int, value: float) -> None:
    arrays = stored()
    arrays[field][index] = value
    with pytest.raises(InputError, match="memory"):
        rebuilt_memory(arrays)
