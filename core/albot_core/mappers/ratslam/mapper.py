"""RatSLAM with experience mapping as a mapper."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import compose, relative, wrap_angle
from albot_core.geometry.types import Points, Poses
from albot_core.mappers.mapper import POINT, TRAVEL, Estimate, MapperSpec, WayHome
from albot_core.mappers.ratslam.arrays import Table
from albot_core.mappers.ratslam.config import RatSlamConfig
from albot_core.mappers.ratslam.doubt import Doubt, Transition
from albot_core.mappers.ratslam.events import RELOCALISED, SEEDED, Event, EventLog
from albot_core.mappers.ratslam.experiences import ExperienceMap
from albot_core.mappers.ratslam.local_views import NO_VIEW, Links, Scenes, Templates
from albot_core.mappers.ratslam.pose_cells import Packet, PoseCells
from albot_core.mappers.ratslam.state import check_state
from albot_core.mappers.ratslam.winding import HeadingBias
from albot_core.mappers.registry import mapper_spec
from albot_core.maps.layers import MapSnapshot, PlaceEdge, PlaceGraph, PlaceNode, TrajectoryLayer
from albot_core.sensing.reading import Reading

Motion = tuple[float, float, float]
"""x, y (m) and unwrapped heading (rad)."""

_SNAP, _SNAP_TURN = 0.75, math.radians(30.0)
"""The packet went elsewhere than the robot drove where it is so far from there (m, rad)."""
_LOCALISED = 0.5
"""The robot believes in its pose while the packet has this share of all activity."""


class RatSlam:
    """Pose cells, local views, and a map of experiences that corrects itself.

    It knows a route home (`RouteHome`), remembers places (`PlaceMemory`), which are experiences,
    and corrects its earlier poses (`CorrectedTrajectory`). It keeps no surfaces.

    Args:
        config: All thresholds.
        name: The name under which the mapper is known.
    """

    def __init__(self, config: RatSlamConfig | None = None, name: str = "ratslam") -> None:
        self.config = config = config or RatSlamConfig()
        self._name = name
        self._cells = PoseCells(config.pose_cells)
        self._scenes, self._templates = Scenes(config.views), Templates(config.views)
        self._links = Links(config.views)
        self._map = ExperienceMap(config.experiences, config.pose_cells, config.correction)
        self._bias, self._log = HeadingBias(), EventLog()
        self._history = Table(place=(np.int64, ()), pose=(np.float64, (3,)))
        self._visits = Table(place=(np.int64, ()))
        self._doubt = Doubt()
        self.reset(np.random.default_rng(0))

    @property
    def spec(self) -> MapperSpec:
        """What is known of it by its name."""
        return mapper_spec(self._name)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. It draws no random number."""
        parts = self._cells, self._scenes, self._templates, self._links, self._bias, self._doubt
        for part in parts:
            part.reset()
        for table in (self._map, self._log, self._history, self._visits):
            table.clear()
        self._stamp = self._left_at = 0.0
        self._way = 0.0
        self._since: Motion = (0.0, 0.0, 0.0)  # Since the last iteration.
        self._here: Motion = (0.0, 0.0, 0.0)  # The robot in the present experience.
        self._view = NO_VIEW
        self._place = self._matched = -1
        self._iteration = self._left_in = self._updates = self._version = 0

    def update(self, reading: Reading) -> bool:
        """Take in a reading; true where an experience or a transition was learned.

        Raises:
            InputError: The reading lacks a laser scan, and the mapper sees by one.
        """
        laser = reading.required_laser(self._name) if self.config.sees == "laser" else None
        before, view = self._updates, self._view
        is_first = self._history.count == 0
        if not is_first:
            self._integrate(reading)
        self._stamp = reading.stamp
        if laser is None:
            view = self._scenes.look(reading.scene, view)
        if is_first or self._has_moved_on():
            turn = 0.0
            if laser is not None:
                view, turn = self._templates.look(laser, view)
            self._iterate(view, turn)
        self._history.append(place=self._place, pose=self._here)
        return self._updates > before

    def _integrate(self, reading: Reading) -> None:
        """Path integration, of all that is counted by it."""
        x, y, turn = reading.motion.tolist()
        way = math.hypot(x, y)
        self._bias.add(way, turn, reading.stamp - self._stamp)
        self._way += way
        self._since = _after(self._since, x, y, turn)
        self._here = _after(self._here, x, y, turn)
        self._doubt.integrate(x, y, turn)

    def _has_moved_on(self) -> bool:
        """Whether the robot has moved far enough for another iteration."""
        x, y, turn = self._since
        config = self.config.pose_cells
        return math.hypot(x, y) >= config.step or abs(turn) >= config.turn

    def _iterate(self, view: int, turn: float) -> None:
        """One iteration of pose cells, experiences and map correction.

        Args:
            view: What is seen.
            turn: The robot's heading seen from the view (rad).
        """
        cells = self._cells
        self._iteration += 1
        expected = cells.packet
        active = self._activate(view, turn)
        is_alive = cells.iterate(self._since, *active)
        jump = cells.offset(expected.x, expected.y, expected.heading)
        off = relative(np.array(self._since), jump)
        self._since = (0.0, 0.0, 0.0)
        has_snapped = math.hypot(off[0], off[1]) > _SNAP or abs(off[2]) > _SNAP_TURN
        if has_snapped or not is_alive:
            self._links.forget_waiting()
        self._links.learn(self._way)
        before = self._place
        if has_snapped and before >= 0:
            self._begin_doubt()
        self._experience(view, turn)
        if has_snapped or not is_alive:
            self._log.add(
                Event(
                    kind=RELOCALISED if is_alive else SEEDED,
                    reading=self._history.count,
                    view=view,
                    before=before,
                    after=self._place,
                    jump=math.hypot(off[0], off[1]),
                    turn=float(off[2]),
                )
            )
        if self._map.correct():
            self._version += 1

    def _activate(
        self, view: int, turn: float
    ) -> tuple[np.ndarray, Float64[np.ndarray, "injected"]]:
        """Let a view inject activity, and remember which cells were active as it came in sight."""
        links, cells, config = self._links, self._cells, self.config
        columns, rows, headings = cells.shape
        plane, count = columns * rows, columns * rows * headings
        layers = round(turn / config.pose_cells.cell_turn)
        if view == NO_VIEW:
            self._view = view
            return np.zeros(0, np.int64), np.zeros(0)
        active = links.activate(view, self._iteration)
        if view != self._view:
            self._view = view
            top = cells.top(config.views.linked_share)
            seen_from = (cells.cells[top] - layers * plane) % count
            peak = int(seen_from[np.argmax(cells.activity[top])])
            if not links.leads_near(view, peak, cells.shape):
                links.remember(view, seen_from, active * cells.activity[top], self._way)
        return links.injection(view, active, layers, plane, count)

    def _begin_doubt(self) -> None:
        """The robot was re-localised. If it was doubted where it is, it is back at the anchor."""
        doubt = self._doubt
        if doubt.anchor >= 0:
            self._place, self._here = doubt.anchor, doubt.since
            self._left_at, self._left_in = doubt.left_at, doubt.left_in
        doubt.begin(self._place, self._here, self._left_at, self._left_in, self._map.count)

    def _experience(self, view: int, turn: float) -> None:
        """Find the active experience, or make one, and learn how it was reached."""
        packet, before, doubt = self._cells.packet, self._place, self._doubt
        found = self._map.active(view, packet)
        table = self._map.experiences
        if found == before and found >= 0:
            table["way"][found] = self._way
            return
        # Without a view nothing tells apart what shares pose cells.
        is_new = found < 0 or view == NO_VIEW
        if is_new:
            base, here = (doubt.anchor, doubt.since) if doubt.anchor >= 0 else (before, self._here)
            pose = (0.0, 0.0, 0.0) if base < 0 else _after(tuple(table["pose"][base]), *here)
            found = self._map.add(pose, packet, view, turn, self._history.count)
            offset, self._matched = (0.0, 0.0, 0.0), -1
            self._updates += 1
        else:
            offset = self._offset(found, turn)
            is_earlier = self._way - table["way"][found] >= self.config.experiences.apart
            self._matched = int(table["reading"][found]) if is_earlier else -1
        if before >= 0:
            motion = _before(self._here, offset)
            time, steps = self._stamp - self._left_at, self._iteration - self._left_in
            self._learn(Transition(before, found, motion, time, steps), is_new)
        table["way"][found] = self._way
        self._place, self._here = found, offset
        self._left_at, self._left_in = self._stamp, self._iteration
        self._visits.append(place=found)
        self._version += 1

    def _learn(self, transition: Transition, is_new: bool) -> None:
        """Learn a transition, or let it wait while a re-localisation is doubted.

        Args:
            transition: From the experience before to that which the robot is in now.
            is_new: Whether that is new: then it hangs from the anchor, by the odometer.
        """
        doubt = self._doubt
        if doubt.anchor < 0:
            self._connect(transition)
            return
        if transition.source != doubt.anchor or not is_new:
            doubt.wait(transition)
        if is_new:
            time, steps = self._stamp - doubt.left_at, self._iteration - doubt.left_in
            here = transition.target
            self._connect(Transition(doubt.anchor, here, doubt.since, time, steps))
            doubt.anchor_at(here, self._stamp, self._iteration)
        if doubt.confirmations >= self.config.experiences.confirmations:
            for waiting in doubt.end():
                self._connect(waiting)

    def _connect(self, transition: Transition) -> None:
        """Learn a transition."""
        source, target, motion, time, steps = transition
        if self._map.connect(source, target, _motion(motion), time, self._bias.rate, steps):
            self._updates += 1

    def _offset(self, experience: int, turn: float) -> Motion:
        """The robot in the frame of an experience that it is in again.

        By the pose cells; but for the heading of a robot with a laser, which the template tells.
        """
        table = self._map.experiences
        x, y, heading = self._cells.offset(*table["cell"][experience].tolist()).tolist()
        if self.config.sees == "laser":
            heading = turn - float(table["turn"][experience])
        return x, y, heading

    @property
    def estimate(self) -> Estimate:
        """Where the robot is in the map of experiences; home is where it began."""
        pose = np.zeros(3)
        if self._place >= 0:
            pose = compose(self._map.poses[self._place], np.array(self._here))
        return Estimate(
            pose=pose,
            home=np.zeros(3),
            localised=self._cells.packet.share >= _LOCALISED,
            place=None if self._place < 0 else self._place,
            matched_reading=None if self._matched < 0 else self._matched,
            updates=self._updates,
            map_version=self._version,
        )

    @property
    def packet(self) -> Packet:
        """The largest packet of the pose cells."""
        return self._cells.packet

    @property
    def experiences(self) -> ExperienceMap:
        """The experience map itself: it goes on changing."""
        return self._map

    @property
    def views(self) -> int:
        """How many views are linked to pose cells, or were seen."""
        return self._links.views

    def snapshot(self) -> MapSnapshot:
        """The experiences and transitions, and the way over them in the order of time."""
        if not self._map.count:
            return MapSnapshot(layers=(PlaceGraph(), TrajectoryLayer(poses=np.empty((0, 3)))))
        poses = self._map.poses.copy()
        poses[:, 2] = wrap_angle(poses[:, 2])
        nodes = tuple(
            PlaceNode(id=k, label=f"E{k}", pose=pose, middle=pose[:2])
            for k, pose in enumerate(poses)
        )
        links = self._map.links
        ends = list(zip(links.rows("source").tolist(), links.rows("target").tolist(), strict=True))
        number = {pair: k for k, pair in enumerate(ends)}
        motions = links.rows("motion").copy()
        motions[:, 2] = wrap_angle(motions[:, 2])
        edges = tuple(
            PlaceEdge(source=one, target=other, motion=motion, reverse=number.get((other, one)))
            for (one, other), motion in zip(ends, motions, strict=True)
        )
        graph = PlaceGraph(nodes=nodes, edges=edges, current=self._place, home=0)
        way = TrajectoryLayer(poses=poses[self._visits.rows("place")])
        return MapSnapshot(layers=(graph, way))

    @property
    def events(self) -> tuple[Event, ...]:
        """The re-localisations, each with what caused it."""
        return self._log.events

    def place_at(self, reading: int) -> int:
        """Id of the experience in which a reading was taken."""
        return int(self._history.rows("place")[reading])

    def corrected_poses(self) -> Poses:
        """The robot's pose at every reading since the reset, as believed now, (readings, 3)."""
        places = self._history.rows("place")
        if not len(places):
            return np.empty((0, 3))
        return compose(self._map.poses[places], self._history.rows("pose"))

    @property
    def way_home(self) -> WayHome:
        """The quickest way home over the transitions: a point ahead on it, and its length."""
        table = self._map.experiences
        if self._place < 0:
            way = np.full(7, np.nan)
            way[TRAVEL] = 0.0
            return way
        return self._way_over(table.rows("length"), table.rows("onward"))

    def way_to(self, point: Points) -> WayHome:
        """The same to the experience nearest to a point of the map (m): any point is a goal.

        Before the first reading it knows no way.
        """
        if self._place < 0:
            return np.array((*[np.nan] * 6, np.inf))
        _, lengths, onward = self._map.ways_to(self._map.nearest(*point.tolist()))
        return self._way_over(lengths, onward)

    def _way_over(self, lengths: Float64[np.ndarray, "all"], onward: np.ndarray) -> WayHome:
        """The way from the present experience by the next one of each."""
        way = np.full(7, np.nan)
        way[TRAVEL] = lengths[self._place]
        here, gone = self._place, 0.0
        while onward[here] >= 0 and gone < self.config.ahead:
            ahead = int(onward[here])
            gone += float(lengths[here] - lengths[ahead])
            here = ahead
        if gone >= self.config.ahead:
            way[POINT] = self._map.poses[here, :2]
        return way

    def state(self) -> dict[str, np.ndarray]:
        """Everything the mapper remembers, as arrays by name."""
        whole = (self._view, self._place, self._matched, self._iteration, self._left_in)
        counts = (*whole, self._updates, self._version)
        numbers = (self._stamp, self._left_at, self._way)
        kept = {
            "counts": np.array(counts, np.int64),
            "numbers": np.array((*numbers, *self._since, *self._here)),
            "packet": np.array(self._cells.packet),
            "active_cells": self._cells.cells.copy(),
            "activity": self._cells.activity.copy(),
        }
        kept |= self._history.state("history") | self._visits.state("visits")
        for part in self._parts:
            kept |= part.state()
        return kept

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Become the mapper that returned `state`.

        Raises:
            InputError: The arrays are none that a state holds.
        """
        check_state(state, self.state(), self.config)
        *whole, self._updates, self._version = state["counts"].tolist()
        self._view, self._place, self._matched, self._iteration, self._left_in = whole
        self._stamp, self._left_at, self._way, *motions = state["numbers"].tolist()
        self._since, self._here = _motion(motions[:3]), _motion(motions[3:])
        self._cells.packet = Packet(*state["packet"].tolist())
        self._cells.cells = state["active_cells"].copy()
        self._cells.activity = state["activity"].copy()
        self._history.restore("history", state)
        self._visits.restore("visits", state)
        for part in self._parts:
            part.restore(state)

    @property
    def _parts(
        self,
    ) -> tuple[Scenes, Templates, Links, HeadingBias, Doubt, ExperienceMap, EventLog]:
        """Those that keep their own state."""
        views = self._scenes, self._templates, self._links
        return *views, self._bias, self._doubt, self._map, self._log


def _motion(numbers: Sequence[float]) -> Motion:
    x, y, heading = numbers
    return x, y, heading


def _after(first: Motion, x: float, y: float, turn: float) -> Motion:
    """A motion after another; headings are added up without wrapping."""
    cos, sin = math.cos(first[2]), math.sin(first[2])
    return first[0] + cos * x - sin * y, first[1] + sin * x + cos * y, first[2] + turn


def _before(whole: Motion, last: Motion) -> Motion:
    """What comes before the last part of a motion: composed with that it is the whole."""
    heading = whole[2] - last[2]
    cos, sin = math.cos(heading), math.sin(heading)
    x, y = cos * last[0] - sin * last[1], sin * last[0] + cos * last[1]
    return whole[0] - x, whole[1] - y, heading
