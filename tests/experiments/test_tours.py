"""The guide leads the robot where the tour says, in steps of the size asked for."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.planning.leading import Driving
from albot_core.sensing.reading import LaserGeometry, LaserScan, Reading
from albot_env.sim.odometer import ODOMETERS
from albot_env.sim.simulator import StartStop
from albot_experiments.tours import (
    TourRecord,
    driven_tour,
    guided_tour,
    thinned_views,
    true_motions,
)
from albot_maps import load_world


def test_the_steps_are_counted_in_closed_form() -> None:
    world = load_world("square-loop")
    x, y, _ = world.starts[0]
    tour = np.array([[x, y], [x + 1.0, y], [x + 2.5, y]])
    journey = guided_tour(world, tour, np.random.default_rng(0), steps=StartStop(move=0.6))
    # Two moves of 0.5 m and three of 0.5 m, no turn; and the first reading.
    assert len(journey.readings) == 6
    assert journey.path_length == pytest.approx(2.5, abs=0.02)
    assert np.hypot(*(journey.truth[-1, :2] - tour[-1])) < 0.02


def test_an_ideal_odometer_measures_the_true_motions() -> None:
    world = load_world("square-loop")
    x, y, _ = world.starts[0]
    tour = np.array([[x, y], [x + 1.5, y], [x + 0.5, y]])
    journey = guided_tour(
        world, tour, np.random.default_rng(0), odometer=ODOMETERS["ideal"], steps=StartStop()
    )
    # The half turn back is four turns of 45 degrees.
    assert len(journey.readings) == 1 + 2 + 4 + 1
    motions = np.array([reading.motion for reading in journey.readings])
    assert np.allclose(motions[1:], true_motions(journey)[1:], atol=2e-3)
    pose = journey.truth[0]
    for motion in true_motions(journey)[1:]:
        pose = compose(pose, motion)
    assert np.allclose(pose[:2], journey.truth[-1, :2])


def test_a_tour_through_a_wall_is_refused() -> None:
    world = load_world("square-loop")
    x, y, _ = world.starts[0]
    with pytest.raises(InputError, match="clear of walls, found a wall"):
        guided_tour(world, np.array([[x, y], [x, y + 40.0]]), np.random.default_rng(0))


def test_steps_must_have_a_size() -> None:
    with pytest.raises(InputError, match="a positive number"):
        StartStop(move=0.0)


LASER = LaserGeometry(beams=2)


def reading(stamp: float, motion: np.ndarray) -> Reading:
    return Reading(stamp=stamp, motion=motion, laser=LaserScan(ranges=np.ones(2), geometry=LASER))


def ridden(motions: list[tuple[float, float, float]]) -> TourRecord:
    poses = [np.zeros(3)]
    for motion in motions:
        poses.append(compose(poses[-1], np.array(motion)))
    steps = [np.zeros(3), *map(np.array, motions)]
    return TourRecord(
        readings=tuple(reading(float(i), step) for i, step in enumerate(steps)),
        truth=np.array(poses),
    )


def test_views_are_noted_by_distance_and_by_turn_in_closed_form():
    straight = [(0.25, 0.0, 0.0)] * 9
    turning = [(0.0, 0.0, np.radians(4.0))] * 7
    journey = thinned_views(ridden(straight + turning), 1.0, np.radians(10.0))
    # Views after 4 and 8 steps straight on; 0.25 m later after three steps of turning, twice.
    assert [round(each.stamp) for each in journey.readings] == [0, 4, 8, 12, 15]
    assert np.allclose(journey.readings[1].motion, [1.0, 0.0, 0.0])
    assert np.allclose(journey.readings[3].motion, [0.25, 0.0, np.radians(12.0)])


def test_motions_between_views_add_up_to_the_way():
    rng = np.random.default_rng(5)
    full = ridden([tuple(step) for step in rng.normal(0, 0.1, (200, 3))])
    journey = thinned_views(full, 0.5, np.radians(30.0))
    assert 5 < len(journey.readings) < 150
    pose = np.zeros(3)
    for each, truth in zip(journey.readings, journey.truth, strict=True):
        pose = compose(pose, each.motion)
        assert np.allclose(pose, truth)


def test_the_drive_passes_every_waypoint_and_ends_at_the_last():
    world = load_world("square-loop")
    tour = world.tours["loop"][:3]
    journey = driven_tour(world, tour, np.random.default_rng(0), odometer=ODOMETERS["ideal"])
    for waypoint in tour:
        at = journey.truth[journey.nearest_view(waypoint), :2]
        assert np.hypot(*(at - waypoint)) < 0.2
    assert np.hypot(*(journey.truth[-1, :2] - tour[-1])) < 0.16
    assert journey.path_length == pytest.approx(9.0, abs=0.3)
    steps = np.hypot(*np.diff(journey.truth[:, :2], axis=0).T)
    # Without stopping: it stands only where it turns on the spot.
    assert steps.max() <= 0.051
    assert np.mean(steps < 0.005) < 0.25


def test_a_drive_through_a_wall_is_refused():
    world = load_world("square-loop")
    x, y, _ = world.starts[0]
    with pytest.raises(InputError, match="clear of walls, found a wall"):
        driven_tour(world, np.array([[x, y], [x, y + 40.0]]), np.random.default_rng(0))


def test_driving_must_have_a_speed():
    with pytest.raises(InputError, match="a positive number"):
        Driving(speed=0.0)
