"""The floor of the experiment hssh-tree: corridors with nested loops, and a route over them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely

from albot_core.geometry.types import Points
from albot_core.mappers.hssh.star import ENDS, Star
from albot_core.mappers.hssh.topological_map import Travel
from albot_maps.world import World

Junction = tuple[int, int]
"""Column and row of a junction of corridors."""

CORRIDORS: tuple[tuple[Junction, Junction], ...] = (
    ((1, 0), (2, 0)),
    ((0, 1), (1, 1)),
    ((1, 1), (2, 1)),
    ((0, 2), (1, 2)),
    ((1, 2), (2, 2)),
    ((0, 0), (0, 1)),
    ((0, 1), (0, 2)),
    ((1, 0), (1, 1)),
    ((1, 1), (1, 2)),
    ((2, 0), (2, 1)),
    ((2, 1), (2, 2)),
)
"""Three corridors along and three across, of which one ends dead: six paths and nine places, which
are a crossing, three junctions of three corridors, four corners and a dead end."""
ROUTE: tuple[Junction, ...] = (
    (1, 1), (1, 2), (0, 2), (0, 1), (0, 0), (0, 1), (1, 1), (2, 1), (2, 0), (1, 0), (1, 1), (1, 2),
    (2, 2), (2, 1), (1, 1),
)  # fmt: skip
"""The 14 travel actions, from junction to junction."""
WIDTH = 2.0
"""Width of the corridors (m)."""
COLUMNS, ROWS = (0.0, 9.0, 20.0), (0.0, 8.0, 15.0)
"""Where the middles of the corridors lie (m). No two blocks have one shape, so that local maps of
places with one star may differ, as in a real office."""
_STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""The directions of corridors, counter-clockwise from the east."""


def directions(junction: Junction) -> list[int]:
    """Return the directions in which corridors leave a junction, counter-clockwise."""
    joined = {frozenset(pair) for pair in CORRIDORS}
    x, y = junction
    return [k for k, (dx, dy) in enumerate(_STEPS) if {junction, (x + dx, y + dy)} in joined]


def star_from(junction: Junction, first: int) -> tuple[Star, list[int]]:
    """Return the star of a junction, and its directions, counted from one of them."""
    leads = directions(junction)
    start = leads.index(first)
    leads = leads[start:] + leads[:start]
    opposite = [(lead + 2) % 4 for lead in leads]
    return Star(*(leads.index(k) if k in leads else ENDS for k in opposite)), leads


def experience(route: Sequence[Junction] = ROUTE) -> tuple[Star, list[Travel]]:
    """Return the star of the first place and the travels, as a robot perceives them on a route."""
    star, leads = star_from(route[0], directions(route[0])[0])
    travels = []
    for here, there in pairwise(route):
        way = _STEPS.index((there[0] - here[0], there[1] - here[1]))
        left = leads.index(way)
        following, leads = star_from(there, (way + 2) % 4)
        travels.append(Travel(left, following, 0))
    return star, travels


def places_of(route: Sequence[Junction] = ROUTE) -> list[int]:
    """Return the true place of each visit, counted in the order of first visits."""
    seen = list(dict.fromkeys(route))
    return [seen.index(junction) for junction in route]


def at(junction: Junction) -> Points:
    """Return the middle of a junction (m)."""
    return np.array((COLUMNS[junction[0]], ROWS[junction[1]]))


def world() -> World:
    """Return the floor as a world, with the route as its tour `route`."""
    half = WIDTH / 2
    corridors = []
    for one, other in CORRIDORS:
        (x1, y1), (x2, y2) = at(one).tolist(), at(other).tolist()
        corridors.append(shapely.box(x1 - half, y1 - half, x2 + half, y2 + half))
    floor = shapely.union_all(corridors).simplify(0.0)
    walls = []
    for ring in (floor.exterior, *floor.interiors):
        points = np.array(ring.coords)
        walls.append(np.hstack((points[:-1], points[1:])))
    # First the robot looks round, as the paper's does where it knows nothing yet.
    around = np.array(((0.0, 0.4), (-0.4, 0.0), (0.0, -0.4), (0.4, 0.0), (0.0, 0.4)))
    middles = np.array([at(junction) for junction in ROUTE])
    tour = np.vstack((middles[:1], middles[0] + around, middles[1:]))
    start = np.array((*tour[0], np.pi / 2))
    return World(
        name="hssh-floor", walls=np.vstack(walls), starts=start[None], tours={"route": tour}
    )
