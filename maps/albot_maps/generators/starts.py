"""More starts than one, scattered over a random building."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from albot_core.errors import InputError
from albot_maps.freespace import FreeSpace
from albot_maps.generators.dice import Dice
from albot_maps.generators.parameters import Parameters
from albot_maps.world import ROBOT_RADIUS, World

_SPARE = 0.05
"""What a start keeps from walls beyond what the robot is wide (m)."""
_TRIES = 1000
"""How often a place is sought for each start."""
_HEADINGS = 24
"""How many headings there are, the whole circle round."""


def scatter_starts(world: World, parameters: Parameters, dice: Dice) -> World:
    """The world with as many starts as the parameters ask for, the kind's own the first.

    The others lie anywhere in a room that a robot can come to from it, each place as likely as
    any other, and look in any direction.

    Raises:
        InputError: There is no room for the robot anywhere else.
    """
    wanted = parameters.starts
    if wanted == 1:
        return world
    free = FreeSpace(world.walls, ROBOT_RADIUS + _SPARE).region_at(world.starts[0, :2])
    shapely.prepare(free)
    x1, y1, x2, y2 = (round(100 * bound) for bound in free.bounds)
    starts = [world.starts[0]]
    for _ in range(_TRIES * (wanted - 1)):
        x, y = dice.length(x1, x2) / 100, dice.length(y1, y2) / 100
        heading = float(np.deg2rad(360 / _HEADINGS * dice.whole(0, _HEADINGS - 1)))
        if world.room_at(x, y) is not None and free.contains(shapely.Point(x, y)):
            starts.append(np.array([x, y, heading]))
            if len(starts) == wanted:
                return replace(world, starts=np.array(starts))
    found = str(wanted)
    raise InputError(
        world.source, f"no more than find room, which {len(starts)} did", found, place="starts"
    )
