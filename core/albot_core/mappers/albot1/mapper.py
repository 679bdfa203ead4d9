"""Albot1 as a mapper."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import relative
from albot_core.geometry.types import Pose, Segments
from albot_core.mappers.albot1.batch import Albot1Batch
from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.places.events import Event
from albot_core.mappers.albot1.places.wayfinding import pointing, way_lines
from albot_core.mappers.mapper import WayHome
from albot_core.maps.place_graph import Network
from albot_core.sensing.reading import Reading

_ITSELF = np.zeros(1, np.int64)
"""The rows of a batch of one."""


class Albot1:
    """Albot1's perceptual map (Hossain 2014, algorithms 1 to 4).

    The robot remembers a view as the local environment that it is about to explore, follows
    the landmarks in it, and just before the last of them go out of sight locates itself by
    them and lays the view that it then has over its map. What the view covers is forgotten.

    Args:
        config: All thresholds; by default those of `albot1`.
        name: The name under which the mapper is known.
    """

    def __init__(self, config: Albot1Config | None = None, name: str = "albot1") -> None:
        self._name = name
        self._robot = Albot1Batch(1, config)

    @classmethod
    def thesis(cls) -> Albot1:
        """`albot1-thesis`: the thesis to the letter."""
        return cls(Albot1Config.thesis(), "albot1-thesis")

    @property
    def config(self) -> Albot1Config:
        """All thresholds."""
        return self._robot.config

    def reset(self) -> None:
        """Forget everything; the next reading is the first."""
        self._robot.reset(0)

    def update(self, reading: Reading) -> bool:
        """Take in a reading (algorithm 4); true where a view was laid over the map."""
        before = self.updates
        laser = reading.laser
        self._robot.follow(_ITSELF, laser.ranges[None], reading.motion[None], laser.geometry)
        return self.updates > before

    @property
    def name(self) -> str:
        """The name under which `make_mapper` finds it."""
        return self._name

    @property
    def pose(self) -> Pose:
        """Where the robot believes to be, in the map's frame."""
        return np.array(self._robot.poses[0])

    @property
    def surfaces(self) -> Segments:
        """The surfaces of the perceptual map, in the map's frame (m)."""
        return self._robot.surfaces(0)

    @property
    def home(self) -> Pose:
        """Where home is believed to be, in the robot's present frame.

        Home is where it was left in the perceptual map; once a known place is recognised,
        where it lies from there.
        """
        return relative(self._robot.poses[0], self._robot.homes[0])

    @property
    def exits(self) -> Segments:
        """The lines across the exits seen and remembered, in the map's frame (m)."""
        return self._robot.exits(0)

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
        """What happened to the network and why: each acceptance and refusal, in order."""
        return tuple(self._robot.network(0).log.events)

    @property
    def way_home(self) -> WayHome:
        """The next exit, a waypoint ahead, and the length of the way, all towards home.

        Found anew after so much way as `Albot1Batch.find_ways` says.
        """
        self._robot.find_ways(_ITSELF)
        return np.array(self._robot.ways_home[0])

    @property
    def is_lost(self) -> bool:
        """Whether it was moved, knows it, and has not recognised a place since."""
        return self._robot.network(0).lost_since > 0

    def way_to(self, place: int) -> Segments:
        """The exits on the believed way to a place, the next first, in the map's frame (m).

        Raises:
            InputError: It knows no place of this id.
        """
        return way_lines(self._robot.network(0), self._robot.poses[0], place)

    def point_to(self, place: int) -> Float64[np.ndarray, "2"]:
        """Where a place is: direction from the robot's heading (rad) and distance (m).

        For the place that the robot set out from this points to home, for another to where
        it was first entered.

        Raises:
            InputError: It knows no place of this id.
        """
        return pointing(self._robot.network(0), self._robot.poses[0], place)

    @property
    def updates(self) -> int:
        """How often a view was laid over the map."""
        return int(self._robot.updates[0])

    @property
    def lost(self) -> int:
        """At how many views no landmark was recognised.

        There path integration stands in (section 3.2.1); where what is remembered nearby
        localises the robot, as in `albot1`, the other surfaces still correct it.
        """
        return int(self._robot.lost[0])

    def state(self) -> dict[str, np.ndarray]:
        """Everything the mapper remembers, as arrays by name."""
        return self._robot.state(0)

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Become the mapper that returned `state`.

        Raises:
            InputError: The arrays contradict each other.
        """
        self._robot.restore(0, state)
