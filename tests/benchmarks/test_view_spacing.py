"""Views farther apart: a short drive, the same under each spacing. No test of speed."""

from __future__ import annotations

import numpy as np

from albot_benchmarks.view_spacing import TEST_SEEDS, TUNING_SEEDS, Wanderers, measure_view_spacing
from albot_cli.bench import _views


def test_views_farther_apart_are_fewer_and_the_robots_drive_the_same() -> None:
    every, some = measure_view_spacing(
        seeds=range(3), steps=60, kinds=("office",), spacings=((0.0, 0.0), (0.3, 15.0))
    )
    # The reading of the reset is a view, too.
    assert every["views_per_step"] == 61 / 60
    assert 0.1 < float(some["views_per_step"]) < 0.6
    assert every["rooms"] == some["rooms"]
    for row in (every, some):
        assert 0.0 < float(row["error_median_m"]) < 0.05
        assert int(row["places"]) >= 3
    assert every["speed"] == 1.0
    assert _views(some).startswith("views         0.3 m, 15°")


def test_robots_turn_away_from_what_is_near_to_the_side_that_is_free() -> None:
    wanderers, ranges = Wanderers(3, 9), np.full((3, 9), 5.0)
    ranges[1, 4] = ranges[2, 4] = 0.4
    ranges[1, :3] = 1.0
    ranges[2, 6:] = 1.0
    actions = wanderers.act(ranges)
    assert actions[0, 0] > 0.5
    assert actions[1:].tolist() == [[0.0, 1.0], [0.0, -1.0]]
    ranges[1, 6:] = 0.5
    # Once it turns it goes on turning the same way.
    assert wanderers.act(ranges)[1].tolist() == [0.0, 1.0]


def test_the_spacing_was_not_chosen_in_the_worlds_that_are_measured() -> None:
    assert not set(TUNING_SEEDS) & set(TEST_SEEDS)
