"""Exits: found in views by closed forms, remembered, forgotten when shut, and crossed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, inverse, transform_segments
from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.albot1.perceptual_map.memory import LocatedView, empty_view
from albot_core.mappers.albot1.places.exits import (
    CROSSING_EXPECTED,
    CROSSING_SEEN,
    FAR,
    MAX_EXITS,
    NOT_CROSSING,
    THROUGH,
    WIDE,
    ExitMemory,
    cross_exit,
    empty_exits,
    expect_exits,
    remember_exits,
)
from albot_core.mappers.albot1.state import EXITS, rebuilt_exits, stored_exits
from albot_core.sensing.reading import Reading
from albot_core.sensing.view import ViewConfig, construct_view
from tests.core.scenes import OUTSIDE, scan_from, two_rooms

LIMITS = Albot1Config().limits


def seen_exits(pose: tuple[float, ...], walls: np.ndarray) -> np.ndarray:
    """The exits that are seen from a pose, in the walls' frame (n, 4)."""
    mapper = Albot1()
    scan = scan_from(np.array(pose, float), walls)
    mapper.update(Reading(stamp=0.0, motion=np.zeros(3), laser=scan))
    return transform_segments(np.array(pose, float), mapper.exits)


def sight_of(pose: np.ndarray, walls: np.ndarray) -> LocatedView:
    seen = construct_view(scan_from(pose, walls), ViewConfig(fit_lines=True))
    view = empty_view()
    count = len(seen.surfaces)
    view.surfaces[:count], view.edges[:count] = seen.surfaces, seen.edges
    view.size[0], view.pose[:] = count, pose
    return view


@pytest.mark.parametrize(
    "pose",
    [(0, 0, 0), (0, 1.5, 0), (0, 3, -0.6), (1, 2.5, -1.0), (1.5, -2, 1.0), (0.5, 0, 0.4)],
)
@pytest.mark.parametrize("width", [0.8, 0.9, 1.1])
def test_a_doorway_is_seen_straight_and_obliquely(pose, width):
    (exit_line,) = seen_exits(pose, two_rooms(width))
    # An end is known to a beam, on a wall as oblique as it is seen; the right one comes first.
    true = np.array([2.5, -width / 2, 2.5, width / 2])
    np.testing.assert_allclose(exit_line, true, atol=0.12)


@pytest.mark.parametrize("width", [0.4, 1.8])
def test_gaps_of_other_widths_are_no_exits(width):
    assert len(seen_exits((0, 0, 0), two_rooms(width))) == 0


def test_a_shut_door_is_no_exit():
    assert len(seen_exits((0, 0, 0), two_rooms(shut=True))) == 0


def test_a_gap_between_a_cupboard_and_a_wall_is_no_exit():
    # 0.9 m between a cupboard's front and the side wall, but behind it is the room's end.
    cupboard = [(1.5, -3, 1.5, 0), (1.5, 0, 2.5, 0), (2.5, -3, 1.5, -3)]
    room = [(2.5, -4, 2.5, 0.9), (-3, 0.9, 2.5, 0.9), (-3, -4, 2.5, -4), (-3, -4, -3, 0.9)]
    walls = np.array([*cupboard, *room], float)
    assert len(seen_exits((-1, -0.5, 0), walls)) == 0


def test_pillars_are_no_walls_beside_an_exit():
    pillars = []
    for y in (-0.6, 0.6):
        corners = [(1.5, y - 0.1), (1.7, y - 0.1), (1.7, y + 0.1), (1.5, y + 0.1)]
        pillars += [(*corners[i], *corners[(i + 1) % 4]) for i in range(4)]
    assert len(seen_exits((0, 0, 0), np.array([*pillars, *OUTSIDE]))) == 0


@settings(deadline=None)
@given(
    x=st.floats(-0.5, 1.6),
    y=st.floats(-2.5, 2.5),
    heading=st.floats(-0.3, 0.3),
    motion=st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3)),
)
def test_moving_the_whole_world_moves_the_exits(x, y, heading, motion):
    pose, moved = np.array([x, y, heading]), np.array(motion)
    walls = two_rooms()
    here, there = empty_exits(), empty_exits()
    view = sight_of(pose, walls)
    remember_exits(here, view, LIMITS)
    view.pose[:] = compose(moved, pose)
    remember_exits(there, view, LIMITS)
    assert there.counts.tolist() == here.counts.tolist()
    seen = here.counts[0]
    expected = transform_segments(moved, here.lines[:seen])
    np.testing.assert_allclose(there.lines[:seen], expected, atol=1e-9)


def test_an_exit_seen_again_is_one_and_stands_where_it_is_seen_last():
    exits = empty_exits()
    for x in (0.0, 0.5, 1.0):
        remember_exits(exits, sight_of(np.array([x, 0.2, 0.0]), two_rooms()), LIMITS)
    assert exits.counts[0] == 1
    shifted = sight_of(np.array([0.0, 0.2, 0.0]), two_rooms())
    shifted.pose[:] = (0.3, 0.2, 0.0)
    remember_exits(exits, shifted, LIMITS)
    assert exits.counts[0] == 1
    np.testing.assert_allclose(exits.lines[0, [0, 2]], 2.8, atol=0.02)


def test_an_exit_seen_shut_is_forgotten_and_one_out_of_view_is_not():
    exits = empty_exits()
    remember_exits(exits, sight_of(np.zeros(3), two_rooms()), LIMITS)
    turned_away = np.array([0.0, 0.0, np.pi])
    remember_exits(exits, sight_of(turned_away, two_rooms(shut=True)), LIMITS)
    assert exits.counts[0] == 1
    remember_exits(exits, sight_of(np.zeros(3), two_rooms(shut=True)), LIMITS)
    assert exits.counts[0] == 0


def test_the_farthest_exit_makes_room_for_a_new_one():
    exits = empty_exits()
    for k in range(MAX_EXITS):
        exits.lines[k] = (10.0 * k + 30, 5, 10.0 * k + 30, 6)
    exits.counts[0] = MAX_EXITS
    remember_exits(exits, sight_of(np.zeros(3), two_rooms()), LIMITS)
    assert exits.counts[0] == MAX_EXITS
    assert 10.0 * (MAX_EXITS - 1) + 30 not in exits.lines[:, 0]
    assert np.isclose(exits.lines[:, 0], 2.5, atol=0.02).sum() == 1


def walked(path: np.ndarray, lines: list[tuple[float, ...]]) -> list[tuple[int, float]]:
    """At which steps of a walk an exit was crossed, and the side it came from."""
    exits = empty_exits()
    exits.lines[: len(lines)] = lines
    exits.counts[0] = len(lines)
    crossed = []
    for k in range(1, len(path)):
        ax, ay = path[k - 1]
        if cross_exit(exits, ax, ay, np.array([*path[k], 0.0])):
            crossed.append((k, float(exits.crossing[4])))
    return crossed


DOOR = (0.0, -0.5, 0.0, 0.5)
"""An exit across x = 0; what is at x < 0 is to its left."""


@pytest.mark.parametrize("stride", [0.05, 0.1, 0.37, 1.0, 3.0])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_walking_through_crosses_once_and_only_beyond_the_threshold(stride, way):
    xs = way * np.arange(-2.02, 3.0, stride)
    path = np.stack((xs, np.full(len(xs), 0.1)), -1)
    ((step, side),) = walked(path, [DOOR])
    assert step == np.argmax(way * xs >= THROUGH)
    assert side == way


def test_walking_past_crosses_nothing():
    xs = np.arange(-2, 2, 0.1)
    assert walked(np.stack((xs, np.full(len(xs), 0.51)), -1), [DOOR]) == []
    ys = np.arange(-2, 2, 0.1)
    assert walked(np.stack((np.full(len(ys), 0.05), ys), -1), [DOOR]) == []


# A motion so small that its products with lengths are lost as 0 is no motion.
WITHIN = st.floats(-0.29, 0.29, allow_subnormal=False)


@settings(deadline=None)
@given(st.lists(WITHIN, max_size=20), st.sampled_from((-1.0, 1.0)))
def test_dithering_in_a_doorway_crosses_nothing_until_one_side_is_left(waver, end):
    xs = np.array([-1.0, *waver, end])
    crossed = walked(np.stack((xs, np.zeros(len(xs))), -1), [DOOR])
    assert [step for step, _ in crossed] == ([len(xs) - 1] if end > 0 else [])


@settings(deadline=None)
@given(st.lists(st.floats(0.31, 2.0), min_size=1, max_size=8))
def test_going_to_and_fro_crosses_each_time(reaches):
    xs = np.array([-1.0, *(reach * (-1) ** k for k, reach in enumerate(reaches))])
    crossed = walked(np.stack((xs, np.zeros(len(xs))), -1), [DOOR])
    assert crossed == [(k + 1, 1.0 if k % 2 == 0 else -1.0) for k in range(len(reaches))]


def test_of_two_lines_passed_the_nearer_to_the_end_is_the_gate():
    path = np.array([[-1.0, 0.0], [2.0, 0.0]])
    exits = empty_exits()
    exits.lines[:2] = (DOOR, (1.5, -0.5, 1.5, 0.5))
    exits.counts[0] = 2
    assert cross_exit(exits, *path[0], np.array([*path[1], 0.0]))
    assert exits.crossing.tolist() == [1.5, -0.5, 1.5, 0.5, 1.0]


def expecting(line: tuple[float, ...], *seen: tuple[float, ...]) -> ExitMemory:
    """A robot that expects an exit somewhere and has seen others."""
    exits = empty_exits()
    expect_exits(exits, np.array([line]))
    exits.lines[: len(seen)] = np.reshape(seen, (-1, 4))
    exits.counts[0] = len(seen)
    return exits


@pytest.mark.parametrize(
    ("seen", "crossed"),
    [((), True), (((0.0, 0.1, 0.0, 1.0),), False), (((0.0, 2.0, 0.0, 2.9),), True)],
)
def test_an_exit_is_crossed_where_it_is_expected_unless_it_is_seen_elsewhere(seen, crossed):
    exits = expecting(DOOR, *seen)
    left_of = np.array([FAR + 0.01, 0.0, 0.0])
    assert cross_exit(exits, -1.0, 0.0, left_of) == crossed
    expect_exits(exits, np.empty((0, 4)))
    assert not cross_exit(exits, -1.0, 0.0, left_of)


def test_an_exit_expected_is_crossed_only_far_beyond_and_not_where_one_that_is_seen_comes_first():
    exits = expecting(DOOR)
    assert not cross_exit(exits, -1.0, 0.0, np.array([FAR - 0.01, 0.0, 0.0]))
    assert exits.counts[1] == CROSSING_EXPECTED
    again = rebuilt_exits(stored_exits(exits))
    expect_exits(again, exits.expected[:1])
    assert cross_exit(exits, FAR - 0.01, 0.0, np.array([FAR + 0.01, 0.0, 0.0]))
    assert tuple(exits.crossing[:4]) == DOOR
    # The same, but for a door that it sees on the way: it is that one.
    behind = (0.9, -0.5, 0.9, 0.5)
    again.lines[0], again.counts[0] = behind, 1
    assert not cross_exit(again, 0.85, 0.0, np.array([FAR + 0.01, 0.0, 0.0]))
    assert again.counts[1] == CROSSING_SEEN
    assert cross_exit(again, FAR + 0.01, 0.0, np.array([1.3, 0.0, 0.0]))
    assert tuple(again.crossing[:4]) == behind


def test_who_walks_along_an_exit_expected_has_not_crossed_it():
    exits = expecting(DOOR)
    assert not cross_exit(exits, -1.0, 0.0, np.array([0.5, 0.0, 0.0]))
    assert not cross_exit(exits, 0.5, 0.0, np.array([0.5, WIDE + 0.1, 0.0]))
    assert exits.counts[1] == NOT_CROSSING
    assert not cross_exit(exits, 0.5, WIDE + 0.1, np.array([2.0, WIDE + 0.1, 0.0]))


def test_who_goes_back_through_an_exit_expected_has_crossed_nothing():
    exits = expecting(DOOR)
    assert not cross_exit(exits, -1.0, 0.0, np.array([0.5, 0.0, 0.0]))
    assert not cross_exit(exits, 0.5, 0.0, np.array([-0.5, 0.0, 0.0]))
    assert not cross_exit(exits, -0.5, 0.0, np.array([-FAR - 0.1, 0.0, 0.0]))
    assert exits.counts[1] == NOT_CROSSING


def test_of_exits_expected_the_one_passed_last_is_the_gate():
    exits = empty_exits()
    expect_exits(exits, np.array([DOOR, (0.8, -0.5, 0.8, 0.5)]))
    assert not cross_exit(exits, -1.0, 0.0, np.array([0.5, 0.0, 0.0]))
    assert not cross_exit(exits, 0.5, 0.0, np.array([1.2, 0.0, 0.0]))
    assert cross_exit(exits, 1.2, 0.0, np.array([0.9 + FAR, 0.0, 0.0]))
    assert exits.crossing[0] == 0.8


def test_of_too_many_exits_the_last_are_expected():
    lines = np.arange(4.0 * (MAX_EXITS + 5)).reshape(-1, 4)
    exits = empty_exits()
    expect_exits(exits, lines)
    assert exits.counts[2] == MAX_EXITS
    np.testing.assert_array_equal(exits.expected, lines[5:])


def test_exits_are_stored_and_rebuilt_and_damage_is_refused():
    exits = empty_exits()
    remember_exits(exits, sight_of(np.zeros(3), two_rooms()), LIMITS)
    stored = stored_exits(exits)
    EXITS.check(stored)
    again = rebuilt_exits(stored)
    for mine, theirs in zip(again, exits, strict=True):
        np.testing.assert_array_equal(mine, theirs)
    damages = {
        "counts": np.array([2, 0]),
        "lines": np.full((1, 4), np.nan),
        "gate": np.zeros(4),
    }
    for name, damage in damages.items():
        with pytest.raises(InputError, match="exits"):
            EXITS.check(stored | {f"exits.{name}": damage})
    with pytest.raises(InputError, match="counts"):
        EXITS.check(stored | {"exits.counts": np.array([1, 3])})


def test_the_view_may_stand_anywhere():
    # The line's own frame is the robot's: seen from the map's origin it is where it is seen.
    pose = np.array([1.0, 0.5, -0.3])
    walls = transform_segments(inverse(pose), two_rooms())
    (line,) = seen_exits((0, 0, 0), walls)
    np.testing.assert_allclose(line, transform_segments(inverse(pose), TRUE)[0], atol=0.05)


TRUE = np.array([[2.5, -0.45, 2.5, 0.45]])
