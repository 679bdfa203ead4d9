"""A part of observations: all that is to be said of it, as one object."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from jaxtyping import Float

from albot_env.tasks.core.coverage_kernels import CoverageGrid, CoverageSensor
from albot_env.tasks.core.map_arrays import MapArrays
from albot_env.tasks.core.obstacle_kernels import ObstacleMemory
from albot_env.tasks.core.parts.scales import Scales
from albot_env.tasks.core.state import BatchState
from albot_env.tasks.core.wayfinding_kernels import OccupancyGrids, SearchParams

Shape = tuple[int, ...]
Decoded = TypeVar("Decoded")


class Need(Enum):
    """What must be worked out for a part, besides readings and beliefs."""

    WAY_HOME = "the believed way home"
    GROUND = "the ground that the robot believes covered"
    OCCUPANCY = "an occupancy grid"
    MAP = "what the mapper remembers"
    TRUTH = "the truth, which only twins of a task reveal"
    TIME_BUDGET = "a time that is given to be back in"


class Sizes(NamedTuple):
    """What the shapes of parts depend on."""

    beams: int
    """Number of ranges that are shown of the laser; 0 on a robot without one."""
    sonars: int
    """Number of sonars."""
    compasses: int
    """1 on a robot with a compass, 0 on one without."""
    patch: int
    """Number of cells along a side of the patch of covered ground."""
    map_layers: int
    """Number of channels of the map's patches, of all scales together."""
    map_cells: int
    """Number of cells along a side of the map's patches."""
    graph_rows: int
    """Number of rows of the place graph: places and connections."""
    matches: int
    """Number of rows of the matches of the present place."""


class GraphScratch(NamedTuple):
    """Arrays that the part `place_graph` overwrites."""

    shown: np.ndarray
    """(places,) int64: the places that are shown, by index, the nearest first."""
    away: np.ndarray
    """(places,) float64: their distances (m)."""
    rows: np.ndarray
    """(most,) int64: the row in which each place is shown; -1 for none."""


class Sources(NamedTuple):
    """What the parts of observations are computed from, for compiled code."""

    scales: Scales
    state: BatchState
    sensor: CoverageSensor
    believed: CoverageGrid
    """The ground believed covered."""
    search: SearchParams
    occupancy: OccupancyGrids
    nearest: np.ndarray
    """Scratch (sectors,): the minimum range of each sector (m)."""
    frontier: np.ndarray
    """Scratch (beams or sectors,): how far frontiers are (m)."""
    maps: MapArrays
    """What the mappers remember."""
    graph: GraphScratch
    obstacles: ObstacleMemory
    """The surfaces that they saw lately."""


@dataclass(frozen=True, kw_only=True)
class ObservationPart(Generic[Decoded]):
    """A part of observations.

    Beside it stands the compiled function that fills it in, which `observation_kernels` calls.
    """

    name: str
    """Its name in configurations and in observations by part."""
    numbers: str
    """How many numbers it has, in words."""
    meaning: str
    """What they mean, as Markdown."""
    shape: Callable[[Sizes], Shape]
    """Its shape; a part with no number is not observed."""
    needs: frozenset[Need] = frozenset()
    """What must be worked out for it."""
    decode: Callable[[Float[np.ndarray, "..."], Scales], Decoded]
    """Returns what the numbers stand for, in SI units."""

    @property
    def row(self) -> str:
        """Its row in a table of parts."""
        return f"| `{self.name}` | {self.numbers} | {self.meaning} |"


def with_laser(*shape: int) -> Callable[[Sizes], Shape]:
    """Return the shape of a part that only a robot with a laser has."""
    return lambda sizes: shape if sizes.beams else (0,)
