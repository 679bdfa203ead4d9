"""How precisely a point tells where its wall is, against drawn errors."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.sensing.beam_model import (
    BEARING_NOISE,
    RANGE_NOISE,
    WALL_NOISE,
    BeamModel,
    nearer_side,
    variance_across,
)


@pytest.mark.parametrize("degrees", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("bearing", np.radians([90.0, 45.0, 20.0, 8.0]).tolist())
def test_the_variance_is_that_of_drawn_points(bearing: float, degrees: float) -> None:
    aside, width = 1.5, np.radians(degrees)
    distance, rng = aside / np.sin(bearing), np.random.default_rng(1)
    ranges = distance + RANGE_NOISE * rng.standard_normal(200_000)
    bearings = bearing + BEARING_NOISE * width * rng.standard_normal(200_000)
    uneven = WALL_NOISE * rng.standard_normal(200_000)
    variance = np.var(ranges * np.sin(bearings) + uneven) / RANGE_NOISE**2
    model = BeamModel(np.radians(1.0), width, True)
    found = variance_across(distance**2, aside, model) / distance**2
    assert found == pytest.approx(variance, rel=0.03)


@pytest.mark.parametrize(
    ("ranges", "side"),
    [
        ((3.0, 2.0, 1.9), 1.0),  # the wall comes nearer on the left, where bearings grow
        ((1.9, 2.0, 3.0), -1.0),
        ((2.1, 2.0, 1.0), 1.0),  # what is 1 m away is another wall
        ((1.9, 2.0, 1.0), -1.0),
        ((2.0, 2.0, 2.5), 0.0),
        ((np.inf, 2.0, np.inf), 0.0),
        ((np.inf, 2.0, 2.2), -1.0),
    ],
)
def test_the_nearer_side_is_that_of_the_own_wall(
    ranges: tuple[float, float, float], side: float
) -> None:
    assert nearer_side(np.array(ranges), 1) == side


def test_the_first_and_the_last_beam_have_one_neighbour() -> None:
    ranges = np.array((2.0, 1.9))
    assert nearer_side(ranges, 0) == 1.0
    assert nearer_side(ranges, 1) == 1.0
