"""On entering a place what is in view is marked as its own; the map keeps its shape."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.mappers.albot1.config import Albot1Config, Albot1Limits
from albot_core.mappers.albot1.perceptual_map.memory import (
    NOT_RECOGNIZED,
    VISIT,
    LocatedView,
    PerceptualMap,
    add_surface,
    empty_map,
    empty_view,
    living,
)
from albot_core.mappers.albot1.places.visits import begin_visit, enter_place, seen_since
from albot_core.sensing.view import CORNER

WALL, BEHIND, DOORPOST = (4.0, -2.0, 4.0, 2.0), (-9.0, 1.0, -9.0, -1.0), (1.0, 2.0, 3.0, 2.0)
OFF = np.array((0.1, 0.05, np.radians(1.0)))
"""How wrong the robot is about where it is (m, rad)."""


def remembering(*surfaces: tuple[float, ...]) -> PerceptualMap:
    pm = empty_map()
    for surface in surfaces:
        add_surface(pm, np.array(surface), np.full(2, CORNER, np.int8))
    begin_visit(pm, np.zeros(3, np.int32), np.arange(3, dtype=np.int32))
    return pm


def seeing(*surfaces: tuple[float, ...]) -> LocatedView:
    """A view of these from about the origin."""
    view = empty_view()
    view.size[0] = len(surfaces)
    for k, surface in enumerate(surfaces):
        view.surfaces[k] = surface
    view.edges[: len(surfaces)], view.landmark[: len(surfaces)] = CORNER, True
    view.pose[:] = OFF
    return view


@pytest.fixture
def limits() -> Albot1Limits:
    return Albot1Config().limits


def test_what_is_remembered_stays_where_it_is(limits: Albot1Limits) -> None:
    pm = remembering(WALL, BEHIND)
    view = seeing(WALL)
    enter_place(pm, view, limits)
    assert np.array_equal(pm.surfaces[:2], [WALL, BEHIND])
    assert living(pm).tolist() == [True, True]
    assert view.slots[0] == 0
    assert pm.reobserved[1, 0] == 1


def test_what_is_in_view_is_of_the_new_visit_and_what_is_not_is_of_the_old(
    limits: Albot1Limits,
) -> None:
    pm = remembering(WALL, BEHIND)
    enter_place(pm, seeing(WALL), limits)
    assert pm.marks[:2].tolist() == [2, 1]
    assert np.array_equal(seen_since(pm, int(pm.counts[VISIT])), [WALL])


def test_what_the_map_lacks_is_added_where_it_is_seen(limits: Albot1Limits) -> None:
    pm = remembering(WALL)
    view = seeing(WALL, DOORPOST)
    enter_place(pm, view, limits)
    assert view.slots[:2].tolist() == [0, 1]
    assert pm.marks[:2].tolist() == [2, 2]
    seen_from_here = np.array(DOORPOST).reshape(2, 2) + OFF[:2]
    assert np.allclose(pm.surfaces[1].reshape(2, 2), seen_from_here, atol=0.06)


def test_both_parts_of_a_wall_remembered_in_two_are_in_view(limits: Albot1Limits) -> None:
    pm = remembering((4.0, -2.0, 4.0, -0.1), (4.0, 0.1, 4.0, 2.0))
    enter_place(pm, seeing(WALL), limits)
    assert pm.marks[:2].tolist() == [2, 2]
    assert living(pm).sum() == 2


def test_a_wall_seen_in_two_parts_is_still_the_one_remembered(limits: Albot1Limits) -> None:
    pm = remembering(WALL)
    view = seeing((4.0, -2.0, 4.0, -0.1), (4.0, 0.1, 4.0, 2.0))
    enter_place(pm, view, limits)
    assert view.slots[:2].tolist() == [0, 0]
    assert living(pm).sum() == 1


def test_plain_walls_are_not_recognised_by_their_ends(limits: Albot1Limits) -> None:
    view = seeing(WALL)
    view.landmark[0] = False
    enter_place(remembering(WALL), view, limits)
    assert view.slots[0] == NOT_RECOGNIZED


def test_to_the_letter_the_view_takes_the_place_of_what_it_covers() -> None:
    pm = remembering(WALL)
    enter_place(pm, seeing(WALL), replace(Albot1Config.thesis(), robot_in_boundary=True).limits)
    (wall,) = seen_since(pm, int(pm.counts[VISIT]))
    assert not np.allclose(wall, WALL, atol=0.01)
