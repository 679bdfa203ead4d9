"""The rooms of the pointing probes, which are ours: the thesis only draws those of the studies."""

from __future__ import annotations

import numpy as np

from albot_core.geometry.types import Points, Segments
from albot_experiments.desert import POST_RADIUS, posts
from albot_experiments.pointing_lessons import Scene
from albot_maps.world import World

_OBJECTS = np.array(((2.9, 1.9), (0.6, 2.9), (-1.9, 2.9), (-2.9, -0.4), (-1.2, -2.9), (1.8, -2.9)))
"""The six objects around the chamber (m)."""
_CHAMBER = np.array(
    (
        (-1.2, -1.2, 1.2, -1.2),
        (-1.2, -1.2, -1.2, 1.2),
        (-1.2, 1.2, 1.2, 1.2),
        (1.2, -1.2, 1.2, -0.6),
        (1.2, 0.6, 1.2, 1.2),
    )
)
"""The walls of a square chamber with a door on one side (m)."""
_LAP = np.array(((2.0, 2.0), (-2.0, 2.0), (-2.0, -2.0), (2.0, -2.0)))
"""A way round the chamber (m)."""
SPACING = 1.5
"""Distance from the middle object of the array to the others (m)."""
_LANES = (2.3, 0.53, -0.53, -2.3)
"""The lanes between the objects of the array, as distances from its middle (m)."""
_LANE_END = 2.6
"""Where the robot leaves a lane (m)."""


def _rectangle(half_length: float, half_width: float) -> Segments:
    """Return the walls of a room around the origin."""
    corners = _corners(half_length, half_width)
    return np.concatenate((corners, np.roll(corners, -1, axis=0)), axis=1)


def _corners(x: float, y: float) -> Points:
    return np.array(((-x, -y), (x, -y), (x, y), (-x, y)))


def chamber() -> Scene:
    """Return a chamber in a hall, with six objects around it that are not seen from inside.

    The robot begins in the middle of the chamber, goes twice round it, and comes back.
    """
    walls = np.concatenate((_rectangle(4.0, 4.0), _CHAMBER, posts(_OBJECTS)))
    inside, door = np.zeros((1, 2)), np.array(((2.0, 0.0),))
    return Scene(
        world=World(name="chamber", walls=walls, starts=np.zeros((1, 3))),
        targets=_OBJECTS,
        depth=POST_RADIUS,
        tour=np.concatenate((inside, door, _LAP, _LAP, door, inside)),
        near=2.0,
    )


def corner_room() -> Scene:
    """Return a rectangular room whose corners are the targets; the robot goes once round it."""
    room = _corners(3.0, 2.0)
    middle = np.zeros((1, 2))
    return Scene(
        world=World(name="corner-room", walls=_rectangle(3.0, 2.0), starts=np.zeros((1, 3))),
        targets=room,
        depth=0.0,
        tour=np.concatenate((middle, 0.6 * room, 0.6 * room[:1], middle)),
        near=3.0,
    )


def array(*, across: bool = False) -> Scene:
    """Return an array of nine objects in a rectangular room.

    Eight stand round one, equally far from it in steps of 45°, so that the layout makes no imagined
    heading harder than another. The robot begins at the study view, facing 315°, and goes along
    all lanes, there and back, which lead along the axis 0°-180°; or across it.
    """
    angles = np.pi / 4 * np.arange(8)
    ring = SPACING * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    objects = np.concatenate((np.zeros((1, 2)), ring))
    tour = [(-2.3, 2.3), (-2.0, 2.0)]
    end = -_LANE_END
    for lane in (*_LANES, *reversed(_LANES)):
        tour += [(end, lane), (-end, lane)]
        end = -end
    way = np.array(tour)
    walls = np.concatenate((_rectangle(5.0, 4.0), posts(objects)))
    return Scene(
        world=World(name="array", walls=walls, starts=np.array(((-2.3, 2.3, -np.pi / 4),))),
        targets=objects,
        depth=POST_RADIUS,
        tour=-way[:, ::-1] if across else way,  # Mirrored on the line of the study view.
        near=1.0,
    )
