"""The evidence that two places are one: each part by itself, and all of it weighed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from albot_core.mappers.albot1.config import Albot1Config, PlacesConfig
from albot_core.mappers.albot1.places.events import EventKind
from albot_core.mappers.albot1.places.evidence import (
    DOORWAY,
    FREEDOM,
    NARROW,
    PRIOR,
    Evidence,
    crosses_any,
    find_doorways,
    lengthened,
    on_doorstep,
    share_in_sight,
)
from tests.core.mappers.albot1.building import RING, led

ALL = Evidence(share=1.0, nearest_in_sight=1.0, visit_in_sight=1.0, misfit=0.0)
NOTHING = Evidence(share=0.0, nearest_in_sight=0.0, visit_in_sight=0.0, misfit=0.0)


def test_without_evidence_the_prior_stands():
    assert NOTHING.probability == pytest.approx(1 / (1 + np.exp(-PRIOR)))


@pytest.mark.parametrize("part", ["share", "nearest_in_sight", "visit_in_sight"])
def test_each_share_speaks_for_it(part):
    assert NOTHING._replace(**{part: 1.0}).probability > NOTHING.probability
    assert ALL._replace(**{part: 0.0}).probability < ALL.probability


def test_the_misfit_counts_as_in_students_t_distribution():
    def odds(misfit: float) -> float:
        probability = ALL._replace(misfit=misfit).probability
        return probability / (1 - probability)

    for misfit in (0.5, 1.0, 2.0, 9.0):
        expected = stats.t.pdf(misfit, FREEDOM) / stats.t.pdf(0.0, FREEDOM)
        assert odds(misfit) / odds(0.0) == pytest.approx(expected)


def test_the_odds_are_divided_by_the_visits():
    once, often = ALL.probability, ALL._replace(visits=7).probability
    assert often / (1 - often) == pytest.approx(once / (1 - once) / 7)
    assert "visits" not in ALL.weighed


def test_what_was_seen_from_both_sides_of_a_doorway_says_nothing():
    assert ALL._replace(through_doorway=True).probability == 0.0


def test_structure_alone_does_not_do_where_the_robot_is_out_of_sight():
    bar = PlacesConfig().min_probability
    assert ALL._replace(share=0.5).probability > bar
    assert ALL._replace(nearest_in_sight=0.0, visit_in_sight=0.0).probability < bar


def test_what_stands_before_a_point_hides_it():
    lines = np.array([[1.0, -1.0, 1.0, 1.0], [-2.0, -3.0, 2.0, -3.0]])
    others = np.array([[0.5, 0.0], [2.0, 0.0], [2.0, 4.0], [0.0, -4.0]])
    here = np.zeros((1, 2))
    seen = [share_in_sight(lines, here, other[None]) for other in others]
    assert seen == [1.0, 0.0, 1.0, 0.0]
    assert share_in_sight(lines, np.array([[0.0, 0.0], [0.0, -9.0]]), others[:1]) == 0.5
    assert share_in_sight(lines[:0], here, others[1:2]) == 1.0


WALL_BELOW, WALL_ABOVE = [0.0, -2.0, 0.0, -0.5], [0.0, 0.5, 0.0, 2.0]


@pytest.mark.parametrize(
    ("walls", "way", "passed"),
    [
        ([WALL_BELOW, WALL_ABOVE], [[-1.0, 0.0], [1.0, 0.0]], True),
        ([WALL_ABOVE, WALL_BELOW], [[1.0, 0.2], [-1.0, 0.0], [-3.0, 0.0]], True),
        ([WALL_BELOW, WALL_ABOVE[2:] + WALL_ABOVE[:2]], [[-1.0, 0.0], [1.0, 0.0]], True),
        ([WALL_BELOW, WALL_ABOVE], [[-2.0, 0.0], [-1.0, 0.0]], False),  # It stays before it.
        ([WALL_BELOW, [0.0, 1.0, 0.0, 2.0]], [[-1.0, 0.0], [1.0, 0.0]], False),  # Too wide.
        ([WALL_BELOW, [0.0, 0.5, 1.5, 0.5]], [[-1.0, 0.0], [1.0, 0.0]], False),  # A corner.
        ([WALL_BELOW, [0.0, 0.5, 0.0, 0.6]], [[-1.0, 0.0], [1.0, 0.0]], False),  # No wall.
        ([WALL_BELOW], [[-1.0, 0.0], [1.0, 0.0]], False),
        ([WALL_BELOW, [0.0, 0.1, 0.0, 2.0]], [[-1.0, -0.2], [1.0, -0.2]], False),  # Too narrow.
        ([WALL_BELOW, WALL_ABOVE, [0.1, -1.0, 0.1, 1.0]], [[-1.0, 0.0], [1.0, 0.0]], False),
    ],
)
def test_a_doorway_is_a_gap_between_two_walls_in_line(walls, way, passed):
    doorways = find_doorways(np.array(walls), np.array(way))
    assert crosses_any(doorways, np.array(way)) == passed


def test_a_doorway_far_from_the_way_is_not_looked_for():
    walls = np.array([WALL_BELOW, WALL_ABOVE])
    assert len(find_doorways(walls, np.array([[-1.0, 0.0]]))) == 1
    assert len(find_doorways(walls, np.array([[-9.0, 0.0]]))) == 0


def test_breadcrumbs_in_an_exit_or_just_beyond_are_on_the_doorstep():
    exits = np.array([[0.0, 0.5, 0.0, -0.5]])  # The place is to the left: at positive x.
    points = np.array([[1.0, 0.0], [0.2, 0.0], [-0.5, 0.4], [-1.5, 0.0], [0.0, 1.0], [9.0, 9.0]])
    found = on_doorstep(exits, points)
    assert found.tolist() == [False, True, True, False, False, False]
    assert on_doorstep(exits[:0], points[:1]).tolist() == [False]


def test_exits_hide_a_little_beside_them():
    exits = np.array([[0.0, 0.5, 0.0, -0.5], [1.0, 1.0, 4.0, 5.0]])
    longer = lengthened(exits)
    np.testing.assert_allclose(longer[0], [0.0, 0.75, 0.0, -0.75])
    np.testing.assert_allclose(longer[1], [0.85, 0.8, 4.15, 5.2])
    assert lengthened(exits[:0]).shape == (0, 4)


def test_a_doorway_is_as_wide_as_an_exit_may_be():
    config = Albot1Config()
    assert (config.min_exit_width, config.max_exit_width) == (NARROW, DOORWAY)


@pytest.mark.parametrize(
    ("wall", "config", "known"),
    [
        (False, PlacesConfig(), True),
        (True, PlacesConfig(), False),
        (True, replace(PlacesConfig(), min_probability=0.0), True),
    ],
)
def test_a_place_is_recognised_in_sight_of_where_the_robot_has_been_in_it(wall, config, known):
    walker = led(RING, config)
    place, crumbs = walker.network.places[0], walker.network.breadcrumbs
    crumbs.move(crumbs.places == 0, np.array([0.5, 0.0, 0.0]), None)
    if wall:
        place.surfaces = np.concatenate((place.surfaces, [[0.25, -0.2, 0.25, 0.2]]))
    assert walker.recognize() == known
    event = walker.network.log.events[-1]
    assert event.kind == (EventKind.RECOGNIZED if known else EventKind.REFUSED)
    if config.min_probability:
        assert (event.probability >= config.min_probability) == known
        assert event.nearest_in_sight == float(not wall)


def test_a_robot_that_passed_a_doorway_unnoticed_recognises_nothing():
    walker = led(RING)
    network = walker.network
    jambs = [[-0.5, 0.4, -0.5, 1.5], [-0.5, -1.5, -0.5, -0.4]]
    network.places[0].surfaces = np.concatenate((network.places[0].surfaces, jambs))
    network.reading = network.stays[-1][0]
    network.drop_breadcrumb(np.array([-1.0, 0.0, 0.0]), np.empty((0, 4)))
    assert not walker.recognize()
    event = network.log.events[-1]
    assert (event.through_doorway, event.probability) == (1.0, 0.0)
    assert str(event).endswith("seen from both sides of a doorway")
