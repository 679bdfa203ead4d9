"""The network of places: remembering places visited (algorithms 5 and 7), and merging them.

`PlaceNetwork.remember_place` is the algorithm. Recognising a place by what it looks like
(algorithms 6 and 8) is in `recognition`.
"""

from __future__ import annotations

from bisect import bisect_right
from itertools import pairwise

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
from albot_core.geometry.types import Pose, Segments
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.perceptual_map.frames import relative_pose
from albot_core.mappers.albot1.places.events import Event, EventKind, EventLog
from albot_core.mappers.albot1.places.network_view import Network
from albot_core.mappers.albot1.places.place import (
    LearnedExit,
    LearnedPlace,
    Line,
    direction,
    in_frame,
    middle,
    reversed_line,
)
from albot_core.mappers.albot1.trail.breadcrumbs import Breadcrumbs

START = 0
"""The id of the place that the robot set out from; a place found to be it becomes it."""
STRAIGHT = np.radians(20.0)
"""An exit is seen well enough to lay a place at it if it is turned less than this (rad)."""


class PlaceNetwork:
    """The places that one robot has visited and the exits between them.

    The perceptual map drifts as it grows. So places stand in a frame of their own, the graph
    frame: the map's as it was when they were learned. The map-to-graph transform says where the
    graph frame lies in the map now, as far as the present place tells. It is set anew when a
    known place is entered or recognised: this is the alignment of algorithms 7 and 8.

    Args:
        config: The thresholds.
        breadcrumbs: Breadcrumbs no longer needed, whose arrays this network uses again.
    """

    def __init__(self, config: PlacesConfig, breadcrumbs: Breadcrumbs | None = None) -> None:
        self.config = config
        self.map_to_graph: Pose = np.zeros(3)
        """The pose of the graph frame in the map's frame."""
        self.places: dict[int, LearnedPlace] = {START: LearnedPlace(id=START, frame=np.zeros(3))}
        self.current = START
        self.lost_since = 0
        """The visit that began where the robot was carried to, as long as it is lost; else 0."""
        self.version = 0
        """Grows with every change."""
        self.log = EventLog(config.max_events, START)
        self.breadcrumbs = breadcrumbs or Breadcrumbs()
        self.breadcrumbs.clear()
        self.breadcrumbs.drop(START, np.zeros(3), np.empty((0, 4)))
        self.next_id = 1
        self.compared_from: Pose = np.full(3, np.nan)
        """Where the robot was at the last comparison in its present visit; NaN before the first."""
        # Of each visit, counted from 1: its place, and the map-to-graph transform then.
        self.visits: list[int] = [-1, START]
        self.visit_transforms: list[Pose] = [np.zeros(3), np.zeros(3)]
        self.reading = 0
        """The number of the reading that is being taken in."""
        # Of each stay in a place, in order: its first reading, and the place. None is forgotten.
        self.stays: list[tuple[int, int]] = [(0, START)]

    @property
    def here(self) -> LearnedPlace:
        """The place that the robot believes to be in."""
        return self.places[self.current]

    def match_reading(self, pose: Pose) -> int | None:
        """The earlier reading that was taken nearest to where the robot is, in the same place.

        It is one at which a breadcrumb was dropped on an earlier stay; where none of them is left,
        one halfway through the first stay.

        Args:
            pose: Where the robot is in the map.

        Returns:
            Its number; None where the robot has not been in the present place before.
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
        """Id of the place where a reading was taken, as it believes now."""
        return self.stays[bisect_right(self.stays, reading, key=lambda stay: stay[0]) - 1][1]

    @property
    def is_familiar(self) -> bool:
        """Whether the present place was known before the present visit."""
        return self.current in self.visits[:-1]

    @property
    def frame(self) -> Pose:
        """Where the present place's frame lies in the perceptual map."""
        return compose(self.map_to_graph, self.here.frame)

    @property
    def home(self) -> Pose:
        """Where the robot set out, in the perceptual map's frame as it is now."""
        return compose(self.map_to_graph, self.places[START].frame)

    @property
    def predicted_exits(self) -> Segments:
        """The exits of the present place, aligned: where they should be in the map (m)."""
        lines = [door.line for door in self.here.exits]
        return transform_segments(self.frame, np.reshape(lines, (-1, 4)))

    def in_graph_frame(self, pose: Pose) -> Pose:
        """A pose in the map, in the graph frame. Compiled: every breadcrumb asks for it."""
        here = np.empty(3)
        relative_pose(self.map_to_graph, pose, here)
        return here

    def drop_breadcrumb(self, pose: Pose, walls: Segments) -> None:
        """Note that the robot has come to a pose in the map, with these surfaces in view (m)."""
        here = self.in_graph_frame(pose)
        self.breadcrumbs.drop(self.current, here, walls, self.reading)

    def snapshot(self) -> Network:
        """The network as users see it."""
        places = tuple(self.places[key].as_place() for key in sorted(self.places))
        return Network(places=places, current=self.current, home=START, familiar=self.is_familiar)

    def remember_place(self, step: int, line: Line, seen: Segments, pose: Pose) -> None:
        """Remember the place that is left as an exit is crossed (algorithms 5 and 7).

        Args:
            step: The view at which it was.
            line: The exit, with the place that was left to its left, in the map's frame (m).
            seen: The surfaces of the map that were seen in the visit that ends (m).
            pose: Where the robot is in the map.
        """
        local = in_frame(self.frame, line[None])[0]
        unseen = self.here.exit_at(reversed_line(local))
        if unseen is not None:
            self._return(step, self.here.exits[unseen])
            return
        left = self._close(seen)  # Alg. 5, lines 2 to 6 and 11
        known = left.exit_at(local)  # Alg. 5, line 13
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
        self.log.add(Event(step=step, kind=what, place=left.id, other=entered.id, gap=gap))
        self._begin_visit(entered.id)

    def _return(self, step: int, door: LearnedExit) -> None:
        """The robot comes into the place that it believed to be in, which it had left unnoticed.

        This is ours. What it has seen since it last crossed an exit is of both places and cannot
        be told apart, so neither is described by it. Its coming back makes the place a known one.
        """
        self.visit_transforms[-1] = self.map_to_graph
        back = Event(step=step, kind=EventKind.RETURNED, place=self.current, other=door.leads_to)
        self.log.add(back)
        self._begin_visit(self.current)

    def start_anew(self, step: int, seen: Segments, pose: Pose) -> None:
        """Start anew, in a new place without exits: the robot is not where it believes to be.

        The arguments are those of `remember_place`.
        """
        left = self._close(seen)
        unknown = self._new_place(pose)
        lost = Event(step=step, kind=EventKind.LOST, place=left.id, other=unknown.id)
        self.log.add(lost)
        self.breadcrumbs.break_off()
        self._begin_visit(unknown.id)
        if not self.lost_since:
            self.lost_since = len(self.visits) - 1

    def _close(self, seen: Segments) -> LearnedPlace:
        """Combine what was seen with the description of the present place, and leave it."""
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
        """Forget all visits but those wanted, and those that the network needs.

        These are the first to each place, that from which on the robot is lost, and the present
        one.

        Returns:
            The new number of each visit, -1 where it is forgotten.
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
        """Lay the place behind an exit of the present one at it (algorithm 7, line 13).

        The thesis takes the exit seen as the reference for position and direction. A doorway
        seen in passing gives its direction to some 10° only, and its place to the thickness of
        the wall, for it is seen from either side; with something beside it, to half its
        width. So the two places are laid together by what both remember of their exit, and the
        exit seen counts only where it lies in the direction remembered. Where the map is about
        right it is left alone.
        """
        entered = self.places[door.leads_to]
        frame = compose(self.map_to_graph, entered.frame)
        at = transform_points(frame, middle(entered.exits[door.exit_there].line))
        mine = transform_segments(self.frame, door.line[None])[0]
        targets = [middle(mine)]
        if abs(wrap_angle(direction(line) - direction(mine))) < STRAIGHT:
            targets.append(middle(line))
        for target in targets:
            if np.hypot(*(target - at)) >= self.config.tolerance:
                self.map_to_graph = self.map_to_graph + np.array([*(target - at), 0.0])
                at = target

    def merge_here(self, step: int, other: LearnedPlace, pose: Pose) -> None:
        """Merge the present place with another, whose frame lies at `pose` in the map."""
        here, frame = self.here, self.frame
        if other.id < here.id:
            self.map_to_graph = compose(pose, inverse(other.frame))
            merge_places(self, step, other, here, relative(pose, frame))
        else:
            merge_places(self, step, here, other, relative(frame, pose))
        self.version += 1


def merge_places(
    network: PlaceNetwork, step: int, kept: LearnedPlace, gone: LearnedPlace, pose: Pose
) -> None:
    """Make two places one; `pose` is where the frame of the one gone lies in the other's.

    An exit that both have leads to one place. If they have it lead to two, these are one as well
    (Alg. 5, lines 12 and 13).
    """
    kept.describe(transform_segments(pose, gone.surfaces), network.config)
    first = len(kept.exits)
    for door in gone.exits:
        door.line = transform_segments(pose, door.line[None])[0]
        kept.exits.append(door)
    for place in network.places.values():
        for door in place.exits:
            if door.leads_to == gone.id:
                door.leads_to, door.exit_there = kept.id, door.exit_there + first
    _replace_place(network, gone, kept, pose)
    while kept.id in network.places and _unite_exits(network, step, kept):
        pass


def _replace_place(
    network: PlaceNetwork, gone: LearnedPlace, kept: LearnedPlace, pose: Pose
) -> None:
    """Let all that refers to the place gone refer to the one kept."""
    del network.places[gone.id]
    # Where the frame of the one kept lay in the visits to the one gone.
    moved = compose(compose(gone.frame, inverse(pose)), inverse(kept.frame))
    network.breadcrumbs.move(network.breadcrumbs.places == gone.id, inverse(moved), kept.id)
    network.stays = [
        (first, kept.id if place == gone.id else place) for first, place in network.stays
    ]
    for visit, place in enumerate(network.visits):
        if place == gone.id:
            network.visits[visit] = kept.id
            network.visit_transforms[visit] = compose(network.visit_transforms[visit], moved)
    network.current = kept.id if network.current == gone.id else network.current


def _unite_exits(network: PlaceNetwork, step: int, place: LearnedPlace) -> bool:
    """Make two exits of a place one that lie at one spot. Returns whether there were such."""
    for later, door in enumerate(place.exits):
        earlier = place.exit_at(door.line, later)
        if earlier is None:
            continue
        mine = place.exits[earlier]
        if mine.leads_to == door.leads_to:
            _drop_exit(network, network.places[door.leads_to], door.exit_there)
            _drop_exit(network, place, later)
            return True
        if not _are_joined(network, mine.leads_to, door.leads_to):
            _merge_behind(network, step, mine, door)
            return True
    return False


def _drop_exit(network: PlaceNetwork, place: LearnedPlace, index: int) -> None:
    """Take an exit out of a place's list; those after it move up, also for their partners."""
    del place.exits[index]
    for moved in place.exits[index:]:
        network.places[moved.leads_to].exits[moved.exit_there].exit_there -= 1


def _merge_behind(network: PlaceNetwork, step: int, mine: LearnedExit, theirs: LearnedExit) -> None:
    """Merge the two places that one exit turned out to lead to."""
    first, second = sorted((mine, theirs), key=lambda door: door.leads_to)
    kept, gone = network.places[first.leads_to], network.places[second.leads_to]
    turn = gone.frame[2] - kept.frame[2]
    pose = np.array([0.0, 0.0, turn])
    there = transform_points(pose, middle(gone.exits[second.exit_there].line))
    pose[:2] = middle(kept.exits[first.exit_there].line) - there
    followed = Event(step=step, kind=EventKind.FOLLOWED, place=gone.id, other=kept.id)
    network.log.add(followed)
    if gone.id == network.current:
        network.map_to_graph = compose(compose(network.frame, inverse(pose)), inverse(kept.frame))
    merge_places(network, step, kept, gone, pose)


def _are_joined(network: PlaceNetwork, one: int, other: int) -> bool:
    """Whether an exit leads from the one place to the other."""
    return any(door.leads_to == other for door in network.places[one].exits)
