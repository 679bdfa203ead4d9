"""Robot paths and the surfaces beside them, where the answers are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers.albot0.paths import PathConfig, PathInProgress
from albot_core.mappers.albot0.steps import ECHOES, Steps
from albot_core.sensing.reading import SonarGeometry, SonarScan
from tests.core.mappers.albot0.sonar_scenes import SONAR, driven, sonar_from

CONFIG = PathConfig()
CORRIDOR = np.array(((-5.0, 1.0, 20.0, 1.0), (-5.0, -1.5, 20.0, -1.5)))
"""2.5 m wide, its middle 0.25 m to the right of the x axis."""


def followed(way: np.ndarray, scans: list[SonarScan], config: PathConfig = CONFIG) -> list[Steps]:
    """The steps of every path that came to its end."""
    path, finished = PathInProgress(samples=[]), []
    for number, (pose, scan) in enumerate(zip(way, scans, strict=True)):
        steps = path.follow(tuple(pose.tolist()), scan, number, config)
        finished += [] if steps is None else [steps]
    last = path.stop(config)
    return finished + ([] if last is None else [last])


def led(way: np.ndarray, walls: np.ndarray, **config: float) -> list[Steps]:
    return followed(way, [sonar_from(pose, walls) for pose in way], PathConfig(**config))


def test_a_corridor_has_a_surface_on_either_side():
    (steps,) = led(driven((0, 0), (2.5, 0)), CORRIDOR)
    np.testing.assert_allclose(steps.lines[[0, -1]][:, [0, 2]], ((0, 1.25), (1.25, 2.5)), atol=1e-9)
    np.testing.assert_allclose(steps.widths, [[1.0, 1.5]] * len(steps.lines), atol=1e-9)
    np.testing.assert_allclose(np.unique(steps.surfaces[:, [1, 3]]), (-1.5, 1.0), atol=1e-9)
    assert steps.begins.tolist() == [True, False]
    assert steps.readings.tolist() == [0, 13]
    east, north = (steps.lines[:, None, :2] + steps.echoes)[steps.heard].T
    np.testing.assert_allclose(np.unique(north.round(9)), (-1.5, 1.0))
    # From beside the robot at its start to what the sonars at 30° hear at the end.
    np.testing.assert_allclose((east.min(), east.max()), (0.2, 5.0), atol=0.1)


def test_echoes_are_kept_in_the_frame_of_their_step():
    way = driven((0, 0), (2.5, 0))
    (steps,) = led(way, CORRIDOR)
    (turned,) = led(driven((0, 0), (0, 2.5)), CORRIDOR[:, [1, 0, 3, 2]] * (-1, 1, -1, 1))
    np.testing.assert_allclose(turned.echoes, steps.echoes, atol=1e-9)


def test_echoes_from_far_away_are_left_out():
    (steps,) = led(driven((0, 0), (2.5, 0)), CORRIDOR)
    assert steps.heard.sum() > 50
    assert not replace(steps, echoes=500.0 * steps.echoes).heard.any()


def test_of_many_sonars_some_are_kept():
    bearings = tuple(np.radians(np.arange(-90, 91, 10)).tolist())
    ring = SonarGeometry(bearings=bearings, places=((0.0, 0.0),) * len(bearings))
    scan = SonarScan(ranges=np.ones(len(bearings)), geometry=ring)
    (steps,) = followed(driven((0, 0), (2.5, 0)), [scan] * 26)
    assert steps.echoes.shape == (2, ECHOES, 2)
    assert steps.echoes.any(axis=-1).all()


def test_a_path_ends_where_it_is_long_or_where_the_robot_turns():
    paths = led(driven((0, 0), (7.0, 0), (7.0, -1.0)), CORRIDOR)
    lengths = [np.hypot(*(each.lines[-1, 2:] - each.lines[0, :2])) for each in paths]
    np.testing.assert_allclose(lengths, (3.0, 3.0, 1.0, 1.0), atol=0.11)
    assert sum(each.begins.sum() for each in paths) == 4


@pytest.mark.parametrize(("width", "is_closed"), [(0.7, True), (2.4, False)])
def test_small_gaps_are_closed_and_large_ones_are_distant_surfaces(width, is_closed):
    left = np.array(((-5.0, 1.0, 3.0 - width / 2, 1.0), (3.0 + width / 2, 1.0, 20.0, 1.0)))
    (steps,) = led(driven((0, 0), (5.9, 0)), np.concatenate((left, CORRIDOR[1:])), longest=9.0)
    assert steps.walled[:, 0].all() == is_closed
    assert not steps.echoes.any(axis=-1).all()  # Echoes are kept as they came.
    if is_closed:
        np.testing.assert_allclose(steps.widths[:, 0], 1.0, atol=1e-9)
    else:
        assert steps.widths[:, 0].max() == SONAR.max_range
        assert steps.walled[:, 0].tolist() == [True, True, False, False, True, True]
    assert steps.walled[:, 1].all()


@pytest.mark.parametrize(("gap", "is_closed"), [(1.0, True), (0.6, False)])
def test_a_gap_that_is_most_of_a_step_is_closed_where_it_is_small(gap, is_closed):
    """One of 0.8 m in a step of 1 m: the median of the step's cells alone would be the gap's."""
    left = np.array(((-5.0, 1.0, 2.1, 1.0), (2.9, 1.0, 20.0, 1.0)))
    (steps,) = led(
        driven((0, 0), (5.0, 0)), np.concatenate((left, CORRIDOR[1:])), longest=9.0, step=1.0,
        gap=gap,
    )  # fmt: skip
    assert steps.walled[:, 0].tolist() == [True, True, is_closed, True, True]
    np.testing.assert_allclose(steps.widths[2, 0], 1.0 if is_closed else SONAR.max_range)


def test_a_missed_echo_and_a_false_one_change_nothing():
    way = driven((0, 0), (2.5, 0))
    scans = [sonar_from(pose, CORRIDOR) for pose in way]
    for k, distance in ((7, np.inf), (13, 0.2)):
        ranges = scans[k].ranges.copy()
        ranges[-1] = distance
        scans[k] = SonarScan(ranges=ranges, geometry=SONAR)
    (steps,) = followed(way, scans)
    np.testing.assert_allclose(steps.widths, [[1.0, 1.5]] * len(steps.lines), atol=1e-9)


def test_where_nothing_is_heard_there_are_no_surfaces():
    (steps,) = led(driven((0, 0), (2.5, 0)), CORRIDOR + np.array((0, 50, 0, 50)))
    np.testing.assert_array_equal(steps.widths, SONAR.max_range)
    assert len(steps.surfaces) == 0


def test_a_robot_that_drives_backwards_has_left_and_right_as_its_way_has():
    way = driven((0, 0), (2.5, 0))[::-1]
    (steps,) = led(way, CORRIDOR)
    np.testing.assert_allclose(steps.widths, [[1.5, 1.0]] * len(steps.lines), atol=1e-9)


def test_turning_on_the_spot_is_no_path():
    way = np.array([(0.0, 0.0, turn) for turn in np.linspace(0, 6, 60)])
    assert not led(way, CORRIDOR)


def test_standing_still_takes_no_memory():
    path = PathInProgress(samples=[])
    for number in range(100):
        path.follow(
            (0.001 * (number % 2), 0.0, 0.0), sonar_from(np.zeros(3), CORRIDOR), number, CONFIG
        )
    assert len(path.samples) == 1


def test_being_carried_away_is_no_path():
    way = np.array(((0.0, 0, 0), (1e9, 0, 0), (1e9 + 1, 0, 0), (1e300, 0, 0)))
    assert not led(way, CORRIDOR)


def test_sonars_that_all_look_ahead_are_refused():
    ahead = SonarGeometry(bearings=(0.0, -np.pi / 2), places=((0.1, 0.0), (0.0, -0.1)))
    scan = SonarScan(ranges=np.ones(2), geometry=ahead)
    with pytest.raises(InputError, match="a sonar that looks to the left"):
        PathInProgress(samples=[]).follow((0.0, 0.0, 0.0), scan, 0, CONFIG)


@pytest.mark.parametrize(
    "config",
    [{"turn": 0.0}, {"turned_round": 4.0}, {"step": 0.0}, {"gap": -1.0}, {"shortest": 9.0}],
)
def test_thresholds_are_checked(config):
    with pytest.raises(InputError, match=rf"PathConfig\.{next(iter(config))}"):
        PathConfig(**config)
