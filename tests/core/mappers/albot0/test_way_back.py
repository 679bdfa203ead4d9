"""The way home along the way out, in hand-drawn scenes."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.geometry.types import Segments
from albot_core.mappers.albot0.mapper import Albot0
from albot_core.mappers.albot0.particles import Particles
from albot_core.mappers.albot0.regions import Regions
from albot_core.mappers.albot0.steps import Steps
from albot_core.mappers.albot0.way_back import WayBack, WayBackConfig
from albot_core.mappers.mapper import POINT, TRAVEL
from tests.core.mappers.albot0.sonar_scenes import driven, readings, row_of_rooms
from tests.core.mappers.albot0.step_scenes import steps_along

WALLS, _ = row_of_rooms()


NO_WALLS = np.empty((0, 4))


def along(way: Steps, at: tuple[float, float] = (0.0, 0.0), walls: Segments = NO_WALLS) -> WayBack:
    """The way home along a way out, of a robot that knows where it is."""
    particles = Particles(np.array((*at, 0.0)), 10, np.random.default_rng(0))
    return WayBack(way, walls, particles, np.zeros(3), WayBackConfig())


def test_a_loop_of_the_way_out_is_cut_off():
    """It leads 10 m east, round a square of 5 m, and 5 m on."""
    way = steps_along((0, 0), (10, 0), (10, 5), (5, 5), (5, 0), (5, -5))
    back = along(way)
    point, left = back.ahead(np.array((5.0, -5.0, 0.0)))
    assert left == pytest.approx(10.0, abs=1.5)  # Corners are cut too.
    np.testing.assert_allclose(point, (5.0, -3.5), atol=1.0)
    point, left = back.ahead(np.array((1.0, 0.0, 0.0)))
    assert np.isnan(point).all()
    assert left == pytest.approx(1.0, abs=0.5)


def test_no_loop_is_cut_off_through_a_wall():
    """The way out leads 10 m east, and back 1 m beside it; on the way home a wall is heard."""
    way = steps_along((0, 0), (10, 0), (10, 1), (0, 1))
    wall = np.array([[-1.0, 0.5, 9.0, 0.5]])
    here = np.array((0.0, 1.0, 0.0))
    assert along(way).ahead(here)[1] < 2.0
    point, left = along(way, walls=wall).ahead(here)
    assert left > 18.0
    assert point[0] > 1.0


def test_the_way_begins_on_the_robots_side_of_a_wall():
    """The way out comes by 1 m away behind a wall, and 2 m away in sight."""
    way = steps_along((0, 0), (10, 0), (10, 3), (0, 3))
    wall = np.array([[-2.0, 0.5, 9.0, 0.5]])
    here = np.array((5.0, 1.0, 0.0))
    assert along(way).ahead(here)[1] == pytest.approx(6.0, abs=1.0)
    point, left = along(way, walls=wall).ahead(here)
    assert 16.0 < left < 2.0 + 5.0 + 3.0 + 10.0  # Corners are cut.
    np.testing.assert_allclose(point[1], 3.0, atol=0.1)
    # A robot that is shut in errs: it goes to the nearest.
    shut = np.array([[-2.0, 0.5, 12.0, 0.5], [-2.0, 1.5, 12.0, 1.5]])
    assert along(way, walls=shut).ahead(here)[1] == pytest.approx(6.0, abs=1.0)


def test_where_the_way_leads_does_not_turn_back():
    """Followed point by point, it comes nearer to home with each, though the way out crosses it."""
    way = steps_along((0, 0), (10, 0), (10, 1), (0, 1), (0, 2), (10, 2), (6, -3))
    back = along(way)
    here, lefts = np.array((6.0, -3.0, 0.0)), []
    while True:
        point, left = back.ahead(here)
        lefts.append(left)
        if np.isnan(point).any():
            break
        here = np.array((*point, 0.0))
    assert np.all(np.diff(lefts) < 0)
    assert np.hypot(*here[:2]) < 2.5


def test_two_asrs_are_as_likely_where_they_meet():
    way = steps_along((0, 0), (10, 0))
    regions = Regions(splits=np.array((0, 5, 10)), steps=way.lines)
    fit = along(way, at=(5.0, 0.0)).fit(regions)
    assert fit.min() > 0.6
    fit = along(way, at=(2.0, 0.0)).fit(regions)
    assert fit[0] == 1.0
    assert fit[1] < 0.2


def test_a_way_of_one_step_leads_home():
    way = steps_along((0, 0), (1, 0))
    back = along(way)
    assert np.isnan(back.ahead(np.zeros(3))[0]).all()
    np.testing.assert_array_equal(back.fit(Regions(splits=np.array((0, 1)), steps=way.lines)), 1.0)


def test_a_mapper_on_its_way_out_knows_how_it_came():
    mapper = Albot0()
    for reading in readings(WALLS, driven((0.5, 0.0), (12.5, 0.0))):
        mapper.update(reading)
    way = mapper.way_home
    behind = compose(mapper.estimate.pose, np.array((-1.5, 0.0, 0.0)))[:2]
    np.testing.assert_allclose(way[POINT], behind, atol=1.0)
    assert way[TRAVEL] == pytest.approx(12.0, abs=1.0)


@pytest.mark.parametrize(("name", "value"), [("same", -0.1), ("near", np.nan), ("ahead", 0.0)])
def test_bad_numbers_are_refused_by_name(name, value):
    with pytest.raises(InputError, match=f"WayBackConfig.{name}"):
        WayBackConfig(**{name: value})
