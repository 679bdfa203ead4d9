"""The particle filter that lays the way out beside the way home, in hand-drawn scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative
from albot_core.mappers.albot0.mapper import Albot0
from albot_core.mappers.albot0.paths import ECHOES, NO_STEPS, Steps, join_steps
from albot_core.mappers.albot0.regions import Regions
from albot_core.mappers.albot0.way_back import WayBack, WayBackConfig
from albot_core.mappers.mapper import POINT, TRAVEL
from albot_core.sensing.reading import Reading
from tests.core.mappers.albot0.sonar_scenes import driven, readings, row_of_rooms

WALLS, BOUNDS = row_of_rooms()
RNG = np.random.default_rng


def led(taken: list[Reading], drift: float, turned: int) -> tuple[Albot0, np.ndarray]:
    """A mapper whose odometer's heading errs on the way home (rad/m), and its poses."""
    mapper, poses = Albot0(), []
    for number, reading in enumerate(taken):
        x, y, turn = reading.motion
        error = drift * np.hypot(x, y) if number > turned else 0.0
        motion = np.array((x, y, turn + error))
        mapper.update(Reading(stamp=reading.stamp, motion=motion, sonar=reading.sonar))
        poses.append(mapper.estimate.pose)
        if number == turned:
            mapper.begin_return()
    mapper.end_path()
    return mapper, np.array(poses)


@pytest.mark.parametrize("drift", [0.0, 0.02, -0.02])
def test_what_the_odometer_errs_on_the_way_home_is_found(drift):
    """After 34 m a drift of 0.02 rad/m has led 10 m astray."""
    way = driven((0.5, 0.0), (36.5, 0.0), (2.5, 0.0))
    turned = int(np.argmax(way[:, 0] >= 36.5))
    mapper, poses = led(readings(WALLS, way), drift, turned)
    truth = relative(way[0], way[-1])
    assert np.hypot(*(poses[-1] - truth)[:2]) == pytest.approx(abs(drift) * 34**2 / 2, abs=1.0)
    found = relative(mapper.estimate.home, poses[-1])
    assert abs(found[1]) < 0.5  # Across the way the walls tell.
    assert abs(found[0] - truth[0]) < 1.0  # Along it only where corridors and rooms meet.
    assert mapper.estimate.place == 0


def steps_along(*points: tuple[float, float]) -> Steps:
    """Steps without surfaces from point to point, of 1 m each."""
    steps = NO_STEPS
    for start, end in zip(np.array(points[:-1]), np.array(points[1:]), strict=True):
        count = round(float(np.hypot(*(end - start))))
        ends = start + np.linspace(0, 1, count + 1)[:, None] * (end - start)
        lines = np.concatenate((ends[:-1], ends[1:]), axis=1)
        steps = join_steps(
            steps,
            Steps(
                lines=lines,
                widths=np.full((count, 2), 4.0),
                walled=np.zeros((count, 2), np.bool_),
                begins=np.arange(count) == 0,
                readings=np.arange(count) + len(steps.readings),
                echoes=np.zeros((count, 2, ECHOES)),
            ),
        )
    return steps


def test_a_loop_of_the_way_out_is_cut_off():
    """It leads 10 m east, round a square of 5 m, and 5 m on."""
    way = steps_along((0, 0), (10, 0), (10, 5), (5, 5), (5, 0), (5, -5))
    long = WayBack(way, WayBackConfig(loop=10.0), RNG(0))
    assert long.ahead(np.array((5.0, -5.0, 0.0)))[1] == pytest.approx(30.0, abs=3.0)
    back = WayBack(way, WayBackConfig(loop=25.0), RNG(0))
    point, left = back.ahead(np.array((5.0, -5.0, 0.0)))
    assert left == pytest.approx(10.0, abs=1.5)  # Corners are cut too.
    np.testing.assert_allclose(point, (5.0, -3.5), atol=1.0)
    point, left = back.ahead(np.array((1.0, 0.0, 0.0)))
    assert np.isnan(point).all()
    assert left == pytest.approx(1.0, abs=0.5)


def test_where_the_way_leads_does_not_turn_back():
    """Followed point by point, it comes nearer to home with each, though the way out crosses it."""
    way = steps_along((0, 0), (10, 0), (10, 1), (0, 1), (0, 2), (10, 2), (6, -3))
    back = WayBack(way, WayBackConfig(), RNG(0))
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
    back = WayBack(way, WayBackConfig(), RNG(0))
    home = steps_along((10, 0), (5, 0))
    back.locate(home)
    fit = back.fit(regions)
    assert fit.min() > 0.6
    back.locate(steps_along((5, 0), (2, 0)))
    fit = back.fit(regions)
    assert fit[0] == 1.0
    assert fit[1] < 0.2


def test_particles_do_not_go_through_the_surfaces_of_the_way_out():
    """Without surfaces beside the way home, only those of the way out hold the particles."""
    way, home = steps_along((0, 0), (9, 0)), steps_along((9, 0), (3, 0))
    corridor = replace(way, widths=np.ones((9, 2)), walled=np.ones((9, 2), np.bool_))
    outside = []
    for out in (way, corridor):
        back = WayBack(out, WayBackConfig(slip=0.5), RNG(0))
        back.locate(home)
        state = back.state()
        is_outside = np.abs(state["way_back.poses"][:, 1]) > 1.0
        outside.append(state["way_back.weights"][is_outside].sum())
    assert outside[0] > 0.2
    assert outside[1] < 0.5 * outside[0]


def test_a_way_of_one_step_leads_home():
    way = steps_along((0, 0), (1, 0))
    back = WayBack(way, WayBackConfig(), RNG(0))
    back.locate(steps_along((1, 0), (0, 0)))
    assert np.isnan(back.ahead(np.zeros(3))[0]).all()
    np.testing.assert_array_equal(back.fit(Regions(splits=np.array((0, 1)), steps=way.lines)), 1.0)


def test_a_doorway_tells_how_far_along_a_corridor_the_robot_is():
    """The odometer of the way home tells 10 % too little; one doorway is passed, 2 m deep."""
    out, home = steps_along((0, 0), (20, 0)), steps_along((20, 0), (8, 0))
    short = np.array((20.0, 0.0, 20.0, 0.0)) + 0.9 * (home.lines - np.array((20.0, 0.0, 20.0, 0.0)))
    off = []
    for depth in (1.0, 2.0):
        echoes = np.ones((20, 2, ECHOES))
        echoes[9, 0] = depth
        back = WayBack(replace(out, echoes=echoes), WayBackConfig(slip=0.2), RNG(0))
        back.locate(replace(home, lines=short, echoes=echoes[:7:-1, ::-1, ::-1]))
        found = relative(back.frame, np.array((*short[-1, 2:], np.pi)))[:2]
        off.append(float(np.hypot(*(found - (8.0, 0.0)))))
    assert off[0] > 1.0  # Walls alone do not tell.
    assert off[1] < 0.5


def test_an_echo_tells_nothing_where_the_way_out_has_none():
    way, home = steps_along((0, 0), (9, 0)), steps_along((9, 0), (0, 0))
    walled = replace(home, echoes=np.ones((9, 2, ECHOES)))
    without, beside = (WayBack(way, WayBackConfig(), RNG(0)) for _ in range(2))
    without.locate(home)
    beside.locate(walled)
    np.testing.assert_array_equal(without.frame, beside.frame)


def test_a_mapper_on_its_way_out_knows_how_it_came():
    mapper = Albot0()
    for reading in readings(WALLS, driven((0.5, 0.0), (12.5, 0.0))):
        mapper.update(reading)
    way = mapper.way_home
    behind = compose(mapper.estimate.pose, np.array((-1.5, 0.0, 0.0)))[:2]
    np.testing.assert_allclose(way[POINT], behind, atol=1.0)
    assert way[TRAVEL] == pytest.approx(12.0, abs=1.0)


@pytest.mark.parametrize(
    ("name", "value"), [("particles", 0), ("slip", -0.1), ("spread", 0.0), ("near", np.nan)]
)
def test_bad_numbers_are_refused_by_name(name, value):
    with pytest.raises(InputError, match=f"WayBackConfig.{name}"):
        WayBackConfig(**{name: value})
