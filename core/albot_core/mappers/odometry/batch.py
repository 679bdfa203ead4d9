"""The map by odometry alone: the baseline of the other mappers.

Each view is transformed from the robot's frame to the frame of its start, by the sum of the
odometer's motions (Hossain, *How Albot1 computes its perceptual map*, 2014, chapter 3). So the map
shows the effect of the odometer's error: a place seen twice is drawn twice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Int64

from albot_core.errors import InputError
from albot_core.geometry.pose_kernels import compose, length_of, rotate_back, wrap_angle
from albot_core.geometry.poses import transform_segments
from albot_core.geometry.types import Segments
from albot_core.kernels.arguments import (
    ArgumentsCache,
    KernelArguments,
    KernelDispatcher,
    unpack,
)
from albot_core.kernels.compiled import kernel
from albot_core.mappers.mapper import TRAVEL, MapperSpec
from albot_core.mappers.registry import mapper_spec
from albot_core.mappers.schema import LONGEST, Arrays, Field, Schema
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot, SegmentsLayer
from albot_core.ranges import FROM_ONE, NOT_NEGATIVE, check_fields
from albot_core.sensing.reading import LaserGeometry, Readings
from albot_core.sensing.view import (
    ViewBuffers,
    ViewConfig,
    ViewSettings,
    extract_surfaces,
    make_view_buffers,
    view_settings,
)


@dataclass(frozen=True, kw_only=True)
class OdometryConfig:
    """When the odometry mapper adds views, and how many surfaces it keeps."""

    view: ViewConfig = field(default_factory=ViewConfig)
    """How surfaces are found in a scan."""
    step: float = 0.20
    """Distance from the last added view at which a new one is added (m)."""
    turn: float = np.deg2rad(20.0)
    """Turn since the last added view at which a new one is added (rad)."""
    capacity: int = 50_000
    """Largest number of surfaces in the map; the oldest are dropped first."""

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, "step", "turn")
        check_fields(self, FROM_ONE, "capacity")


SCHEMA = Schema(
    Field("pose", "3"),
    Field("laid_at", "3"),
    Field("updates", "", int, least=0),
    Field("travel", least=0),
    Field("surfaces", "surfaces 4", lengths=(0, LONGEST)),
)
"""The state of a robot's mapper."""


class OdometryBatch:
    """Path integration for many robots; views are added to their maps at the integrated poses.

    A single `OdometryMapper` is a batch of one.

    Args:
        count: Number of robots.
        config: When views are added, and how many surfaces are kept.
        name: The name under which the mappers are registered.
    """

    recognises_places = False
    """Whether the mappers match readings: these do not."""

    def __init__(
        self, count: int, config: OdometryConfig | None = None, name: str = "odometry"
    ) -> None:
        self.spec: MapperSpec = mapper_spec(name)
        """The mappers' spec, found by their name."""
        self.config = config or OdometryConfig()
        self.poses = np.zeros((count, 3))
        """Each robot's pose by odometry."""
        self.homes_in_map = np.zeros((count, 3))
        """Home is where each odometer began."""
        self.is_recognised = np.zeros(count, np.bool_)
        self.is_lost = np.zeros(count, np.bool_)
        self.matched_readings = np.full(count, -1)
        self.updates: Int64[np.ndarray, "robots"] = np.zeros(count, np.int64)
        """How often each added a view."""
        self.ways_home = np.full((count, 7), np.nan)
        self.ways_home[:, TRAVEL] = 0.0
        self._laid_at = np.zeros((count, 3))
        self._is_due = np.zeros(count, np.bool_)
        self._stores: list[Segments] = [np.empty((0, 4))] * count
        self._ends = np.zeros(count, np.int64)
        travels = Travels(
            poses=self.poses,
            laid_at=self._laid_at,
            ways_home=self.ways_home,
            updates=self.updates,
            is_due=self._is_due,
            step=self.config.step,
            turn=self.config.turn,
        )
        self._travels = KernelArguments((travels,))
        self._settings = ArgumentsCache(self._arguments)

    @property
    def map_versions(self) -> Int64[np.ndarray, "robots"]:
        """The version of each map: how often a view was added."""
        return self.updates

    @property
    def segment_counts(self) -> Int64[np.ndarray, "robots"]:
        """Number of surfaces in each map."""
        return np.minimum(self._ends, self.config.capacity)

    def reset(self, row: int, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. Draws no random number."""
        self.poses[row] = self._laid_at[row] = 0.0
        self.updates[row] = self._ends[row] = 0
        self.ways_home[row, TRAVEL] = 0.0
        self._stores[row] = np.empty((0, 4))

    def update(self, rows: Int64[np.ndarray, "some"], readings: Readings) -> None:
        """Process the readings of some rows.

        Raises:
            InputError: The robots have no laser.
        """
        if readings.ranges is None or readings.laser is None:
            raise InputError("Readings.laser", f"a laser, which {self.spec.name} needs", "none")
        motions = np.ascontiguousarray(readings.motions, np.float64)
        if integrate(rows, self._travels, motions) == 0:
            return
        due = rows[self._is_due[rows]]
        ranges = np.ascontiguousarray(readings.ranges, np.float64)
        surfaces = np.empty((len(due), readings.laser.beams, 4))
        counts = np.empty(len(due), np.int64)
        extract_views(due, self._settings.arguments(readings.laser), ranges, surfaces, counts)
        for row, seen, count in zip(due.tolist(), surfaces, counts.tolist(), strict=True):
            self._remember(row, transform_segments(self.poses[row], seen[:count]))
        self._laid_at[due] = self.poses[due]
        self.updates[due] += 1

    def match_readings(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Do nothing: no reading matches an earlier one."""

    def find_ways(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Do nothing: no way home is known."""

    def begin_return(self, row: int) -> None:
        """Do nothing: it makes no difference whether the robot goes home."""

    def snapshot(self, row: int) -> MapSnapshot:
        """Return a row's remembered surfaces, oldest first."""
        # Stored surfaces are never overwritten, so no copy is made.
        end = int(self._ends[row])
        kept = self._stores[row][max(end - self.config.capacity, 0) : end]
        kept.flags.writeable = False
        return MapSnapshot(layers=(SegmentsLayer(segments=kept),))

    def activity(self, row: int) -> Activity | None:
        """Return None: there is no network."""
        return None

    def state(self, row: int) -> dict[str, np.ndarray]:
        """Return everything that a row's mapper remembers, as arrays by name."""
        return SCHEMA.arrays(
            {
                "pose": self.poses[row],
                "laid_at": self._laid_at[row],
                "updates": self.updates[row],
                "travel": self.ways_home[row, TRAVEL],
                "surfaces": self.snapshot(row).segments,
            }
        )

    def restore(self, row: int, state: Arrays) -> None:
        """Restore a row's mapper from what `state` returned.

        Raises:
            InputError: The arrays are not a state of such a mapper.
        """
        SCHEMA.check(state)
        self.poses[row], self._laid_at[row] = state["pose"], state["laid_at"]
        self.updates[row], self.ways_home[row, TRAVEL] = state["updates"], state["travel"]
        self._stores[row] = state["surfaces"].copy()
        self._ends[row] = len(self._stores[row])

    def _arguments(self, laser: LaserGeometry) -> tuple[ViewSettings]:
        """Return what `extract_views` takes."""
        return (view_settings(laser, self.config.view),)

    def _remember(self, row: int, surfaces: Segments) -> None:
        """Append surfaces; if there is no room, move the kept ones to a larger store.

        The new store has twice the room that is needed, so that on average each surface is moved
        once.
        """
        end = int(self._ends[row])
        if end + len(surfaces) > len(self._stores[row]):
            kept = self.snapshot(row).segments
            end = len(kept)
            self._stores[row] = np.empty((2 * (end + len(surfaces)), 4))
            self._stores[row][:end] = kept
        self._stores[row][end : end + len(surfaces)] = surfaces
        self._ends[row] = end + len(surfaces)


@KernelDispatcher
@kernel(arrays=True, nogil=True)
def extract_views(
    rows: np.ndarray,
    arguments: KernelArguments,
    ranges: np.ndarray,
    surfaces: np.ndarray,
    counts: np.ndarray,
) -> None:
    """Extract the surfaces that the robots `rows` see, in each one's frame (m).

    `arguments` holds `ViewSettings`; `ranges` (n, beams) are those of all robots. Robot `rows[k]`
    sees the first `counts[k]` of `surfaces[k]`.
    """
    beams = ranges.shape[1]
    buffers, edges = make_view_buffers(beams), np.empty((beams, 2), np.int8)
    _extract_all(rows, arguments, ranges, buffers, surfaces, edges, counts)


@kernel()
def _extract_all(
    rows: np.ndarray,
    arguments: KernelArguments,
    ranges: np.ndarray,
    buffers: ViewBuffers,
    surfaces: np.ndarray,
    edges: np.ndarray,
    counts: np.ndarray,
) -> None:
    """`extract_views`, with buffers to work in."""
    (settings,) = unpack(arguments)
    for k in range(rows.shape[0]):
        counts[k] = extract_surfaces(ranges[rows[k]], settings, buffers, surfaces[k], edges)


class Travels(NamedTuple):
    """The arrays of all robots, a row each, and when views are added."""

    poses: np.ndarray
    """(n, 3) float64: where each is by odometry (m, rad)."""
    laid_at: np.ndarray
    """(n, 3) float64: where each added its last view (m, rad)."""
    ways_home: np.ndarray
    """(n, 7) float64: in column TRAVEL how far each has travelled (m)."""
    updates: np.ndarray
    """(n,) int64: how many views each has added."""
    is_due: np.ndarray
    """(n,) bool: whether the latest view of each is to be added."""
    step: float
    """Distance (m) from the last added view…"""
    turn: float
    """…or turn since (rad), at which the next is."""


@KernelDispatcher
@kernel(nogil=True)
def integrate(rows: np.ndarray, arguments: KernelArguments, motions: np.ndarray) -> int:
    """Add the motions of some robots to their poses and travels; return how many views are due.

    One is at the first reading, whose motion does not count. `arguments` holds `Travels`;
    `motions` (n, 3) are those of all robots.
    """
    (robots,) = unpack(arguments)
    due = 0
    for i in rows:
        is_first = robots.updates[i] == 0
        robots.is_due[i] = is_first
        due += is_first
        if is_first:
            continue
        pose, laid, motion = robots.poses[i], robots.laid_at[i], motions[i]
        pose[0], pose[1], pose[2] = compose(pose, motion)
        robots.ways_home[i, TRAVEL] += length_of(motion[0], motion[1])
        x, y = rotate_back(
            math.cos(laid[2]), math.sin(laid[2]), pose[0] - laid[0], pose[1] - laid[1]
        )
        turned = abs(wrap_angle(pose[2] - laid[2]))
        robots.is_due[i] = length_of(x, y) >= robots.step or turned >= robots.turn
        due += robots.is_due[i]
    return due
