"""Random worlds with more starts than one."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from albot_core.errors import InputError
from albot_maps import ROBOT_RADIUS, load_world
from albot_maps.freespace import FreeSpace, floor_at
from albot_maps.generators import populate
from albot_maps.generators.spec import KINDS


@pytest.mark.parametrize("kind", KINDS)
def test_more_starts_are_scattered_over_what_can_be_reached_and_change_nothing_else(kind):
    own, world = load_world(f"random:{kind}:5"), load_world(f"random:{kind}:5?starts=12")
    assert np.array_equal(world.walls, own.walls)
    assert np.array_equal(world.starts[0], own.starts[0])
    assert len(np.unique(world.starts, axis=0)) == 12
    assert all(world.room_at(x, y) is not None for x, y, _ in world.starts)
    space = FreeSpace(world.walls, ROBOT_RADIUS)
    region = space.region_at(world.starts[0, :2])
    assert all(region.contains(shapely.Point(start)) for start in world.starts[:, :2])
    spread = np.ptp(world.starts[:, :2], axis=0) / np.ptp(world.walls.reshape(-1, 2), axis=0)
    assert (spread > 0.5).all()
    assert len(np.unique(world.starts[:, 2])) > 6
    assert np.array_equal(load_world(world.source).starts, world.starts)


def test_boxes_stay_away_from_every_start():
    world = load_world("random:hall:3?starts=10&boxes=20&width=12&depth=10")
    for box in world.movables.boxes:
        gaps = shapely.distance(box.outline, shapely.points(world.starts[:, :2]))
        assert gaps.min() >= 1.3


@pytest.mark.parametrize(
    "spec", ["random:apartment:1?boxes=8", "random:office:11?boxes=8", "random:hall:11?boxes=8"]
)
def test_no_box_stands_inside_furniture(spec):
    world = load_world(spec)
    floor = floor_at(world.walls, world.starts[0, :2])
    assert all(floor.contains(box.outline) for box in world.movables.boxes)


def test_a_world_without_room_for_another_start_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(populate, "_START_TRIES", 0)
    with pytest.raises(InputError, match=r"at most 1 \(all that fit\)"):
        load_world("random:maze:5?starts=3")
