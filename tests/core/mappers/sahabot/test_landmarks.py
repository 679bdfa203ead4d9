"""Landmarks and what they tell of the nest: closed forms, and laws of symmetry and motion."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.mappers.sahabot.config import SectorConfig
from albot_core.mappers.sahabot.landmarks import (
    average_landmark_vector,
    find_landmarks,
    home_by_average,
    home_by_snapshot,
    landmark_chords,
    seen_by_both,
)
from albot_core.mappers.sahabot.panorama import (
    DIRECTIONS,
    UNSEEN,
    beams_of,
    carry_along,
    look,
    panorama_error,
)
from albot_core.sensing.reading import LaserGeometry

CONFIG = SectorConfig()
OPEN = np.full(DIRECTIONS, np.inf)
SQUARE = np.array(((4.0, 4.0), (-4.0, 4.0), (-4.0, -4.0), (4.0, -4.0)))


def sectors(posts: np.ndarray, place: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """The landmarks that posts of 0.2 m are from a place, in the order of the posts."""
    away = posts - place
    distances = np.hypot(*away.T)
    directions = np.mod(np.arctan2(away[:, 1], away[:, 0]), 2 * np.pi)
    return np.stack((directions, 2 * np.arcsin(0.2 / distances), distances), axis=-1)


def panorama(*parts: tuple[int, int, float], background: float = np.inf) -> np.ndarray:
    """A panorama with sectors: first direction, number of directions, range."""
    ranges = np.full(DIRECTIONS, background)
    for first, count, reach in parts:
        ranges[np.arange(first, first + count) % DIRECTIONS] = reach
    return ranges


def panorama_of(posts: np.ndarray, place: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """The panorama of posts from a place."""
    parts = [
        (round(math.degrees(middle - width / 2)), round(math.degrees(width)), reach)
        for middle, width, reach in sectors(posts, place)
    ]
    return panorama(*parts)


def test_a_post_is_found_by_the_centre_of_its_sector_also_across_direction_0() -> None:
    found = find_landmarks(panorama((88, 5, 4.0), (358, 5, 2.0)), CONFIG)
    order = np.argsort(found[:, 0])
    np.testing.assert_allclose(np.degrees(found[order, 0]), (0.0, 90.0), atol=1e-9)
    np.testing.assert_allclose(np.degrees(found[order, 1]), 5.0)
    np.testing.assert_allclose(found[order, 2], (2.0, 4.0))


@pytest.mark.parametrize(
    "ranges",
    [
        OPEN,
        np.full(DIRECTIONS, 3.0),
        np.full(DIRECTIONS, UNSEEN),
        panorama((10, 120, 4.0)),
        panorama((10, 5, 26.0)),
        panorama((10, 5, 4.0), (15, 5, 2.0), (5, 5, 2.0)),
        panorama((10, 5, 4.0), background=UNSEEN),
    ],
    ids=["open", "walled", "blind", "wide", "far", "only the hidding ones", "beside the unseen"],
)
def test_what_is_no_landmark_is_none(ranges: np.ndarray) -> None:
    found = find_landmarks(ranges, CONFIG)
    assert all(each[2] == 2.0 for each in found)
    assert np.isfinite(average_landmark_vector(found)).all()
    assert landmark_chords(found).shape == (len(found), 4)


def test_the_average_of_a_symmetric_array_is_zero_in_its_middle() -> None:
    np.testing.assert_allclose(average_landmark_vector(sectors(SQUARE)), 0.0, atol=1e-12)


@pytest.mark.parametrize("model", [home_by_average, home_by_snapshot])
@pytest.mark.parametrize("place", [(1.0, 0.0), (0.0, -1.0), (-0.7, 0.7), (2.0, 2.0)])
def test_on_the_axes_of_a_square_array_the_home_vector_is_exact(model, place) -> None:
    home = model(sectors(SQUARE, place), sectors(SQUARE)).direction
    towards = -np.array(place) / np.hypot(*place)
    np.testing.assert_allclose(home / np.hypot(*home), towards, atol=1e-9)


def test_the_average_landmark_vector_in_closed_form() -> None:
    """Two posts on the x axis, seen from the y axis: both turn by the same angle."""
    posts = np.array(((3.0, 0.0), (-3.0, 0.0)))
    home = home_by_average(sectors(posts, (0.0, 1.0)), sectors(posts)).direction
    np.testing.assert_allclose(home, (0.0, -1.0 / math.sqrt(10.0)), atol=1e-12)


def test_the_snapshot_leads_towards_a_landmark_that_looks_too_small() -> None:
    small, large = np.array([(0.7, 0.1, 4.0)]), np.array([(0.7, 0.2, 2.0)])
    nearer = home_by_snapshot(small, large).direction
    assert np.arctan2(nearer[1], nearer[0]) == pytest.approx(0.7)
    np.testing.assert_allclose(home_by_snapshot(large, small).direction, -nearer)


def test_the_distance_is_right_to_first_order() -> None:
    posts = np.array(((3.0, 1.0), (-2.0, 4.0), (-1.0, -5.0), (2.5, -2.0)))
    for place in ((0.05, 0.0), (-0.03, 0.04)):
        found = home_by_average(sectors(posts, place), sectors(posts))
        assert found.distance == pytest.approx(0.05, rel=0.05)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.floats(-3.1, 3.1))
def test_turning_the_world_turns_the_home_vector(seed: int, turn: float) -> None:
    rng = np.random.default_rng(seed)
    posts, place = rng.uniform(-6, 6, (5, 2)), rng.uniform(-1, 1, 2)
    posts += 2.0 * np.sign(posts)  # Not too near.
    cos, sin = math.cos(turn), math.sin(turn)
    matrix = np.array(((cos, -sin), (sin, cos)))
    for model in (home_by_average, home_by_snapshot):
        order = np.argsort(sectors(posts)[:, 0])
        before = model(sectors(posts, tuple(place))[order], sectors(posts)[order])
        posts_turned = posts @ matrix.T
        order = np.argsort(sectors(posts_turned)[:, 0])
        now = sectors(posts_turned, tuple(matrix @ place))
        now = now[np.argsort(now[:, 0])]
        if model is home_by_snapshot:
            before = model(
                np.array(sorted(sectors(posts, tuple(place)).tolist())),
                np.array(sorted(sectors(posts).tolist())),
            )
        after = model(now, sectors(posts_turned)[order])
        np.testing.assert_allclose(after.direction, matrix @ before.direction, atol=1e-9)
        assert after.distance == pytest.approx(before.distance, abs=1e-9)


def test_with_the_compass_off_the_home_vector_is_wrong() -> None:
    """The models subtract directions of two places: they need one frame for both."""
    now, nest = sectors(SQUARE, (1.0, 0.0)), sectors(SQUARE)
    now[:, 0] = np.mod(now[:, 0] + 0.5, 2 * np.pi)
    home = home_by_average(now, nest).direction
    assert home[0] / np.hypot(*home) > -0.9  # By a right compass it is -1.


def test_landmarks_that_only_one_panorama_can_hold_do_not_count() -> None:
    looked = np.ones(DIRECTIONS, np.bool_)
    landmarks = sectors(SQUARE)
    assert len(seen_by_both(landmarks, looked)) == 4
    looked[100:270] = False
    assert np.degrees(seen_by_both(landmarks, looked)[:, 0]) == pytest.approx((45.0, 315.0))


def test_one_landmark_or_none_gives_finite_numbers() -> None:
    one, none = sectors(SQUARE[:1]), np.empty((0, 3))
    for model in (home_by_average, home_by_snapshot):
        found = model(sectors(SQUARE[:1], (1.0, 0.5)), one)
        assert np.isfinite(found.direction).all() and math.isfinite(found.distance)
    assert average_landmark_vector(none).tolist() == [0.0, 0.0]


# The panorama


def circle_of(middle: tuple[float, float], radius: float) -> np.ndarray:
    """The panorama of a round room, of which a robot is off the middle."""
    angles = np.radians(np.arange(DIRECTIONS))
    along = middle[0] * np.cos(angles) + middle[1] * np.sin(angles)
    across = middle[0] * np.sin(angles) - middle[1] * np.cos(angles)
    return along + np.sqrt(radius**2 - across**2)


def carried_along(panorama: np.ndarray, x: float, y: float, steps: int = 1) -> np.ndarray:
    """A panorama as seen from a place x, y farther on, where that many equal steps led."""
    now, then = (panorama.copy(), np.zeros(DIRECTIONS)), np.empty((2, DIRECTIONS))
    for _ in range(steps):
        carry_along(*now, x / steps, y / steps, *then)
        now, then = then.copy(), np.empty((2, DIRECTIONS))
    return now[0]


@pytest.mark.parametrize("steps", [1, 7, 100])
def test_a_panorama_that_is_carried_along_is_what_is_seen_there(steps: int) -> None:
    seen = carried_along(circle_of((0.0, 0.0), 5.0), 0.6, -0.8, steps)
    np.testing.assert_allclose(seen, circle_of((-0.6, 0.8), 5.0), atol=0.11)
    assert (carried_along(OPEN, 1.0, 1.0, steps) == np.inf).all()
    unseen = np.full(DIRECTIONS, UNSEEN)
    assert (carried_along(unseen, 1.0, 1.0, steps) == UNSEEN).all()


@pytest.mark.parametrize("steps", [1, 20, 400])
@pytest.mark.parametrize("behind", [12.0, np.inf, UNSEEN])
def test_a_post_moves_by_small_steps_as_by_one(steps: int, behind: float) -> None:
    """A post at 6 m, 90° to the left, of a robot that drives 4 m straight on.

    Of points that come to share a direction one is kept, which may cost an edge two directions.
    """
    panorama = np.full(DIRECTIONS, behind)
    panorama[88:93] = 6.0 / np.sin(np.radians(np.arange(88, 93)))
    seen = carried_along(panorama, 4.0, 0.0, steps)
    straight = np.degrees(np.arctan2(6.0, 6.0 / np.tan(np.radians((88.0, 92.0))) - 4.0))
    seen[:90] = UNSEEN  # The wall ahead is as near by then.
    post = np.flatnonzero(np.abs(seen - math.hypot(6.0, 4.0)) < 0.3)
    assert post[[0, -1]] == pytest.approx(straight, abs=2.1)
    assert len(post) == post[-1] - post[0] + 1


@pytest.mark.parametrize("heading", [0.0, 1.234, -3.0, 9.0])
def test_a_scan_is_written_where_it_looked(heading: float) -> None:
    laser = LaserGeometry()
    ranges = 2.0 + np.arange(laser.beams) / 100.0
    ranges[40] = np.inf
    seen = np.full(DIRECTIONS, UNSEEN)
    look(seen, np.zeros(DIRECTIONS), heading, beams_of(laser), ranges)
    for k in range(DIRECTIONS):
        bearing = math.remainder(math.radians(k) - heading, 2 * math.pi)
        if abs(bearing) > math.pi / 2 + laser.spacing / 2:
            assert seen[k] == UNSEEN
        elif abs(bearing) < math.pi / 2 - 1e-6:
            beam = (bearing - laser.first_bearing) / laser.spacing
            assert seen[k] in ranges[math.floor(beam) : math.ceil(beam) + 1]


def test_a_laser_that_looks_all_round_leaves_nothing_unseen() -> None:
    laser = LaserGeometry(beams=360, first_bearing=-np.pi)
    for heading in (0.0, 0.009, 2.0, -1.0):
        seen = np.full(DIRECTIONS, UNSEEN)
        look(seen, np.zeros(DIRECTIONS), heading, beams_of(laser), np.full(360, 4.0))
        assert (seen == 4.0).all()


def test_the_error_of_a_panorama_is_the_median_of_what_it_shows() -> None:
    round_wall = np.full(DIRECTIONS, 3.0)
    assert panorama_error(round_wall, round_wall) == 0.0
    assert panorama_error(round_wall, round_wall + 0.5) == pytest.approx(0.5)
    assert panorama_error(round_wall, OPEN) == np.inf
    assert panorama_error(OPEN, OPEN) == np.inf
    half = np.where(np.arange(DIRECTIONS) < 180, 3.0, UNSEEN)
    assert panorama_error(half, np.where(half == UNSEEN, 9.0, half)) == 0.0
    assert panorama_error(half, np.full(DIRECTIONS, UNSEEN)) == np.inf


@pytest.mark.parametrize(("step", "is_alike"), [(0.1, True), (0.2, True), (1.0, False)])
def test_posts_are_shown_alike_near_the_nest_only(step: float, is_alike: bool) -> None:
    nest, now = panorama_of(SQUARE), panorama_of(SQUARE, (step, 0.0))
    assert (panorama_error(nest, now) < 0.25) == is_alike
