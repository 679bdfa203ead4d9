"""The step after an exit is crossed: the forced update of algorithm 5, line 16."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.handle_events import RobotMemory, handle_events
from albot_core.mappers.albot1.perceptual_map.mapping import MAPPING_PROGRESS
from albot_core.mappers.albot1.perceptual_map.memory import (
    USED,
    VISIT,
    add_surface,
    empty_map,
    empty_view,
    living,
)
from albot_core.mappers.albot1.places.exits import empty_exits
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.visits import seen_since
from albot_core.mappers.albot1.step import CROSSED
from albot_core.sensing.view import CORNER

RIGHT, AHEAD, LEFT = (0.5, -2.0, 4.0, -2.0), (4.0, -2.0, 4.0, 2.0), (4.0, 2.0, 0.5, 2.0)
"""The walls in view."""
LONG = (8.0, 2.0, 0.5, 2.0)
"""The wall to the left as the map has it: the view shows a part of it."""
BEHIND = (-9.0, 1.0, -9.0, -1.0)
"""A wall in the map that is not in view."""
DOOR = (0.0, -0.5, 0.0, 0.5)
"""The exit behind the robot, which came from its left."""

EVERY = [Albot1Config(), Albot1Config.tracked(), Albot1Config.thesis()]
NAMES = ["albot1", "albot1-tracked", "albot1-thesis"]


def through_the_door(config: Albot1Config) -> RobotMemory:
    """A robot that has crossed an exit, at view 8; its map has been updated at view 3."""
    pm, view, exits = empty_map(), empty_view(), empty_exits()
    for surface in (AHEAD, LONG, BEHIND):
        add_surface(pm, np.array(surface), np.full(2, CORNER, np.int8))
    view.surfaces[:3], view.edges[:3], view.size[0] = (RIGHT, AHEAD, LEFT), CORNER, 3
    view.pose[:] = 0.4, 0.0, 0.0
    view.surfaces[:3, ::2] -= 0.4
    exits.crossing[:] = *DOOR, 1.0
    progress = np.zeros(1, MAPPING_PROGRESS)[0]
    progress["step"], progress["updated_at"], progress["updates"] = 8, 3, 1
    network, pose = PlaceNetwork(config.places), view.pose.copy()
    return RobotMemory(pm, view, exits, network, progress, pose, next_id=3)


def marks_at(robot: RobotMemory, x: float, y: float) -> list[int]:
    """The visits of the surfaces in the map that pass through a point."""
    alive = living(robot.pm)
    surfaces, marks = robot.pm.surfaces[: len(alive)], robot.pm.marks[: len(alive)]
    first, last = (
        np.minimum(surfaces[:, :2], surfaces[:, 2:]),
        np.maximum(surfaces[:, :2], surfaces[:, 2:]),
    )
    is_there = ((first - 1e-6 <= (x, y)) & (last + 1e-6 >= (x, y))).all(1)
    return sorted(marks[alive & is_there].tolist())


@pytest.mark.parametrize("config", EVERY, ids=NAMES)
def test_what_is_in_view_where_an_exit_is_crossed_belongs_to_the_place_entered(
    config: Albot1Config,
) -> None:
    robot = through_the_door(config)
    handle_events(robot, CROSSED, config.limits)
    assert robot.pm.counts[VISIT] == 2
    assert robot.network.visits == [-1, 0, 1]
    in_view = [(2.0, -2.0), (4.0, 0.0), (2.0, 2.0)]
    assert [marks_at(robot, *point) for point in in_view] == [[2], [2], [2]]
    assert marks_at(robot, -9.0, 0.0) == [1]
    assert len(seen_since(robot.pm, 2)) == 3
    assert len(seen_since(robot.pm, 1)) == 4


@pytest.mark.parametrize("config", EVERY, ids=NAMES)
def test_a_wall_that_the_view_extends_is_marked_as_a_whole(config: Albot1Config) -> None:
    robot = through_the_door(config)
    handle_events(robot, CROSSED, config.limits)
    assert marks_at(robot, 7.0, 2.0) == [2]


@pytest.mark.parametrize("config", EVERY, ids=NAMES)
def test_the_update_is_forced_where_no_landmark_is_out_of_sight(config: Albot1Config) -> None:
    robot = through_the_door(config)
    handle_events(robot, CROSSED, config.limits)
    assert robot.progress["updates"] == 2
    assert robot.progress["updated_at"] == 7
    # The wall that the map lacked is in it, and the view's landmarks are the map's surfaces.
    assert marks_at(robot, 1.0, -2.0) == [2]
    assert robot.pm.counts[USED] >= 4


@pytest.mark.parametrize("config", EVERY, ids=NAMES)
def test_the_place_left_is_described_by_what_was_seen_before_the_update(
    config: Albot1Config,
) -> None:
    robot = through_the_door(config)
    handle_events(robot, CROSSED, config.limits)
    assert len(robot.network.places[0].surfaces) == 3
    assert len(robot.network.places[1].surfaces) == 0
    (left,), (entered,) = (robot.network.places[key].exits for key in (0, 1))
    assert (left.leads_to, entered.leads_to) == (1, 0)
    np.testing.assert_allclose(left.line, DOOR)
