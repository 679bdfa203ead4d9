"""The map by odometry alone: the baseline of the other mappers.

Each view is transformed from the robot's frame to the frame of its start, by the sum of the
odometer's motions (Hossain, *How Albot1 computes its perceptual map*, 2014, chapter 3). So the map
shows the effect of the odometer's error: a place seen twice is drawn twice.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Int64

from albot_core.errors import InputError
from albot_core.geometry.pose_kernels import compose, length_of, rotate_back, wrap_angle
from albot_core.geometry.poses import transform_segments
from albot_core.geometry.types import Segments
from albot_core.kernels.compiled import kernel
from albot_core.mappers.mapper import TRAVEL, MapperSpec
from albot_core.mappers.registry import mapper_spec
from albot_core.mappers.stored_arrays import Shape, check_finite, check_lengths, check_shapes
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot, SegmentsLayer
from albot_core.ranges import FROM_ONE, NOT_NEGATIVE, check_fields
from albot_core.sensing.reading import LaserScan, Readings
from albot_core.sensing.view import ViewConfig, construct_view


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


_SHAPES: dict[str, Shape] = {
    "pose": (3,),
    "laid_at": (3,),
    "updates": (),
    "travel": (),
    "surfaces": ("surfaces", 4),
}
"""The arrays of a state."""


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
        self.homes = np.zeros((count, 3))
        """Home is where each odometer began."""
        self.places = np.zeros((count, 2), np.bool_)
        self.matched_readings = np.full(count, -1)
        self.updates: Int64[np.ndarray, "robots"] = np.zeros(count, np.int64)
        """How often each added a view."""
        self.ways_home = np.full((count, 7), np.nan)
        self.ways_home[:, TRAVEL] = 0.0
        self._laid_at = np.zeros((count, 3))
        self._is_due = np.zeros(count, np.bool_)
        self._stores: list[Segments] = [np.empty((0, 4))] * count
        self._ends = np.zeros(count, np.int64)

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
        travels, limits = self.ways_home[:, TRAVEL], (self.config.step, self.config.turn)
        poses = self.poses, self._laid_at
        integrate(rows, motions, *poses, travels, self.updates, *limits, self._is_due)
        for row in rows[self._is_due[rows]].tolist():
            scan = LaserScan(ranges=readings.ranges[row], geometry=readings.laser)
            view = construct_view(scan, self.config.view)
            self._remember(row, transform_segments(self.poses[row], view.surfaces))
            self._laid_at[row] = self.poses[row]
            self.updates[row] += 1

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
        return {
            "pose": self.poses[row].copy(),
            "laid_at": self._laid_at[row].copy(),
            "updates": np.array(self.updates[row]),
            "travel": np.array(self.ways_home[row, TRAVEL]),
            "surfaces": self.snapshot(row).segments.copy(),
        }

    def restore(self, row: int, state: Mapping[str, np.ndarray]) -> None:
        """Restore a row's mapper from what `state` returned.

        Raises:
            InputError: The arrays are not a state of such a mapper.
        """
        check_shapes(state, _SHAPES)
        check_finite(state, "pose", "laid_at", "travel", "surfaces")
        check_lengths("surfaces", state["surfaces"])
        for name, expected in (("updates", "a count"), ("travel", "a length")):
            if state[name] < 0:
                raise InputError(name, expected, str(state[name]))
        self.poses[row], self._laid_at[row] = state["pose"], state["laid_at"]
        self.updates[row], self.ways_home[row, TRAVEL] = state["updates"], state["travel"]
        self._stores[row] = state["surfaces"].copy()
        self._ends[row] = len(self._stores[row])

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


@kernel(nogil=True)
def integrate(
    rows: np.ndarray,
    motions: np.ndarray,
    poses: np.ndarray,
    laid_at: np.ndarray,
    travels: np.ndarray,
    updates: np.ndarray,
    step: float,
    turn: float,
    is_due: np.ndarray,
) -> None:
    """Add the motions of some robots to their poses and travels.

    Sets `is_due` where a view is to be added: at the first reading, whose motion does not count,
    and from so far (m), or so large a turn (rad), from where the last one was added.
    """
    for i in rows:
        is_due[i] = updates[i] == 0
        if is_due[i]:
            continue
        pose, laid, motion = poses[i], laid_at[i], motions[i]
        pose[0], pose[1], pose[2] = compose(pose, motion)
        travels[i] += length_of(motion[0], motion[1])
        x, y = rotate_back(
            math.cos(laid[2]), math.sin(laid[2]), pose[0] - laid[0], pose[1] - laid[1]
        )
        turned = abs(wrap_angle(pose[2] - laid[2]))
        is_due[i] = length_of(x, y) >= step or turned >= turn
