"""Ways over the ground as robots have seen it: home, and to ground that is not covered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from albot_core.errors import InputError
from albot_core.planning.navigator import JUMP, WORTH
from albot_core.planning.occupancy_grid import NARROW, NEAR_BY
from albot_core.ranges import POSITIVE, check_fields
from albot_env.tasks.core.coverage import CoverageConfig
from albot_env.tasks.core.wayfinding_kernels import (
    OccupancyGrids,
    OccupancyParams,
    SearchParams,
    clear_occupancy,
)


@dataclass(frozen=True, kw_only=True)
class WayfindingConfig:
    """How ways over the ground are searched for.

    From where an episode begins the robot keeps an occupancy grid of what it sees of the ground.
    On the way home it takes what it has not seen for free, and finds the way anew as it sees more
    (A. Stentz, Optimal and efficient path planning for partially-known environments, ICRA
    1994); ways to ground that is not covered lead over ground seen to be free (B. Yamauchi, A
    frontier-based approach for autonomous exploration, CIRA 1997).
    """

    worth: float = WORTH
    """The known way home is left where it is this many times as long as one not known to be barred,
    on which stretches close to things count twice."""
    cell: float = 0.15
    """Side of a cell of the occupancy grid (m)."""
    reach: float = 7.0
    """What lies farther away is not drawn (m)."""
    radius: float = 0.28
    """Ways keep the robot's middle so far from what is blocked (m)…"""
    wide: float = 0.45
    """…and are twice as long to it where they come nearer than this (m)."""
    margin: float = 8.0
    """How far beyond robot and home ways home are searched for (m)."""
    first: float = 8.0
    """Ground not covered is looked for no farther than this along the axes of the map (m)…"""
    last: float = 64.0
    """…and where there is none twice as far, until it is as far as this (m)."""
    ahead: float = 3.0
    """The point shown is the farthest on the way that can be gone to straight, and no farther
    than this (m)."""
    every: int = 5
    """Steps from each search to the next."""

    def __post_init__(self) -> None:
        sizes = "cell", "reach", "radius", "wide", "margin", "first", "last", "ahead"
        check_fields(self, POSITIVE, *sizes)
        self._check("worth", 1.0)
        self._check("every", 1.0)
        self._check("wide", self.radius)
        self._check("margin", self.wide + self.cell)
        self._check("first", self.wide + self.cell)
        self._check("last", self.first)

    def _check(self, name: str, least: float) -> None:
        """Raise InputError for a number less than it may be, or NaN."""
        found = getattr(self, name)
        if not found >= least:
            raise InputError(f"WayfindingConfig.{name}", f"at least {least:g}", str(found))

    def side(self, extent: float) -> int:
        """Cells along each side of a grid for maps that reach so far from their origin (m)."""
        return 2 * int(np.ceil((extent + self.reach) / self.cell))

    def occupancy(self, coverage: CoverageConfig) -> OccupancyParams:
        """How the grids are drawn; the robot looks as often as at the ground that it covers."""
        return OccupancyParams(
            cell=self.cell,
            reach=self.reach,
            jump=JUMP,
            spacing=coverage.spacing,
            turn=coverage.turn,
            every=self.every,
        )

    @property
    def search(self) -> SearchParams:
        """What the compiled searches go by."""
        return SearchParams(
            cell=self.cell,
            radii=(self.radius / self.cell, self.wide / self.cell),
            margin=self.margin,
            first=self.first,
            last=self.last,
            narrow=NARROW,
            ahead=self.ahead,
            at_goal=NEAR_BY,
            worth=self.worth,
        )


def empty_occupancy(robots: int) -> OccupancyGrids:
    """The grids of so many robots, none of which has any cells yet."""
    return OccupancyGrids(
        grids=np.zeros((robots, 0), np.int8),
        sides=np.zeros(robots, np.int64),
        ages=np.zeros(robots, np.int64),
        moved=np.full((robots, 2), np.inf),
        beliefs=np.zeros((robots, 3)),
        shortcuts=np.tile((np.nan, np.nan, np.inf), (robots, 1)),
        onwards=np.tile((np.nan, np.nan, np.inf), (robots, 1)),
    )


def with_occupancy(occupancy: OccupancyGrids, row: int, side: int) -> OccupancyGrids:
    """The grids, with an empty one of so many cells along a side for one robot.

    These are the same arrays, written over; larger ones only where that is needed. A robot's
    grid takes a byte a cell: half a megabyte for an office of 35 m by 25 m.
    """
    robots, room = occupancy.grids.shape
    if side * side > room:
        added = np.zeros((robots, side * side - room), np.int8)
        occupancy = occupancy._replace(grids=np.concatenate((occupancy.grids, added), axis=1))
    occupancy.sides[row] = side
    clear_occupancy(occupancy, row)
    return occupancy
