"""RatSLAM with experience mapping as a mapper."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Points, Pose, Poses
from albot_core.mappers.mapper import POINT, TRAVEL, Estimate, MapperSpec, WayHome
from albot_core.mappers.ratslam.arrays import Table
from albot_core.mappers.ratslam.config import RatSlamConfig
from albot_core.mappers.ratslam.doubt import Doubt, Transition
from albot_core.mappers.ratslam.events import RELOCALISED, SEEDED, Event, EventLog
from albot_core.mappers.ratslam.experiences import ExperienceMap
from albot_core.mappers.ratslam.layers import map_layers
from albot_core.mappers.ratslam.local_views import NO_VIEW, Links, Scenes
from albot_core.mappers.ratslam.motions import Motion, after, before, motion_of, nearest_turn
from albot_core.mappers.ratslam.panoramas import Panoramas, Sighting
from albot_core.mappers.ratslam.pose_cells import Packet, PoseCells
from albot_core.mappers.ratslam.state import check_state
from albot_core.mappers.ratslam.winding import HeadingBias
from albot_core.mappers.registry import mapper_spec
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import LaserScan, Reading

Injection = tuple[Int64[np.ndarray, "injected"], Float64[np.ndarray, "injected"]]
"""Cells that activity is injected into, and how much into each."""

_EXPECTED = 4
"""So many of the experiences nearest to the robot are looked for where they should be."""
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
        self._scenes, self._panoramas = Scenes(config.views), Panoramas(config.panoramas)
        self._links = Links(config.views)
        self._map = ExperienceMap(config.experiences, config.pose_cells, config.correction)
        self._bias, self._log = HeadingBias(), EventLog()
        self._history = Table(place=(np.int64, ()), pose=(np.float64, (3,)))
        self._visits = Table(place=(np.int64, ()))
        self._doubt = Doubt()
        senses = self._scenes, self._panoramas, self._links
        self._parts = *senses, self._bias, self._map, self._log, self._doubt
        self.reset(np.random.default_rng(0))

    @property
    def spec(self) -> MapperSpec:
        """What is known of it by its name."""
        return mapper_spec(self._name)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. It draws no random number."""
        parts = self._cells, self._scenes, self._panoramas, self._links, self._bias, self._doubt
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
        updates, view = self._updates, self._view
        is_first = self._history.count == 0
        if not is_first:
            self._integrate(reading)
        self._stamp = reading.stamp
        if laser is None:
            view = self._scenes.look(reading.scene, view)
        if is_first or self._has_moved_on():
            self._iterate(view, laser)
        self._history.append(place=self._place, pose=self._here)
        return self._updates > updates

    def _integrate(self, reading: Reading) -> None:
        """Path integration, of all that is counted by it."""
        x, y, turn = reading.motion.tolist()
        way = math.hypot(x, y)
        self._bias.add(way, turn, reading.stamp - self._stamp)
        self._way += way
        self._since = after(self._since, (x, y, turn))
        self._here = after(self._here, (x, y, turn))
        self._doubt.integrate((x, y, turn))

    def _has_moved_on(self) -> bool:
        """Whether the robot has moved far enough for another iteration."""
        x, y, turn = self._since
        config = self.config.pose_cells
        return math.hypot(x, y) >= config.step or abs(turn) >= config.turn

    def _iterate(self, view: int, laser: LaserScan | None) -> None:
        """One iteration of pose cells, experiences and map correction.

        Args:
            view: The scene that is seen; not of a robot with a laser,
            laser: …which sees by this scan.
        """
        cells = self._cells
        self._iteration += 1
        expected = cells.packet
        sightings = [] if laser is None else self._look(laser)
        injected = self._inject_scene(view) if laser is None else self._inject(sightings)
        is_alive = cells.iterate(self._since, *injected)
        jump = cells.offset(expected.x, expected.y, expected.heading)
        off = relative(np.array(self._since), jump)
        self._since = (0.0, 0.0, 0.0)
        has_snapped = math.hypot(off[0], off[1]) > _SNAP or abs(off[2]) > _SNAP_TURN
        if has_snapped or not is_alive:
            self._links.forget_waiting()
        self._links.learn(self._way)
        place = self._place
        if has_snapped and place >= 0 and self.config.experiences.confirmations:
            self._begin_doubt()
        if laser is None:
            self._experience_scene(view)
        else:
            self._experience(sightings)
        if has_snapped or not is_alive:
            self._log.add(
                Event(
                    kind=RELOCALISED if is_alive else SEEDED,
                    reading=self._history.count,
                    view=self._view,
                    before=place,
                    after=self._place,
                    jump=math.hypot(off[0], off[1]),
                    turn=float(off[2]),
                )
            )
        if self._map.correct():
            self._version += 1

    def _inject_scene(self, view: int) -> Injection:
        """Let a scene inject activity, and remember which cells were active as it came in sight."""
        links = self._links
        is_new, self._view = view != self._view, view
        if view == NO_VIEW:
            return np.zeros(0, np.int64), np.zeros(0)
        active = links.activate(view, self._iteration)
        if is_new:
            self._associate(view, active, (0.0, 0.0, 0.0))
        return links.injection(view, active)

    def _associate(self, view: int, active: float, offset: Motion) -> None:
        """Remember the pose cells that are active with a view, to link them later.

        Args:
            view: The view.
            active: How active it is.
            offset: The robot in its frame, from where the origin of the frame is linked.
        """
        cells, links = self._cells, self._links
        top = cells.top(self.config.views.linked_share)
        seen_from = cells.cells[top]
        if any(offset):
            seen_from = cells.moved(seen_from, before((0.0, 0.0, 0.0), offset))
        peak = int(seen_from[np.argmax(cells.activity[top])])
        if not links.leads_near(view, peak, cells.shape):
            links.remember(view, seen_from, active * cells.activity[top], self._way)

    def _experience_scene(self, view: int) -> None:
        """Find the active experience of a scene, or make one, and learn how it was reached."""
        packet, place = self._cells.packet, self._place
        found = self._map.active(view, packet)
        table = self._map.experiences
        if found == place and found >= 0:
            table["way"][found] = self._way
        # Without a view nothing tells apart what shares pose cells.
        elif found < 0 or view == NO_VIEW:
            self._enter(self._add(view), (0.0, 0.0, 0.0), is_new=True)
        else:
            # Where the robot is in it the pose cells tell.
            offset = self._cells.offset(*table["cell"][found].tolist())
            self._enter(found, motion_of(offset.tolist()), is_new=False)

    def _look(self, laser: LaserScan) -> list[Sighting]:
        """Take in a scan: how the robot moved, and which views are seen."""
        experiences, panoramas, place = self._map, self._panoramas, self._place
        start = before(self._here, self._since)
        self._since, self._here = panoramas.look(laser, self._since, place, start)
        if place < 0:
            return []
        poses = experiences.poses
        believed = self._believed
        apart = np.hypot(*(poses[:, :2] - believed[:2]).T)
        near = np.argsort(apart)[:_EXPECTED]
        expected = [
            (int(view), motion_of(relative(poses[view], believed).tolist()))
            for view in near[apart[near] < self.config.panoramas.near]
        ]
        return panoramas.sightings(expected, self._links.linked(experiences.count))

    def _inject(self, sightings: Sequence[Sighting]) -> Injection:
        """Let the views that are seen inject activity where the robot is by each of them.

        A view that is one of many injects less. So does one that is farther from where the robot
        is believed to be than the odometer's errors since it was last seen explain.
        """
        links, cells, config = self._links, self._cells, self.config.panoramas
        weights = [
            (seen.score - config.least) / (1.0 - config.least) * self._plausible(seen)
            for seen in sightings
        ]
        total = sum(weights)
        injected: list[Injection] = [(np.zeros(0, np.int64), np.zeros(0))]
        for seen, weight in zip(sightings, weights, strict=True):
            active = links.activate(seen.view, self._iteration)
            if weight > 0.0:
                linked, amounts = links.injection(seen.view, active * weight * weight / total)
                # The network moves with the robot only after this.
                injected.append((cells.moved(linked, before(seen.offset, self._since)), amounts))
        return tuple(np.concatenate(parts) for parts in zip(*injected, strict=True))  # type: ignore[return-value]

    def _plausible(self, seen: Sighting) -> float:
        """How likely the odometer is so wrong, from 0 to 1."""
        config, table = self.config.panoramas, self._map.experiences
        way = self._way - float(table["way"][seen.view])
        pose = compose(self._map.poses[seen.view], np.array(seen.offset))
        x, y, turn = relative(self._believed, pose).tolist()
        spread, turn_spread = (
            config.spread + config.drift * way,
            (config.turn_spread + config.turn_drift * way),
        )
        return math.exp(
            -0.5 * ((x * x + y * y) / spread**2 + (nearest_turn(turn) / turn_spread) ** 2)
        )

    def _experience(self, sightings: Sequence[Sighting]) -> None:
        """Find the active experience of the views that are seen, or make one with a view.

        A view and its experience have the same number, and one frame. The experience is active
        where the packet lies where the view says, and the robot in the experience's zone:
        whichever way it looks.
        """
        config, table, place = self.config.experiences, self._map.experiences, self._place
        active, most = -1, 0.0
        offset: Motion = (0.0, 0.0, 0.0)
        sees_place = False
        for seen in sightings:
            if seen.score < config.certain:
                continue
            sees_place |= seen.view == place
            x, y, turn = self._cells.offset(*table["cell"][seen.view].tolist()).tolist()
            off = math.hypot(x - seen.offset[0], y - seen.offset[1]) / config.radius
            turned = abs(nearest_turn(turn - seen.offset[2])) / config.turn
            away = math.hypot(*seen.offset[:2]) / config.radius
            if max(off, turned, away) >= 1.0:
                continue
            energy = seen.score * ((1.0 - away) + (1.0 - turned))  # Eq. (9).
            if energy > most:
                active, most, offset = seen.view, energy, seen.offset
        if active == place and active >= 0:
            table["way"][active] = self._way
            return
        is_new = active < 0
        if is_new:
            if sees_place and math.hypot(*self._here[:2]) < config.spacing:
                return
            active = self._add(self._panoramas.learn())
        self._view = active
        self._enter(active, offset, is_new=is_new)
        self._associate(active, 1.0, offset)

    def _add(self, view: int) -> int:
        """Make an experience where the robot is; while that is doubted, by the odometer alone."""
        doubt, base, pose = self._doubt, self._place, self._here
        if doubt.anchor >= 0:
            base, pose = doubt.anchor, doubt.since
        if base >= 0:
            pose = after(motion_of(self._map.poses[base].tolist()), pose)
        self._updates += 1
        return self._map.add(pose, self._cells.packet, view, 0.0, self._history.count)

    def _enter(self, experience: int, offset: Motion, *, is_new: bool) -> None:
        """Be in another experience, and learn the transition to it.

        Args:
            experience: Which.
            offset: The robot in its frame.
            is_new: Whether it was made now.
        """
        table, place = self._map.experiences, self._place
        is_earlier = self._way - table["way"][experience] >= self.config.experiences.apart
        recognised = is_earlier and not is_new
        self._matched = int(table["reading"][experience]) if recognised else -1
        if place >= 0:
            motion = before(self._here, offset)
            time, steps = self._stamp - self._left_at, self._iteration - self._left_in
            transition = Transition(place, experience, motion, time, steps)
            needed = self.config.experiences.confirmations
            for each in self._doubt.take(
                transition, self._stamp, self._iteration, needed, is_new=is_new
            ):
                self._connect(each)
        table["way"][experience] = self._way
        self._place, self._here = experience, offset
        self._left_at, self._left_in = self._stamp, self._iteration
        self._visits.append(place=experience)
        self._version += 1

    def _begin_doubt(self) -> None:
        """The robot was re-localised. If it was doubted where it is, it is back at the anchor."""
        doubt = self._doubt
        if doubt.anchor >= 0:
            self._place, self._here = doubt.anchor, doubt.since
            self._left_at, self._left_in = doubt.left_at, doubt.left_in
        doubt.begin(self._place, self._here, self._left_at, self._left_in, self._map.count)

    def _connect(self, transition: Transition) -> None:
        """Learn a transition."""
        source, target, motion, time, steps = transition
        # Scans have taken the odometer's bias out already.
        bias = self._bias.rate if self.config.sees == "scenes" else 0.0
        if self._map.connect(source, target, motion, time, bias, steps):
            self._updates += 1

    @property
    def _believed(self) -> Pose:
        """The robot's pose in the map."""
        if self._place < 0:
            return np.zeros(3)
        return compose(self._map.poses[self._place], np.array(self._here))

    @property
    def estimate(self) -> Estimate:
        """Where the robot is in the map of experiences; home is where it began."""
        return Estimate(
            pose=self._believed,
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
        return map_layers(self._map, self._visits.rows("place"), self._place)

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
        self._since, self._here = motion_of(motions[:3]), motion_of(motions[3:])
        self._cells.packet = Packet(*state["packet"].tolist())
        self._cells.cells = state["active_cells"].copy()
        self._cells.activity = state["activity"].copy()
        self._history.restore("history", state)
        self._visits.restore("visits", state)
        for part in self._parts:
            part.restore(state)
