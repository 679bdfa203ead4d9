"""On entering a place what is in view is marked as its own; the map keeps its shape."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.mappers.albot1.config import Albot1Config, Limits
from albot_core.mappers.albot1.entering import enter
from albot_core.mappers.albot1.memory import Memory, add_surface, empty_memory, living
from albot_core.mappers.albot1.sight import NOT_RECOGNIZED, Sight, empty_sight
from albot_core.mappers.albot1.visits import begin_visit, seen_in_visit
from albot_core.sensing.surfaces import CORNER

WALL, BEHIND, DOORPOST = (4.0, -2.0, 4.0, 2.0), (-9.0, 1.0, -9.0, -1.0), (1.0, 2.0, 3.0, 2.0)
OFF = np.array((0.1, 0.05, np.radians(1.0)))
"""How wrong the robot is about where it is (m, rad)."""


def remembering(*surfaces: tuple[float, ...]) -> Memory:
    memory = empty_memory()
    for surface in surfaces:
        add_surface(memory, np.array(surface), np.full(2, CORNER, np.int8))
    begin_visit(memory, np.zeros(3, np.int32))
    return memory


def seeing(*surfaces: tuple[float, ...]) -> Sight:
    """A view of these from about the origin."""
    sight = empty_sight()
    sight.size[0] = len(surfaces)
    for k, surface in enumerate(surfaces):
        sight.surfaces[k] = surface
    sight.edges[: len(surfaces)], sight.landmark[: len(surfaces)] = CORNER, True
    sight.pose[:] = OFF
    return sight


@pytest.fixture
def limits() -> Limits:
    return Albot1Config().limits


def test_what_is_remembered_stays_where_it_is(limits: Limits) -> None:
    memory = remembering(WALL, BEHIND)
    sight = seeing(WALL)
    enter(memory, sight, limits)
    assert np.array_equal(memory.surfaces[:2], [WALL, BEHIND])
    assert living(memory).tolist() == [True, True]
    assert sight.slots[0] == 0
    assert memory.met[1, 0] == 1


def test_what_is_in_view_is_of_the_new_visit_and_what_is_not_is_of_the_old(limits: Limits) -> None:
    memory = remembering(WALL, BEHIND)
    enter(memory, seeing(WALL), limits)
    assert memory.marks[:2].tolist() == [2, 1]
    assert np.array_equal(seen_in_visit(memory), [WALL])


def test_what_the_map_lacks_is_added_where_it_is_seen(limits: Limits) -> None:
    memory = remembering(WALL)
    sight = seeing(WALL, DOORPOST)
    enter(memory, sight, limits)
    assert sight.slots[:2].tolist() == [0, 1]
    assert memory.marks[:2].tolist() == [2, 2]
    seen_from_here = np.array(DOORPOST).reshape(2, 2) + OFF[:2]
    assert np.allclose(memory.surfaces[1].reshape(2, 2), seen_from_here, atol=0.06)


def test_both_parts_of_a_wall_remembered_in_two_are_in_view(limits: Limits) -> None:
    memory = remembering((4.0, -2.0, 4.0, -0.1), (4.0, 0.1, 4.0, 2.0))
    enter(memory, seeing(WALL), limits)
    assert memory.marks[:2].tolist() == [2, 2]
    assert living(memory).sum() == 2


def test_a_wall_seen_in_two_parts_is_still_the_one_remembered(limits: Limits) -> None:
    memory = remembering(WALL)
    sight = seeing((4.0, -2.0, 4.0, -0.1), (4.0, 0.1, 4.0, 2.0))
    enter(memory, sight, limits)
    assert sight.slots[:2].tolist() == [0, 0]
    assert living(memory).sum() == 1


def test_plain_walls_are_not_recognised_by_their_ends(limits: Limits) -> None:
    sight = seeing(WALL)
    sight.landmark[0] = False
    enter(remembering(WALL), sight, limits)
    assert sight.slots[0] == NOT_RECOGNIZED


def test_to_the_letter_the_view_takes_the_place_of_what_it_covers() -> None:
    memory = remembering(WALL)
    enter(memory, seeing(WALL), replace(Albot1Config.thesis(), eye_in_boundary=True).limits)
    (wall,) = seen_in_visit(memory)
    assert not np.allclose(wall, WALL, atol=0.01)
