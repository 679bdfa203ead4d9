"""Paths over the ground as the robot has seen it: home, and to uncovered ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from albot_core.errors import InputError
from albot_core.planning.navigator import JUMP, WORTH
from albot_core.planning.occupancy_grid import NARROW, NEAR_BY
from albot_core.ranges import CELL, FROM_ONE, LENGTH, Range, check_fields
from albot_core.robot import PIONEER_3DX
from albot_env.tasks.core.coverage import CoverageConfig
from albot_env.tasks.core.wayfinding_kernels import (
    OccupancyGrids,
    OccupancyParams,
    SearchParams,
    clear_occupancy,
)

_MOST_CELLS = 10_000
"""Largest number of cells along a length that decides how large a grid is."""
_WORTH = Range("a number from 1, or infinity", 1.0, infinite=True)


@dataclass(frozen=True, kw_only=True)
class WayfindingConfig:
    """Parameters of the search for paths over the ground.

    From the start of an episode the robot keeps an occupancy grid of the ground that it sees. The
    search for a path home treats unseen cells as free and is repeated as the robot sees more
    (A. Stentz, Optimal and efficient path planning for partially-known environments, ICRA 1994).
    Paths to uncovered ground use only cells seen to be free (B. Yamauchi, A frontier-based
    approach for autonomous exploration, CIRA 1997), and lead to where a look around shows most new
    ground for the length of the path (after H. González-Baños and J.-C. Latombe, Navigation
    strategies for exploring indoor environments, 2002).
    """

    worth: float = WORTH
    """The shortcut is preferred if the known way home is this many times as long. Stretches of the
    shortcut close to obstacles count twice."""
    cell: float = 0.15
    """Side of a cell of the occupancy grid (m)."""
    reach: float = 7.0
    """Maximum distance at which readings are drawn on the grid (m)."""
    clearance: float = 0.03
    """Minimum distance of the robot's body from occupied cells on a path (m)."""
    comfort_clearance: float = 0.2
    """Distance of the body from occupied cells below which paths count twice as long (m)."""
    margin: float = 8.0
    """Margin of the search for a path home around robot and home (m)."""
    first: float = 8.0
    """Initial range of the search for uncovered ground, along the map's axes (m)."""
    last: float = 64.0
    """Maximum range of that search (m). The range is widened while more may be found beyond it."""
    ahead: float = 3.0
    """Maximum distance of the observed point, the farthest on the path that can be reached in a
    straight line (m)."""
    every: int = 5
    """Number of steps between searches."""
    sight: float = 2.0
    """A way to uncovered ground leads to where most new ground is in sight for the length of the
    way. Ground up to this far along each axis is in sight, unless something occupied is
    between (m)."""
    stay: float = 3.0
    """Length that is added to that of each way, so that a way of no length is not worth infinitely
    much (m)."""

    def __post_init__(self) -> None:
        bodies = "clearance", "comfort_clearance"
        check_fields(self, LENGTH, "reach", *bodies, "margin", "first", "last", "ahead")
        check_fields(self, LENGTH, "sight", "stay")
        check_fields(self, CELL, "cell")
        check_fields(self, _WORTH, "worth")
        check_fields(self, FROM_ONE, "every")
        self._check("comfort_clearance", self.clearance)
        self._check("last", self.first)
        longest = max(self.reach, self.margin, self.last, self.sight)
        if longest > _MOST_CELLS * self.cell:
            expected = f"a side from {longest / _MOST_CELLS:g} m, for {_MOST_CELLS:,} cells at most"
            raise InputError("WayfindingConfig.cell", expected, str(self.cell))
        self.search(PIONEER_3DX.radius)

    def _check(self, name: str, least: float) -> None:
        """Raise InputError if a number is below its minimum."""
        found = getattr(self, name)
        if found < least:
            raise InputError(f"WayfindingConfig.{name}", f"at least {least:g}", str(found))

    def side(self, extent: float) -> int:
        """Return the cells along each side of a grid that reaches `extent` (m) from the origin."""
        return 2 * int(np.ceil((extent + self.reach) / self.cell))

    def occupancy(self, coverage: CoverageConfig) -> OccupancyParams:
        """Return the parameters of the grids; they are updated as often as coverage is."""
        return OccupancyParams(
            cell=self.cell,
            reach=self.reach,
            jump=JUMP,
            spacing=coverage.spacing,
            turn=coverage.turn,
            every=self.every,
        )

    def search(self, robot_radius: float) -> SearchParams:
        """Return the parameters of the compiled searches for a robot of this radius (m).

        Raises:
            InputError: The searched area does not contain the ground around the robot.
        """
        radius, wide = robot_radius + self.clearance, robot_radius + self.comfort_clearance
        self._check("margin", wide + self.cell)
        self._check("first", wide + self.cell)
        return SearchParams(
            cell=self.cell,
            radii=(radius / self.cell, wide / self.cell),
            margin=self.margin,
            first=self.first,
            last=self.last,
            narrow=NARROW,
            ahead=self.ahead,
            at_goal=NEAR_BY,
            worth=self.worth,
            sight=self.sight,
            stay=self.stay,
        )


def empty_occupancy(robots: int) -> OccupancyGrids:
    """Return the occupancy grids of `robots` robots, without cells."""
    return OccupancyGrids(
        grids=np.zeros((robots, 0), np.int8),
        sides=np.zeros(robots, np.int64),
        ages=np.zeros(robots, np.int64),
        moved=np.full((robots, 2), np.inf),
        beliefs=np.zeros((robots, 3)),
        shortcuts=np.tile((np.nan, np.nan, np.inf), (robots, 1)),
        onwards=np.tile((np.nan, np.nan, np.inf), (robots, 1)),
        paths=np.tile((np.nan, np.nan, np.inf), (robots, 1)),
        drawn=np.zeros((robots, 2, 2), np.int64),
        barred=np.tile((np.inf, 0.0), (robots, 1)),
    )


def with_occupancy(occupancy: OccupancyGrids, row: int, side: int) -> OccupancyGrids:
    """Return the grids with a new, empty one of `side` × `side` cells for one robot.

    The arrays are changed in place; larger ones are made only if needed. A robot's grid takes one
    byte per cell: half a megabyte for an office of 35 m by 25 m.
    """
    robots, room = occupancy.grids.shape
    if side * side > room:
        added = np.zeros((robots, side * side - room), np.int8)
        occupancy = occupancy._replace(grids=np.concatenate((occupancy.grids, added), axis=1))
    occupancy.sides[row] = side
    clear_occupancy(occupancy, row)
    return occupancy
