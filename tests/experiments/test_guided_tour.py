"""The guide leads the robot where the tour says, in steps of the size asked for."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_env.sim.odometer import ODOMETERS
from albot_env.sim.simulator import StartStop
from albot_experiments.guided_tour import guided_tour, true_motions
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
    with pytest.raises(InputError, match="above 0"):
        StartStop(move=0.0)
