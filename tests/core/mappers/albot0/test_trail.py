"""The particle filter that tells where the robot is on the way that it came."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import relative, transform_points
from albot_core.mappers.albot0.echo_field import EchoField
from albot_core.mappers.albot0.mapper import Albot0
from albot_core.mappers.albot0.particles import Particles, sum_squares
from albot_core.mappers.albot0.state import STEPS, step_fields
from albot_core.mappers.albot0.steps import ECHOES, NO_STEPS, Steps, end_poses, join_steps
from albot_core.mappers.albot0.trail import Trail, TrailConfig
from albot_core.mappers.schema import Schema
from albot_core.sensing.reading import Reading
from tests.core.mappers.albot0.sonar_scenes import driven, readings, row_of_rooms
from tests.core.mappers.albot0.step_scenes import steps_along

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


def box(low: float, high: float) -> np.ndarray:
    """The walls of a square (m)."""
    corners = np.array(((low, low), (high, low), (high, high), (low, high), (low, low)))
    return np.hstack((corners[:-1], corners[1:]))


def test_the_way_is_put_right_where_it_comes_by_again():
    """Twice round a corridor of 2 m about a block of 6 m, by an odometer that turns 0.5°/m."""
    walls = np.concatenate((box(-1.0, 9.0), box(1.0, 7.0), [(7.0, 3.0, 7.6, 3.0)]))
    way = driven((0.5, 0), (8, 0), (8, 8), (0, 8), (0, 0), (8, 0), (8, 8), (0, 8), (0, 0), (5, 0))
    mapper = Albot0()
    for reading in readings(walls, way):
        x, y, turn = reading.motion
        motion = np.array((x, y, turn + 0.009 * np.hypot(x, y)))
        mapper.update(Reading(stamp=reading.stamp, motion=motion, sonar=reading.sonar))
    mapper.end_path()
    truth = relative(way[0], way[-1])
    pose, home = mapper.estimate.pose, mapper.estimate.home
    assert np.hypot(*(pose - truth)[:2]) > 1.5  # By the odometer alone.
    assert np.hypot(*(relative(home, pose) - truth)[:2]) < 0.6


def test_particles_do_not_go_through_surfaces():
    """Without echoes, only the surfaces beside the way hold the particles."""
    way, home = steps_along((0, 0), (9, 0)), steps_along((9, 0), (0, 0))
    corridor = replace(way, widths=np.ones((9, 2)), walled=np.ones((9, 2), np.bool_))
    outside = []
    for out in (way, corridor):
        trail = Trail(TrailConfig(slip=0.1), RNG(0))
        for steps in (out, home, out, home):
            for step in range(9):
                trail.extend(steps.part(slice(step, step + 1)))
        is_outside = np.abs(trail.particles.poses[:, 1]) > 1.0
        outside.append(trail.particles.weights[is_outside].sum())
    assert outside[0] > 0.2
    assert outside[1] < 0.5 * outside[0]


def beside(depths: np.ndarray) -> np.ndarray:
    """Echoes from so far to the left, and from 1 m to the right, of steps of 1 m."""
    echoes = np.zeros((len(depths), ECHOES, 2))
    echoes[:, :, 0] = np.linspace(0.0, 1.0, ECHOES)
    echoes[:, ::2, 1] = depths[:, None]
    echoes[:, 1::2, 1] = -1.0
    return echoes


def test_doorways_tell_how_far_along_a_corridor_the_robot_is():
    """The odometer of the way home tells 10 % too little; doorways are 2 m deep."""
    out, home = steps_along((0, 0), (20, 0)), steps_along((20, 0), (8, 0))
    start = np.array((20.0, 0.0, 20.0, 0.0))
    short = start + 0.9 * (home.lines - start)
    off, spreads = np.empty((2, 10)), np.empty((2, 10))
    for row, depth in enumerate((1.0, 2.0)):
        depths = np.ones(20)
        depths[[10, 12, 15]] = depth
        # The left of the way out is to the right of the way home.
        back = beside(depths[:7:-1]) * (1.0, -1.0)
        for seed in range(10):
            trail = Trail(TrailConfig(slip=0.15), RNG(seed))
            trail.extend(replace(out, echoes=beside(depths)))
            for step in range(12):
                trail.extend(replace(home, lines=short, echoes=back).part(slice(step, step + 1)))
            weights, east = trail.particles.weights, trail.particles.poses[:, 0]
            off[row, seed] = abs(float(trail.particles.mean[0]) - 8.0)
            spreads[row, seed] = np.sqrt(weights @ (east - weights @ east) ** 2)
    walls, doorways = np.median(spreads, axis=1)
    assert walls > 0.4  # Walls alone do not tell.
    assert doorways < 0.5 * walls
    assert np.median(off[1]) < 0.3  # The odometer errs by 1.2 m.


def test_an_echo_tells_nothing_where_none_was_heard_before():
    way, home = steps_along((0, 0), (9, 0)), steps_along((9, 0), (0, 0))
    ends = []
    for depths in (np.zeros(9), np.ones(9)):
        trail = Trail(TrailConfig(recent=100.0), RNG(0))
        for steps in (way, home):
            trail.extend(replace(steps, echoes=beside(depths)))
        ends.append(trail.steps.lines)
    np.testing.assert_allclose(*ends)


def test_what_lies_far_back_stays_as_it_is():
    trail = Trail(TrailConfig(remembered=5), RNG(0))
    for step in range(9):
        way = steps_along((0, 0), (9, 0)).part(slice(step, step + 1))
        before = trail.steps.lines
        trail.extend(way)
        np.testing.assert_array_equal(
            trail.steps.lines[: max(step - 4, 0)], before[: max(step - 4, 0)]
        )


def test_without_errors_the_trail_is_what_the_odometer_has():
    way = steps_along((0, 0), (9, 0), (9, 5))
    trail = Trail(TrailConfig(drift=0.0, turned=0.0, slip=0.0), RNG(0))
    trail.extend(way)
    np.testing.assert_allclose(trail.steps.lines, way.lines, atol=1e-9)
    np.testing.assert_allclose(trail.frame, 0.0, atol=1e-9)
    np.testing.assert_allclose(trail.particles.mean, end_poses(way.lines)[-1], atol=1e-9)


def test_the_particles_mean_turns_as_the_odometer_has_it():
    """Whatever their weights, and beyond a whole turn."""
    particles = Particles(np.zeros(3), 50, RNG(0))
    particles.weights = np.arange(1.0, 51.0) / np.arange(1.0, 51.0).sum()
    for _ in range(20):
        particles.move(np.array((1.0, 0.0, 0.5)), 0.2, 0.2, 0.1)
    assert particles.poses[:, 2].std() > 0.5
    assert particles.mean[2] == pytest.approx(10.0)
    still = Particles(np.zeros(3), 50, RNG(0))
    still.move(np.array((1.0, 0.0, 0.0)), 0.0, 0.0, 0.5)
    assert still.poses[:, :2].std() > 0.2
    np.testing.assert_allclose(still.mean, (1.0, 0.0, 0.0), atol=1e-9)


def one_step(*echoes: tuple[float, float]) -> Steps:
    step = steps_along((0, 0), (1, 0))
    kept = np.zeros((1, ECHOES, 2))
    kept[0, : len(echoes)] = echoes
    return replace(step, echoes=kept)


def misfits(poses: np.ndarray, points: np.ndarray, field: EchoField) -> np.ndarray:
    return 1e-4 * sum_squares(poses, points, field.corner, field.squares)


def test_an_echo_field_tells_how_far_echoes_are_and_where_the_sound_went():
    steps = join_steps(one_step((0.0, 2.0)), one_step((0.0, -3.0)))
    field = EchoField(steps, 0.4, 0.25)
    places = np.array(((0.0, 2.0), (0.2, 2.0), (0.05, 1.0), (2.0, 1.0), (0.0, 90.0), (-1e6, 0.0)))
    expected = (0.0, 0.2, 0.4, 0.25, 0.25, 0.25)
    found = [np.sqrt(misfits(np.zeros((1, 3)), place[None], field)) for place in places]
    np.testing.assert_allclose(np.ravel(found), expected, atol=0.1)


def test_an_echo_field_sums_what_is_seen_from_each_pose():
    field = EchoField(one_step((0.0, 2.0)), 0.4, 0.25)
    poses = np.array(((0.08, 0.0, np.pi / 2), (1.0, 2.0, np.pi), (0.0, 0.0, 0.0)))
    points = np.array(((2.0, 0.0), (1.0, 0.0)))
    expected = (0.0 + 0.4**2, 0.25**2 + 0.0, 2 * 0.25**2)
    np.testing.assert_allclose(misfits(poses, points, field), expected, atol=0.02)


@given(st.integers(0, 10**6))
def test_squares_are_those_of_the_nearest_echo(seed):
    """Against a slow obvious version, also outside the field and where it ends."""
    rng = np.random.default_rng(seed)
    steps = replace(steps_along((0, 0), (3, 0)), echoes=rng.uniform(-3, 3, (3, ECHOES, 2)))
    field = EchoField(steps, 0.4, 0.4)
    echoes = (steps.echoes + steps.lines[:, None, :2])[steps.heard]
    poses, points = rng.uniform(-6, 6, (5, 3)), rng.uniform(-6, 6, (20, 2))
    found = misfits(poses, points, field)
    for pose, square in zip(poses, found, strict=True):
        seen = transform_points(pose, points)
        cells, known = (np.floor((each - field.corner) / 0.1) for each in (seen, echoes))
        away = 0.1 * np.hypot(*np.moveaxis(cells[:, None] - known, -1, 0)).min(axis=1)
        assert square == pytest.approx(np.square(np.minimum(away, 0.4)).sum(), abs=1e-9)


def test_an_echo_field_without_echoes_knows_nothing():
    field = EchoField(steps_along((0, 0), (5, 0)), 0.4, 0.25)
    found = misfits(np.zeros((3, 3)), np.zeros((2, 2)), field)
    np.testing.assert_allclose(found, 2 * 0.25**2)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("weights", (0.6, 0.6, 0.6), "shares that sum to 1"),
        ("weights", (1.2, -0.1, -0.1), "numbers above 0"),
        ("weights", (0.5, 0.5, 0.0), "numbers above 0"),
        ("drawn", 3, "whole numbers from 0 to less than 3"),
        ("drawn", -1, "whole numbers from 0 to less than 3"),
        ("past", 1e9, "numbers from"),
        ("lines", -1e9, "numbers from"),
        ("lines", 0.0, "lengths as the odometer has them"),
    ],
)
def test_a_state_that_no_trail_has_is_refused(name, value, words):
    config, way = TrailConfig(particles=3), steps_along((0, 0), (4, 0))
    trail = Trail(config, RNG(0))
    trail.extend(way)
    again, state = Trail(config, RNG(1)), trail.state()
    ways = *step_fields("out"), *step_fields("home")
    schema = Schema(*ways, *Trail.SCHEMA.fields, rules=Trail.SCHEMA.rules)
    for key in STEPS:
        state |= {f"out.{key}": getattr(way, key), f"home.{key}": getattr(NO_STEPS, key)}
    again._set_state(state)
    np.testing.assert_array_equal(again.frame, trail.frame)
    state[f"trail.{name}"][:] = value
    with pytest.raises(InputError, match=f"^trail.{name}: expected {words}"):
        schema.check(state, readings=99, **again._sizes())


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("particles", 0),
        ("particles", 100_001),
        ("slip", -0.1),
        ("spread", 0.0),
        ("farthest", 10.1),
        ("unknown", 0.0),
        ("alike", np.nan),
        ("remembered", 0),
        ("remembered", 1001),
    ],
)
def test_bad_numbers_are_refused_by_name(name, value):
    with pytest.raises(InputError, match=f"TrailConfig.{name}"):
        TrailConfig(**{name: value})
