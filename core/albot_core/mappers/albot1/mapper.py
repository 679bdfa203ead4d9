"""Albot1 as a mapper."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import transform_points
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.mappers.albot1.batch import Albot1Batch
from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.places.events import Event
from albot_core.mappers.albot1.places.hypothesis import Hypothesis
from albot_core.mappers.albot1.places.network_view import Network
from albot_core.mappers.albot1.places.wayfinding import pointing, way_lines
from albot_core.mappers.mapper import Estimate, MapperSpec, PlaceMatches, WayHome
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import LaserScan, Reading

_ITSELF = np.zeros(1, np.int64)
"""The row of a batch of one."""


class Albot1:
    """Albot1's perceptual map (Hossain 2014, algorithms 1 to 4), and its network of places.

    It knows a route home (`RouteHome`) and remembers places (`PlaceMemory`).

    The robot remembers a view as the local environment that it is about to explore, and follows the
    landmarks in that view. Just before the last of them go out of sight, the robot localises itself
    by them and lays its current view over its map. What the view covers is forgotten.

    Args:
        config: All thresholds; by default those of `albot1`.
        name: The name under which the mapper is known.
    """

    def __init__(self, config: Albot1Config | None = None, name: str = "albot1") -> None:
        self._name = name
        self._robot = Albot1Batch(1, config, name)

    @classmethod
    def thesis(cls) -> Albot1:
        """Return the mapper `albot1-thesis`, which follows the thesis to the letter."""
        return cls(Albot1Config.thesis(), "albot1-thesis")

    @classmethod
    def tracked(cls) -> Albot1:
        """Return the mapper `albot1-tracked`, localised jointly by landmarks tracked over views."""
        return cls(Albot1Config.tracked(), "albot1-tracked")

    @property
    def config(self) -> Albot1Config:
        """All thresholds."""
        return self._robot.config

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. Draws no random number."""
        self._robot.reset(0, rng)

    def update(self, reading: Reading) -> bool:
        """Process a reading (algorithm 4); return whether a view was laid over the map.

        Raises:
            InputError: The reading lacks a laser scan.
        """
        before = self.updates
        laser = reading.required_laser(self._name)
        self._robot.follow(_ITSELF, laser.ranges[None], reading.motion[None], laser.geometry)
        return self.updates > before

    def resume(self, pose: Pose, scan: LaserScan) -> None:
        """Continue at a pose on the map; the next reading's motion begins there."""
        self._robot.resume(0, pose, scan)

    @property
    def spec(self) -> MapperSpec:
        """The specification registered under the mapper's name."""
        return self._robot.spec

    @property
    def estimate(self) -> Estimate:
        """The robot's beliefs after the latest reading.

        Home is where the robot left it in the perceptual map; once a known place is recognised, it
        is where it lies from that place. The matched reading is the one taken nearest by on an
        earlier stay in the present place.
        """
        robot = self._robot
        robot.match_readings(_ITSELF)
        matched = int(robot.matched_readings[0])
        return Estimate(
            pose=np.array(robot.poses[0]),
            home=np.array(robot.homes_in_map[0]),
            localised=not robot.is_lost[0],
            place=robot.network(0).current,
            matched_reading=None if matched < 0 else matched,
            updates=self.updates,
            map_version=int(robot.map_versions[0]),
            segments=int(robot.segment_counts[0]),
        )

    def place_matches(self, most: int) -> PlaceMatches:
        """Return the earlier stays in the present place, and how sure the network is of them."""
        return self._robot.place_matches(0, most)

    def snapshot(self) -> MapSnapshot:
        """Return the surfaces of the perceptual map, and the network of places."""
        return self._robot.snapshot(0)

    @property
    def exits(self) -> Segments:
        """The lines across the exits seen and remembered, in the map's frame (m)."""
        return self._robot.exits(0)

    @property
    def visited(self) -> Points:
        """Where the robot has been: its breadcrumbs, in the map's frame (m)."""
        network = self._robot.network(0)
        return transform_points(network.map_to_graph, network.breadcrumbs.points)

    @property
    def predicted_exits(self) -> Segments:
        """The known exits of the present place, aligned with the map (section 4.2.3; m)."""
        return self._robot.network(0).predicted_exits

    @property
    def network(self) -> Network:
        """The places remembered and the exits between them (a copy)."""
        return self._robot.network(0).snapshot()

    @property
    def events(self) -> tuple[Event, ...]:
        """The events of the network, with their reasons: each acceptance and refusal, in order."""
        return tuple(self._robot.network(0).log.events)

    @property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """The possible positions of a lost robot with their probabilities, at the last comparison.

        Empty unless the robot is lost.
        """
        return self._robot.network(0).hypotheses

    @property
    def way_home(self) -> WayHome:
        """The next exit, a waypoint ahead, and the length of the way, all towards home.

        Updated as `Albot1Batch.find_ways` says.
        """
        self._robot.find_ways(_ITSELF)
        return np.array(self._robot.ways_home[0])

    def place_at(self, reading: int) -> int:
        """Return the id of the place where a reading was taken, by present belief."""
        return self._robot.network(0).place_at(reading)

    def way_to(self, place: int) -> Segments:
        """Return the exits on the believed way to a place, the next first, in the map's frame (m).

        Raises:
            InputError: No place has this id.
        """
        return way_lines(self._robot.network(0), self._robot.poses[0], place)

    def point_to(self, place: int) -> Float64[np.ndarray, "2"]:
        """Return the direction to a place from the robot's heading (rad), and its distance (m).

        For the place that the robot set out from, the target is home; for any other place, it is
        the point where the robot first entered it.

        Raises:
            InputError: No place has this id.
        """
        return pointing(self._robot.network(0), self._robot.poses[0], place)

    @property
    def updates(self) -> int:
        """The number of times a view was laid over the map."""
        return int(self._robot.updates[0])

    @property
    def lost(self) -> int:
        """The number of views at which no landmark was recognised.

        There path integration stands in (section 3.2.1); in `albot1`, which localises by all
        remembered walls nearby, the other surfaces still correct it.
        """
        return int(self._robot.lost[0])

    def state(self) -> dict[str, np.ndarray]:
        """Return everything the mapper remembers, as arrays by name."""
        return self._robot.state(0)

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Restore the memory from what `state` returned.

        Raises:
            InputError: The arrays contradict each other.
        """
        self._robot.restore(0, state)
