"""HSSH in two rooms: from one to the other and back, by readings that are exact."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative
from albot_core.mappers.hssh.mapper import Hssh
from albot_core.mappers.hssh.star import ENDS, Star
from albot_core.mappers.mapper import EXIT, POINT, TRAVEL
from tests.core.mappers.hssh.floors import ROOMS, walls_of
from tests.core.mappers.slam.rooms import reading_from

START = np.array((1.0, 2.0, 0.0))
TURN = [(0.0, 0.0, np.radians(30))] * 12
DRIVE = [(0.25, 0.0, 0.0)]
BACK = [(0.0, 0.0, np.radians(30))] * 6


def led(motions: list, walls: np.ndarray | None = None, mapper: Hssh | None = None) -> Hssh:
    """The mapper after some motions; those of the odometer are exact."""
    walls = walls_of(ROOMS) if walls is None else walls
    mapper, pose = mapper or Hssh(), START
    mapper.update(reading_from(pose, np.zeros(3), walls))
    for motion in motions:
        pose = compose(pose, np.array(motion))
        mapper.update(reading_from(pose, np.array(motion), walls))
    return mapper


@pytest.fixture(scope="module")
def there() -> Hssh:
    """In the second room."""
    return led([*TURN, *DRIVE * 20])


@pytest.fixture(scope="module")
def back() -> Hssh:
    """In the first room again."""
    return led([*TURN, *DRIVE * 20, *BACK, *DRIVE * 16])


def test_two_rooms_are_two_places_with_one_gateway_each(there):
    assert [visit.place for visit in there.believed_map.visits] == [0, 1]
    # The first room was looked at all round, the corners of the second were not yet.
    assert [there.visits.star(k) for k in range(2)] == [Star(ENDS), Star(ENDS, unknown=[0])]
    graph = there.snapshot().place_graph
    assert (graph.links, graph.current, graph.home) == (((0, 1),), 1, 0)
    np.testing.assert_allclose(graph.node(0).middle, (1, 0), atol=0.3)
    np.testing.assert_allclose(graph.node(1).middle, (5.2, 0), atol=0.3)
    assert [edge.reverse for edge in graph.edges] == [1, 0]


def test_the_way_home_leads_through_the_gateway(there):
    way = there.way_home
    np.testing.assert_allclose(np.sort(way[EXIT].reshape(2, 2), axis=0), ((3.1, -0.5), (3.1, 0.5)),
                               atol=0.2)  # fmt: skip
    np.testing.assert_allclose(way[POINT], (3.1, 0), atol=0.2)
    assert way[TRAVEL] == pytest.approx(5.0, abs=0.1)


def test_the_first_room_is_recognised(back):
    assert [visit.place for visit in back.believed_map.visits] == [0, 1, 0]
    estimate = back.estimate
    assert estimate.place == 0
    assert estimate.matched_reading is not None
    assert back.place_at(estimate.matched_reading) == 0
    np.testing.assert_allclose(estimate.pose[:2], (1, 0), atol=0.15)
    assert np.isnan(back.way_home[EXIT]).all()
    assert "P1 is new, 1 gateways; 1 maps agree" in str(back.events[1])


def test_the_poses_are_those_that_were_driven(back):
    poses = [START]
    for motion in [*TURN, *DRIVE * 20, *BACK, *DRIVE * 16]:
        poses.append(compose(poses[-1], np.array(motion)))
    true = relative(START, np.array(poses))
    assert np.hypot(*(back.corrected_poses() - true)[:, :2].T).max() < 0.15


def test_a_robot_that_turns_round_on_its_way_has_not_left():
    """In a corridor whose far end is out of sight."""
    walls = walls_of(((0, 0, 4, 4), (4, 1.5, 24, 2.5)))
    out = [*TURN, *DRIVE * 18]
    away = led(out, walls)
    assert [away.visits[k].left for k in range(len(away.visits))] == [0]
    assert away.events == ()
    mapper = led([*out, *BACK, *DRIVE * 16], walls)
    assert [mapper.visits[k].left for k in range(len(mapper.visits))] == [-1]
    assert mapper.believed_map.places == 1


def test_one_room_only():
    room = walls_of(ROOMS[:1])
    mapper = led([*TURN, *DRIVE * 4], room)
    assert mapper.visits.star(0) == Star()
    assert mapper.tree is None
    assert mapper.events == ()
    assert mapper.way_home[TRAVEL] == pytest.approx(1.0, abs=0.05)
    assert len(mapper.snapshot().place_graph.nodes) == 1
    assert np.isfinite(mapper.estimate.pose).all()


def test_a_floor_without_walls():
    mapper = led([*TURN, *DRIVE * 8], np.array([(100.0, 100.0, 101.0, 100.0)]))
    assert np.isfinite(mapper.estimate.pose).all()
    assert not mapper.estimate.localised
    assert mapper.visits.star(0) == Star(unknown=[0])


@pytest.mark.parametrize(
    ("name", "change", "expected"),
    [
        ("tree.visits", lambda array: array + 1, "place 0 at the first visit"),
        ("visits.arrived", lambda array: array + 5, "a gateway of visit 0"),
        ("visits.entered", lambda array: array[::-1], "numbers that grow from 0"),
        ("gateways.line", lambda array: array * 0, "lines of a length"),
    ],
)
def test_a_state_that_does_not_fit_is_refused(back, name, change, expected):
    state = back.state()
    state[name] = np.ascontiguousarray(change(state[name]))
    with pytest.raises(InputError, match=expected):
        Hssh().restore(state)


def test_a_restored_mapper_believes_the_same(back):
    twin = Hssh()
    twin.restore(back.state())
    assert twin.believed_map.visits == back.believed_map.visits
    np.testing.assert_array_equal(twin.way_home, back.way_home)
    np.testing.assert_array_equal(twin.estimate.pose, back.estimate.pose)
