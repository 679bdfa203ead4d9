"""Sahabot 2 as a mapper: where the nest is, by path integration, and near it by landmarks.

Its map is one place, the nest, with the landmarks around it. It remembers a home vector and the
panorama at the nest, and nothing of the way.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.types import Pose
from albot_core.mappers.mapper import POINT, TRAVEL, Estimate, WayHome
from albot_core.mappers.sahabot.config import SahabotConfig
from albot_core.mappers.sahabot.landmarks import (
    Homing,
    Panorama,
    find_landmarks,
    home_by_average,
    home_by_snapshot,
    landmark_chords,
    seen_by_both,
)
from albot_core.mappers.sahabot.panorama import (
    DIRECTIONS,
    UNSEEN,
    beams_of,
    carry_along,
    look,
    panorama_error,
)
from albot_core.mappers.sahabot.path_integration import (
    CompassHeading,
    HomeVector,
    approximate_step,
    exact_step,
)
from albot_core.mappers.schema import Arrays, Field, Pack, Schema
from albot_core.mappers.stored import StoredMapper
from albot_core.maps.layers import MapSnapshot, PlaceGraph, PlaceNode
from albot_core.sensing.reading import LaserScan, Reading

_NEST = 0
"""Id of the place that is the nest, and number of the reading taken there first."""


class Sahabot(StoredMapper):
    """Path integration, and landmark-based visual homing near the nest (`RouteHome`).

    Args:
        config: All parameters.
        name: The mapper's name in the registry.
    """

    config: SahabotConfig
    SCHEMA = Schema(
        Field("position", "2"),
        Pack("way", float, Field("travel", least=0), Field("since_nest", least=0)),
        Pack(
            "counts",
            int,
            Field("readings", least=0),
            Field("updates", least=0),
            Field("is_away", "", bool),
            Field("is_back", "", bool),
        ),
        Field("panorama", f"{DIRECTIONS}", least=UNSEEN, finite=False),
        Field("offsets", f"{DIRECTIONS}"),
        Field("nest", f"{DIRECTIONS}", least=UNSEEN, finite=False),
        parts=("_heading",),
    )

    def __init__(self, config: SahabotConfig | None = None, name: str = "sahabot") -> None:
        config = config or SahabotConfig()
        self._heading = CompassHeading(config.stuck, uses_compass=config.heading == "compass")
        self._carried, self._carried_offsets = np.empty((2, DIRECTIONS))
        super().__init__(config, name)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. Draws no random number."""
        self._position = np.zeros(2)
        self._travel = self._since_nest = 0.0
        self._readings = self._updates = 0
        self._is_away = self._is_back = False
        self._panorama: Panorama = np.full(DIRECTIONS, UNSEEN)
        self._offsets = np.zeros(DIRECTIONS)
        self._nest: Panorama = np.full(DIRECTIONS, UNSEEN)
        self._homing: Homing | None = None
        self._heading.begin(0.0)

    @property
    def estimate(self) -> Estimate:
        """The robot's pose by path integration; home is the nest.

        The robot is lost, as far as it knows, while its compass stands still.
        """
        return Estimate(
            pose=np.array((*self._position, self._heading.heading)),
            home=np.zeros(3),
            localised=not self._heading.is_stuck,
            place=_NEST if self._is_back else None,
            matched_reading=_NEST if self._is_back else None,
            updates=self._updates,
            map_version=self._updates,
        )

    def update(self, reading: Reading) -> bool:
        """Process a reading; return whether the snapshot of the nest was completed by it.

        Raises:
            InputError: The reading lacks a laser scan, or the compass that the config asks for.
        """
        laser = reading.required_laser(self._name)
        uses_compass = self.config.heading == "compass"
        shown = reading.required_compass(self._name) if uses_compass else 0.0
        if self._readings == 0:
            self._heading.begin(shown)
        else:
            self._integrate(reading.motion, shown, laser)
        self._readings += 1
        beams = beams_of(laser.geometry)
        look(self._panorama, self._offsets, self._heading.heading, beams, laser.ranges)
        is_new = self._learn(laser)
        self._homing = self._see_nest()
        self._arrive()
        return is_new

    def _integrate(self, motion: Pose, shown: float, laser: LaserScan) -> None:
        """Add a step to the home vector, and carry the panorama along."""
        before, heading = self._position.copy(), self._heading.heading
        mount = np.array(laser.geometry.mount[:2])
        at = _turned(heading, mount)
        if self.config.integration == "exact":
            self._position[:] = exact_step((before[0], before[1]), heading, motion)
            step = self._position - before
        else:
            step = np.array(exact_step((0.0, 0.0), heading, motion))
            vector = HomeVector.to((before[0], before[1]))
            distance = math.hypot(*step)
            self._position[:] = approximate_step(
                vector, math.atan2(step[1], step[0]), distance
            ).position
        self._travel += math.hypot(*step)
        self._since_nest += math.hypot(*step)
        self._heading.update(float(motion[2]), shown)
        x, y = step + _turned(self._heading.heading, mount) - at
        carried, offsets = self._carried, self._carried_offsets
        carry_along(self._panorama, self._offsets, float(x), float(y), carried, offsets)
        self._panorama, self._carried = carried, self._panorama
        self._offsets, self._carried_offsets = offsets, self._offsets

    def _learn(self, laser: LaserScan) -> bool:
        """Add to the snapshot what is seen near the nest before the robot goes away."""
        if self._is_away or (self._readings > 1 and self._distance > self.config.learning):
            return False
        new = (self._nest == UNSEEN) & (self._panorama != UNSEEN)
        if not new.any():
            return False
        self._nest[new] = self._panorama[new]
        self._updates += 1
        return True

    @property
    def _distance(self) -> float:
        """Length of the home vector (m)."""
        return math.hypot(*self._position)

    def _see_nest(self) -> Homing | None:
        """Return what the landmarks tell of the nest; None far from it, or with too few."""
        self._is_away |= self._distance > self.config.near
        if not self._is_away or self._distance > self.config.near:
            return None
        config = self.config.landmarks
        nest = seen_by_both(find_landmarks(self._nest, config), self._panorama != UNSEEN)
        now = seen_by_both(find_landmarks(self._panorama, config), self._nest != UNSEEN)
        fewer, more = sorted((len(nest), len(now)))
        if fewer < config.least or fewer < config.alike * more:
            return None
        home_by = home_by_average if self.config.visual == "alv" else home_by_snapshot
        return home_by(now, nest)

    def _arrive(self) -> None:
        """Set the home vector to zero where the landmarks say that the robot is at the nest.

        As in the ant: "having arrived at the nest entrance and hence reset their path-integration
        system to zero" (Wehner and others, quoted in the thesis's figure 2.11). The average alone
        is alike at other places, too: the panorama must be that of the nest, which is ours.
        """
        arrived = self.config.arrived
        is_near = self._homing is not None and self._homing.distance < arrived
        if is_near and panorama_error(self._panorama, self._nest) < arrived:
            self._position[:] = 0.0
            self._since_nest = 0.0
            self._is_away, self._is_back, self._homing = False, True, None
        elif self._distance > self.config.learning:
            self._is_back = False

    def _restored(self, state: Arrays) -> None:
        """Find again what the landmarks tell, which no array holds."""
        self._homing = self._see_nest()

    @property
    def way_home(self) -> WayHome:
        """A point ahead in the direction that the landmarks tell; only the travel without any."""
        way = np.full(7, np.nan)
        way[TRAVEL] = self._since_nest
        if self._homing is not None:
            length = math.hypot(*self._homing.direction)
            if length > 0.0:
                way[POINT] = self._position + self.config.step / length * self._homing.direction
        return way

    def snapshot(self) -> MapSnapshot:
        """Return the nest with the landmarks around it, as line segments across them."""
        if self._readings == 0:
            return MapSnapshot(layers=(PlaceGraph(),))
        landmarks = find_landmarks(self._nest, self.config.landmarks)
        nest = PlaceNode(
            id=_NEST,
            label="nest",
            pose=np.zeros(3),
            middle=np.zeros(2),
            segments=landmark_chords(landmarks),
        )
        current = _NEST if self._is_back else None
        return MapSnapshot(layers=(PlaceGraph(nodes=(nest,), current=current, home=_NEST),))


def _turned(heading: float, point: np.ndarray) -> np.ndarray:
    """Return a point of the robot's frame, turned by its heading (m)."""
    cos, sin = math.cos(heading), math.sin(heading)
    return np.array((cos * point[0] - sin * point[1], sin * point[0] + cos * point[1]))
