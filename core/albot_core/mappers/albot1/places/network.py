"""The network of places: remembering places visited (algorithms 5 and 7).

`PlaceNetwork.remember_place` is the algorithm. `recognition` recognises a place by its appearance
(algorithms 6 and 8), and `merging` merges two places.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from itertools import groupby, pairwise

import numpy as np
from jaxtyping import Bool, Int64

from albot_core.geometry.poses import (
    compose,
    inverse,
    relative,
    transform_points,
    transform_segments,
    wrap_angle,
)
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.perceptual_map.frames import relative_pose
from albot_core.mappers.albot1.places.events import Event, EventKind, EventLog
from albot_core.mappers.albot1.places.hypothesis import Hypothesis
from albot_core.mappers.albot1.places.network_view import Network
from albot_core.mappers.albot1.places.place import (
    LearnedExit,
    LearnedPlace,
    Line,
    Lines,
    direction,
    drift_after,
    in_frame,
    middle,
    reversed_line,
)
from albot_core.mappers.albot1.trail.breadcrumbs import Breadcrumbs

NO_LINES: Lines = np.empty((0, 4))
START = 0
"""The id of the place that the robot set out from; a place merged with it gets its id."""
STRAIGHT = np.radians(20.0)
"""An exit fixes the place behind it only if its direction is known to within this angle (rad)."""


class PlaceNetwork:
    """The places that one robot has visited and the exits between them.

    The perceptual map drifts as it grows. So places have a frame of their own, the graph frame: the
    map's frame as it was when they were learned. The map-to-graph transform is the present pose of
    the graph frame in the map, according to the present place. It is reset when a known place is
    entered or recognised: this is the alignment of algorithms 7 and 8.

    Args:
        config: The thresholds.
        breadcrumbs: Unused breadcrumbs, whose arrays this network uses again.
    """

    def __init__(self, config: PlacesConfig, breadcrumbs: Breadcrumbs | None = None) -> None:
        self.config = config
        self.map_to_graph: Pose = np.zeros(3)
        """The pose of the graph frame in the map's frame."""
        self.places: dict[int, LearnedPlace] = {START: LearnedPlace(id=START, frame=np.zeros(3))}
        self.current = START
        self.lost_since = 0
        """The first visit since the robot was carried away, as long as it is lost; else 0."""
        self.hypotheses: tuple[Hypothesis, ...] = ()
        """The robot's possible positions, as last weighed; empty unless it is lost. Not stored."""
        self.first_look: np.ndarray | None = None
        """Where a lost robot has recognised a place, but not yet believed it (6,): the pose of the
        graph frame in the map by that, and the robot's pose in the map; None for nowhere."""
        self.version = 0
        """Number that grows with every change."""
        self.log = EventLog(config.max_events, START)
        self.breadcrumbs = breadcrumbs or Breadcrumbs()
        self.breadcrumbs.clear()
        self.breadcrumbs.drop(START, np.zeros(3), np.empty((0, 4)))
        self.next_id = 1
        self.leg_start: Points = np.zeros(2)
        """The position where the robot last crossed an exit, or the map was last aligned (map
        frame, m)."""
        self.way_before = 0.0
        """Length of the travel from the last alignment to `leg_start`, in straight legs (m)."""
        self.compared_from: Pose = np.full(3, np.nan)
        """The robot's pose at the last comparison in its present visit; NaN before the first."""
        # For each visit, counted from 1: its place, and its map-to-graph transform.
        self.visits: list[int] = [-1, START]
        self.visit_transforms: list[Pose] = [np.zeros(3), np.zeros(3)]
        self.reading = 0
        """The number of the present reading."""
        # For each stay in a place, in order: its first reading, and the place. No stay is
        # forgotten.
        self.stays: list[tuple[int, int]] = [(0, START)]

    @property
    def here(self) -> LearnedPlace:
        """The place in which the robot believes to be."""
        return self.places[self.current]

    def match_reading(self, pose: Pose) -> int | None:
        """Return the earlier reading that was taken nearest to the robot's position, in its place.

        It is a reading of an earlier stay at which a breadcrumb was dropped; if none of these is
        left, the reading halfway through the first stay.

        Args:
            pose: The robot's pose in the map.

        Returns:
            The number of the reading; None if the robot has not been in the present place before.
        """
        if not self.is_familiar:
            return None
        crumbs = self.breadcrumbs
        earlier = (crumbs.places == self.current) & (crumbs.readings < self.stays[-1][0])
        if earlier.any():
            away = crumbs.points - self.in_graph_frame(pose)[:2]
            squares = np.where(earlier, (away * away).sum(axis=1), np.inf)
            return int(crumbs.readings[np.argmin(squares)])
        for (first, place), (after, _) in pairwise(self.stays):
            if place == self.current:
                return (first + after) // 2
        return None

    def place_at(self, reading: int) -> int:
        """Return the id of the place where a reading was taken, by present belief."""
        return self.stays[bisect_right(self.stays, reading, key=lambda stay: stay[0]) - 1][1]

    @property
    def is_familiar(self) -> bool:
        """Whether the present place was known before the present visit."""
        return self.current in self.visits[:-1]

    @property
    def frame(self) -> Pose:
        """The pose of the present place's frame in the perceptual map."""
        return compose(self.map_to_graph, self.here.frame)

    @property
    def home(self) -> Pose:
        """The pose from which the robot set out, in the perceptual map's present frame."""
        return compose(self.map_to_graph, self.places[START].frame)

    @property
    def predicted_exits(self) -> Segments:
        """The exits of the present place, aligned: their expected positions in the map (m)."""
        return transform_segments(self.frame, self.here.exit_lines)

    def in_graph_frame(self, pose: Pose) -> Pose:
        """Return a pose of the map in the graph frame; compiled, as every breadcrumb needs it."""
        here = np.empty(3)
        relative_pose(self.map_to_graph, pose, here)
        return here

    def drop_breadcrumb(self, pose: Pose, walls: Segments) -> None:
        """Drop a breadcrumb at a pose of the map, with the given surfaces in view (m)."""
        here = self.in_graph_frame(pose)
        self.breadcrumbs.drop(self.current, here, walls, self.reading)

    def snapshot(self) -> Network:
        """Return the network as users see it."""
        visits = Counter(place for place, _ in groupby(place for _, place in self.stays))
        places = tuple(self.places[key].as_place(visits[key]) for key in sorted(self.places))
        return Network(
            places=places,
            current=self.current,
            home=START,
            familiar=self.is_familiar,
            frame=self.map_to_graph.copy(),
        )

    def drift_at(self, pose: Pose) -> float:
        """Return how far from its expected position a known exit may be seen from a pose (m)."""
        return drift_after(self._way_to(pose) if self.config.expects_drift else 0.0)

    def _way_to(self, pose: Pose) -> float:
        """Return the length of the travel since the last alignment, in straight legs (m)."""
        return self.way_before + float(np.hypot(*(pose[:2] - self.leg_start)))

    def begin_leg(self, pose: Pose, is_aligned: bool) -> None:
        """Begin a leg at a pose where the robot crosses an exit, or where the map is aligned."""
        self.way_before = 0.0 if is_aligned else self._way_to(pose)
        self.leg_start = pose[:2].copy()

    def remember_place(
        self,
        step: int,
        line: Line,
        seen: Segments,
        pose: Pose,
        exits: Lines = NO_LINES,
    ) -> None:
        """Remember the place that the robot leaves by crossing an exit (algorithms 5 and 7).

        Args:
            step: The view at which the exit was crossed.
            line: The exit, with the place that the robot left to its left, in the map's frame (m).
            seen: The surfaces of the map that were seen in the visit that ends (m).
            pose: The robot's pose in the map.
            exits: The remembered exits that the robot has seen, in the map's frame (n, 4; m).
        """
        local = in_frame(self.frame, line[None])[0]
        drift = self.drift_at(pose)
        others = in_frame(self.frame, exits)
        known = self.here.likeliest_exit(local, others, drift)  # Alg. 5, line 13
        if known is None:
            unseen = self._unnoticed(line, drift)
            if unseen is not None:
                self._return(step, unseen, line, pose)
                return
        left = self._close(seen)  # Alg. 5, lines 2 to 6 and 11
        if known is None:
            entered = self._new_place(pose)  # Alg. 5, lines 8, 9 and 15
            left.exits.append(LearnedExit(line=local, leads_to=entered.id, exit_there=0))  # line 7
            in_graph = in_frame(self.map_to_graph, reversed_line(line)[None])
            there = in_frame(entered.frame, in_graph)[0]
            entered.exits.append(
                LearnedExit(line=there, leads_to=left.id, exit_there=len(left.exits) - 1)
            )
            what, gap = EventKind.NEW, 0.0
        else:
            door = left.exits[known]
            entered = self.places[door.leads_to]
            self._align(door, line)  # Alg. 7, line 13
            gap = float(np.hypot(*(middle(door.line) - middle(local))))
            what = EventKind.ENTERED
        self.begin_leg(pose, is_aligned=known is not None)
        self.log.add(Event(step=step, kind=what, place=left.id, other=entered.id, gap=gap))
        self._begin_visit(entered.id)

    def _unnoticed(self, line: Line, drift: float) -> LearnedExit | None:
        """Return the exit that the robot comes out of if it had entered the next place unnoticed.

        This is ours: in the thesis an exit that is not known leads to a new place (algorithm 5,
        lines 8 and 9). A neighbouring place is aligned at the exit that joins it to the present
        one.
        """
        if not self.config.mends_missed_crossings:
            return None
        local = in_frame(self.frame, line[None])[0]
        back = self.here.likeliest_exit(reversed_line(local), NO_LINES, drift)
        if back is not None:
            return self._partner(self.here.exits[back])
        for door in self.here.exits if self.config.expects_drift else ():
            other = self.places[door.leads_to]
            frame = compose(self.map_to_graph, other.frame)
            there = transform_points(frame, middle(self._partner(door).line))
            frame[:2] += transform_points(self.frame, middle(door.line)) - there
            found = other.exit_at(in_frame(frame, line[None])[0])
            if found is not None:
                return other.exits[found]
        return None

    def _partner(self, door: LearnedExit) -> LearnedExit:
        """Return the same exit as the place behind it describes it."""
        return self.places[door.leads_to].exits[door.exit_there]

    def _return(self, step: int, door: LearnedExit, line: Line, pose: Pose) -> None:
        """Enter the place behind `door`, an exit of a place that the robot had entered unnoticed.

        This is ours. The surfaces seen since the robot last crossed an exit belong to both places
        and cannot be told apart, so they are added to neither description. The return makes the
        place a known one.
        """
        self.visit_transforms[-1] = self.map_to_graph
        out_of = self._partner(door).leads_to
        if door.leads_to != self.current:
            entered = compose(self.map_to_graph, self.places[door.leads_to].frame)
            self._lay(transform_points(entered, middle(self._partner(door).line)), middle(line))
        self.begin_leg(pose, is_aligned=door.leads_to != self.current)
        back = Event(step=step, kind=EventKind.RETURNED, place=door.leads_to, other=out_of)
        self.log.add(back)
        self._begin_visit(door.leads_to)

    def start_anew(self, step: int, seen: Segments, pose: Pose) -> None:
        """Start a new place without exits, because the robot is not where it believed to be.

        The arguments are those of `remember_place`.
        """
        left = self._close(seen)
        unknown = self._new_place(pose)
        self.begin_leg(pose, is_aligned=True)
        lost = Event(step=step, kind=EventKind.LOST, place=left.id, other=unknown.id)
        self.log.add(lost)
        self.breadcrumbs.break_off()
        self._begin_visit(unknown.id)
        self.first_look = None
        if not self.lost_since:
            self.lost_since = len(self.visits) - 1

    def resume(self, seen: Segments, pose: Pose, place: int | None) -> None:
        """Leave the present place without crossing an exit, and begin a visit at another pose.

        Args:
            seen: The surfaces of the map that were seen in the visit that ends (m).
            pose: The robot's pose in the map.
            place: The id of the place there; None for a new one.
        """
        self._close(seen)
        entered = self._new_place(pose).id if place is None else place
        self.begin_leg(pose, is_aligned=True)
        self.breadcrumbs.break_off()
        self.lost_since, self.hypotheses = 0, ()
        self._begin_visit(entered)

    def _close(self, seen: Segments) -> LearnedPlace:
        """Add what was seen to the description of the present place, which the robot leaves."""
        left = self.here
        left.describe(in_frame(self.frame, seen), self.config)
        self.visit_transforms[-1] = self.map_to_graph
        return left

    def _new_place(self, pose: Pose) -> LearnedPlace:
        place = LearnedPlace(id=self.next_id, frame=relative(self.map_to_graph, pose))
        self.places[place.id] = place
        self.next_id += 1
        return place

    def _begin_visit(self, place: int) -> None:
        self.current = place
        self.compared_from = np.full(3, np.nan)
        self.visits.append(place)
        self.stays.append((self.reading, place))
        self.visit_transforms.append(self.map_to_graph)
        self.version += 1

    def keep_visits(self, wanted: Bool[np.ndarray, "visits"]) -> Int64[np.ndarray, "visits"]:
        """Forget all visits except those wanted and those that the network needs.

        The network needs the first visit to each place, the one since which the robot is lost, and
        the present one.

        Returns:
            The new number of each visit, -1 if it is forgotten.
        """
        kept = wanted.copy()
        kept[[0, self.lost_since, -1]] = True
        kept[[self.visits.index(place) for place in self.places if place in self.visits]] = True
        numbers = np.where(kept, np.cumsum(kept) - 1, -1)
        self.visits = [self.visits[k] for k in np.flatnonzero(kept)]
        self.visit_transforms = [self.visit_transforms[k] for k in np.flatnonzero(kept)]
        self.lost_since = int(numbers[self.lost_since])
        return numbers

    def _align(self, door: LearnedExit, line: Line) -> None:
        """Align the place behind an exit of the present one at that exit (algorithm 7, line 13)."""
        if self.config.aligns_by_exit_seen:
            self._align_by_exit_seen(door, line)
        else:
            self._align_by_exit_known(door, line)

    def _align_by_exit_seen(self, door: LearnedExit, line: Line) -> None:
        """Lay the next place so that its exit is the exit just crossed, as it is seen."""
        entered = self.places[door.leads_to]
        seen, known = reversed_line(line), self._partner(door).line
        frame = np.array([0.0, 0.0, direction(seen) - direction(known)])
        frame[:2] = middle(seen) - transform_points(frame, middle(known))
        self.map_to_graph = compose(frame, inverse(entered.frame))

    def _align_by_exit_known(self, door: LearnedExit, line: Line) -> None:
        """Lay the next place at the exit that both places remember, without a turn.

        This is ours. The thesis takes the exit seen as the reference for position and direction.
        But a doorway seen in passing gives its direction only to about 10°, and its position to the
        thickness of the wall, because it is seen from either side; with something beside it, only
        to half its width. So the two places are aligned by what both remember of their exit, and
        the exit seen counts only if its direction is about the remembered one. A map that is about
        right is not changed.
        """
        entered = self.places[door.leads_to]
        frame = compose(self.map_to_graph, entered.frame)
        at = transform_points(frame, middle(self._partner(door).line))
        mine = transform_segments(self.frame, door.line[None])[0]
        targets = [middle(mine)]
        if abs(wrap_angle(direction(line) - direction(mine))) < STRAIGHT:
            targets.append(middle(line))
        for target in targets:
            at = self._lay(at, target)

    def _lay(self, at: Points, target: Points) -> Points:
        """Translate the graph frame so that a point of the map comes to lie at the target.

        Returns:
            The point's new position: unchanged if it is within the tolerance.
        """
        if np.hypot(*(target - at)) < self.config.tolerance:
            return at
        self.map_to_graph = self.map_to_graph + np.array([*(target - at), 0.0])
        return target
