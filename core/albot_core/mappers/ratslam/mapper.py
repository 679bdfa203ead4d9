"""RatSLAM with experience mapping as a mapper."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Points, Poses
from albot_core.mappers.mapper import POINT, TRAVEL, Estimate, PlaceMatches, WayHome
from albot_core.mappers.ratslam.arrays import Table
from albot_core.mappers.ratslam.config import RatSlamConfig
from albot_core.mappers.ratslam.events import RELOCALISED, SEEDED, Event, EventLog
from albot_core.mappers.ratslam.experiences import ExperienceMap
from albot_core.mappers.ratslam.layers import map_layers, network_activity
from albot_core.mappers.ratslam.local_views import Links
from albot_core.mappers.ratslam.motions import motion_of
from albot_core.mappers.ratslam.pose_cells import Packet, PoseCells
from albot_core.mappers.ratslam.position import Position
from albot_core.mappers.ratslam.state import RULES
from albot_core.mappers.ratslam.visual_input import LaserInput, SceneInput
from albot_core.mappers.schema import Field, Schema
from albot_core.mappers.stored import StoredMapper
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import Reading

_SNAP, _SNAP_TURN = 0.75, math.radians(30.0)
"""The packet has jumped if it is farther than this from where the odometer expects it (m, rad)."""
_LOCALISED = 0.5
"""The robot is localised while the packet has at least this share of all activity."""


class RatSlam(StoredMapper):
    """Pose cells, local views, and a map of experiences that corrects itself.

    It knows a route home (`RouteHome`), remembers places (`PlaceMemory`), which are its
    experiences, says how sure it is of them (`Recognition`), and corrects its earlier poses
    (`CorrectedTrajectory`). It keeps no surfaces.

    Args:
        config: All parameters.
        name: The name under which the mapper is registered.
    """

    config: RatSlamConfig
    SCHEMA = Schema(
        parts=("_history", "_cells", "_links", "_position", "_input", "_log"), rules=RULES
    )

    def __init__(self, config: RatSlamConfig | None = None, name: str = "ratslam") -> None:
        config = config or RatSlamConfig()
        self._cells, self._links = PoseCells(config.pose_cells), Links(config.views)
        self._position = Position(config)
        parts = config, self._cells, self._links, self._position
        self._input: LaserInput | SceneInput = (
            LaserInput(*parts, name) if config.sees == "laser" else SceneInput(*parts)
        )
        self._log = EventLog()
        self._history = Table(
            "history",
            Field("place", "", int, least=-1, below="experiences"),
            # The robot's pose in the frame of an experience.
            Field("frame", "", int, least=0, below="experiences"),
            Field("pose", "3"),
        )
        super().__init__(config, name)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. Draws no random number."""
        for part in (self._cells, self._links, self._position, self._input):
            part.reset()
        self._log.clear()
        self._history.clear()
        self._shown: tuple[np.ndarray, Activity] | None = None  # Cells last shown.

    def update(self, reading: Reading) -> bool:
        """Process a reading; return whether an experience or a transition was learned.

        Raises:
            InputError: The mapper uses a laser, and the reading lacks a scan.
        """
        position, is_first = self._position, self._history.count == 0
        position.reading, updates = self._history.count, position.updates
        self._input.look(reading)
        if not is_first:
            position.integrate(motion_of(reading.motion.tolist()), reading.stamp)
        position.stamp = reading.stamp
        if is_first or self._has_moved_on():
            self._iterate()
        if position.dropped is not None:
            frames, poses = position.dropped
            rows = slice(self._history.count - len(frames), self._history.count)
            self._history["frame"][rows], self._history["pose"][rows] = frames, poses
        self._history.append(place=position.place, frame=position.place, pose=position.here)
        position.note()
        return position.updates > updates

    def _has_moved_on(self) -> bool:
        """Return whether the robot has moved far enough for another iteration."""
        x, y, turn = self._position.since
        config = self.config.pose_cells
        return math.hypot(x, y) >= config.step or abs(turn) >= config.turn

    def _iterate(self) -> None:
        """Run one iteration of pose cells, experiences and map correction."""
        cells, position = self._cells, self._position
        position.iteration += 1
        expected, place = cells.packet, position.place
        injected = self._input.inject()
        is_alive = cells.iterate(position.since, *injected)
        jump = cells.offset(expected.x, expected.y, expected.heading)
        off = relative(np.array(position.since), jump)
        position.since = (0.0, 0.0, 0.0)
        has_snapped = math.hypot(off[0], off[1]) > _SNAP or abs(off[2]) > _SNAP_TURN
        if has_snapped or not is_alive:
            self._links.forget_waiting()
        self._links.learn(position.way)
        if has_snapped:
            position.begin_verification()
        self._input.experience()
        if has_snapped or not is_alive:
            self._log.add(
                Event(
                    kind=RELOCALISED if is_alive else SEEDED,
                    reading=self._history.count,
                    view=position.view,
                    before=place,
                    after=position.place,
                    jump=math.hypot(off[0], off[1]),
                    turn=float(off[2]),
                )
            )
        if position.map.correct():
            position.version += 1

    @property
    def estimate(self) -> Estimate:
        """The robot's pose in the experience map; home is where it started."""
        return Estimate(
            pose=self._position.believed,
            home=np.zeros(3),
            localised=self._cells.packet.share >= _LOCALISED,
            place=None if self._position.place < 0 else self._position.place,
            matched_reading=None if self._position.matched < 0 else self._position.matched,
            updates=self._position.updates,
            map_version=self._position.version,
        )

    @property
    def packet(self) -> Packet:
        """The largest packet of the pose cells."""
        return self._cells.packet

    @property
    def activity(self) -> Activity:
        """The activity of the pose cells over (x', y')."""
        cells = self._cells
        if self._shown is None or self._shown[0] is not cells.cells:
            self._shown = cells.cells, network_activity(cells)
        return self._shown[1]

    @property
    def experiences(self) -> ExperienceMap:
        """The live experience map; later updates change it."""
        return self._position.map

    @property
    def views(self) -> int:
        """Number of views that were seen or linked to pose cells."""
        return self._links.views

    @property
    def link_strengths(self) -> Float64[np.ndarray, "links"]:
        """Strengths of the live links from views to pose cells, in the order of learning."""
        return self._links.strengths

    def snapshot(self) -> MapSnapshot:
        """Return experiences and transitions, and the trajectory over them in order of time."""
        position = self._position
        return map_layers(position.map, position.visits.rows("place"), position.place)

    @property
    def events(self) -> tuple[Event, ...]:
        """The re-localisations, each with its cause."""
        return self._log.events

    def place_at(self, reading: int) -> int:
        """Return the id of the experience that was active at a reading."""
        return int(self._history.rows("place")[reading])

    def place_matches(self, most: int) -> PlaceMatches:
        """Return the active experiences of earlier visits, the present one first.

        The score is that of the view; a scene is recognised or not, and scores 1. The probability
        is the packet's share of all activity, the ambiguity that of the next packet, which
        represents another pose. An experience's pose is that of the reading at which it was made.
        """
        position = self._position
        chosen = position.recognised[:most]
        places = np.array(position.active, np.int64)[chosen]
        matches = np.empty((len(chosen), 6))
        matches[:, 0] = np.array(position.scores)[chosen]
        matches[:, 1:3] = self._cells.shares()
        matches[:, 3:5] = position.map.poses[places, :2]
        matches[:, 5] = position.map.experiences["reading"][places]
        return matches

    def corrected_poses(self) -> Poses:
        """Return the pose at every reading since the reset, as estimated now, (readings, 3)."""
        frames = self._history.rows("frame")
        if not len(frames):
            return np.empty((0, 3))
        return compose(self._position.map.poses[frames], self._history.rows("pose"))

    @property
    def way_home(self) -> WayHome:
        """The quickest way home over the transitions: a point ahead on it, and its length."""
        table = self._position.map.experiences
        if self._position.place < 0:
            way = np.full(7, np.nan)
            way[TRAVEL] = 0.0
            return way
        return self._way_over(table.rows("length"), table.rows("onward"))

    def way_to(self, point: Points) -> WayHome:
        """Return the quickest way to the experience nearest to a point of the map (m).

        Any point may be the goal. Before the first reading no way is known.
        """
        if self._position.place < 0:
            return np.array((*[np.nan] * 6, np.inf))
        _, lengths, onward = self._position.map.ways_to(self._position.map.nearest(*point.tolist()))
        return self._way_over(lengths, onward)

    def _way_over(self, lengths: Float64[np.ndarray, "all"], onward: np.ndarray) -> WayHome:
        """Return the way from the present experience, given the next experience of each."""
        way = np.full(7, np.nan)
        way[TRAVEL] = lengths[self._position.place]
        here, gone = self._position.place, 0.0
        while onward[here] >= 0 and gone < self.config.ahead:
            ahead = int(onward[here])
            gone += float(lengths[here] - lengths[ahead])
            here = ahead
        if gone >= self.config.ahead:
            way[POINT] = self._position.map.poses[here, :2]
        return way
