"""Albot1's network of places (chapter 4 of the thesis, algorithms 5 to 8)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Int64

from albot_core.geometry.poses import compose, inverse, relative, transform_points, wrap_angle
from albot_core.geometry.poses import transform_segments as transformed
from albot_core.geometry.types import Pose, Segments
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.merging import merge
from albot_core.mappers.albot1.places import (
    Line,
    Passage,
    Site,
    direction,
    middle,
    seen_from_frame,
    turned_round,
)
from albot_core.mappers.albot1.recognition import pose_in
from albot_core.mappers.albot1.record import Event, Happening, Record
from albot_core.mappers.albot1.trail.breadcrumbs import Breadcrumbs
from albot_core.maps.place_graph import Network

START = 0
"""The id of the place that the robot set out from; a place found to be it becomes it."""
STRAIGHT = np.radians(20.0)
"""An exit is seen well enough to lay a place at it if it is turned less than this (rad)."""


class PlaceNetwork:
    """The places that one robot has visited and the exits between them.

    The perceptual map drifts as it grows, so places stand in an *enduring* frame, the
    map's as it was when they were learned, and `displacement` says where that frame lies in
    the perceptual map now, as far as the present place tells. It is set anew when a known
    place is entered or recognised: this is the alignment of algorithms 7 and 8.

    Args:
        config: The thresholds.
        breadcrumbs: Breadcrumbs no longer needed, whose arrays this network uses again.
    """

    def __init__(self, config: PlacesConfig, breadcrumbs: Breadcrumbs | None = None) -> None:
        self.config = config
        self.displacement: Pose = np.zeros(3)
        self.sites: dict[int, Site] = {START: Site(id=START, frame=np.zeros(3))}
        self.current = START
        self.lost_since = 0
        """The visit in which the robot lost its way; 0 where it has not."""
        self.version = 0
        """Grows with every change."""
        self.record = Record(config.events_kept, START)
        self.breadcrumbs = breadcrumbs or Breadcrumbs()
        self.breadcrumbs.clear()
        self.breadcrumbs.drop(START, np.zeros(3), np.empty((0, 4)))
        self.next_id = 1
        self.looked_from: Pose = np.full(3, np.nan)
        """Where the robot was at the last comparison in its present visit; NaN before the first."""
        # Of each visit, counted from 1: which place it was to, and the displacement then.
        self.visits: list[int] = [-1, START]
        self.displacements: list[Pose] = [np.zeros(3), np.zeros(3)]

    @property
    def here(self) -> Site:
        """The place that the robot believes to be in."""
        return self.sites[self.current]

    @property
    def is_familiar(self) -> bool:
        """Whether the present place was known before the present visit."""
        return self.current in self.visits[:-1]

    @property
    def frame(self) -> Pose:
        """Where the present place's frame lies in the perceptual map."""
        return compose(self.displacement, self.here.frame)

    @property
    def home(self) -> Pose:
        """Where the robot set out, in the perceptual map's frame as it is now."""
        return compose(self.displacement, self.sites[START].frame)

    @property
    def predicted_exits(self) -> Segments:
        """The exits of the present place, aligned: where they should be in the map (m)."""
        lines = [passage.line for passage in self.here.passages]
        return transformed(self.frame, np.reshape(lines, (-1, 4)))

    def in_graph_frame(self, pose: Pose) -> Pose:
        """A pose in the map, in the enduring frame. Compiled: every breadcrumb asks for it."""
        here = np.empty(3)
        pose_in(self.displacement, pose, here)
        return here

    def drop_breadcrumb(self, pose: Pose, walls: Segments) -> None:
        """Note that the robot has come to a pose in the map, with these surfaces in view (m)."""
        self.breadcrumbs.drop(self.current, self.in_graph_frame(pose), walls)

    def snapshot(self) -> Network:
        """The network as users see it."""
        places = tuple(self.sites[key].as_place() for key in sorted(self.sites))
        return Network(places=places, current=self.current, home=START, familiar=self.is_familiar)

    def remember_place(self, step: int, line: Line, seen: Segments, pose: Pose) -> None:
        """An exit is crossed (algorithms 5 and 7).

        Args:
            step: The view at which it was.
            line: The exit, with the place that was left to its left, in the map's frame (m).
            seen: The surfaces of the map that were seen in the visit that ends (m).
            pose: Where the robot is in the map.
        """
        local = seen_from_frame(self.frame, line[None])[0]
        unseen = self.here.passage_at(turned_round(local))
        if unseen is not None:
            self._return(step, self.here.passages[unseen])
            return
        left = self._close(seen)
        known = left.passage_at(local)  # line 13
        if known is None:
            entered = self._new_place(pose)
            left.passages.append(Passage(line=local, leads_to=entered.id, exit_there=0))
            there = seen_from_frame(entered.frame, self._enduring(turned_round(line)))[0]
            entered.passages.append(
                Passage(line=there, leads_to=left.id, exit_there=len(left.passages) - 1)
            )
            what, gap = Happening.NEW, 0.0
        else:
            passage = left.passages[known]
            entered = self.sites[passage.leads_to]
            self._align(passage, line)
            gap = float(np.hypot(*(middle(passage.line) - middle(local))))
            what = Happening.ENTERED
        self.record.note(Event(step=step, what=what, place=left.id, other=entered.id, gap=gap))
        self._begin_visit(entered.id)

    def _return(self, step: int, passage: Passage) -> None:
        """The robot comes into the place that it believed to be in: it had left it unnoticed.

        This is ours. What it has seen since it last crossed an exit is of both places, and not
        told apart: neither is described by it. That it came back makes the place a known one.
        """
        self.displacements[-1] = self.displacement
        back = Event(step=step, what=Happening.RETURNED, place=self.current, other=passage.leads_to)
        self.record.note(back)
        self._begin_visit(self.current)

    def lose(self, step: int, seen: Segments, pose: Pose) -> None:
        """The robot is not where it believes to be: it begins anew, in a place without exits.

        The arguments are those of `remember_place`.
        """
        left = self._close(seen)
        strange = self._new_place(pose)
        lost = Event(step=step, what=Happening.LOST, place=left.id, other=strange.id)
        self.record.note(lost)
        self.breadcrumbs.break_off()
        self._begin_visit(strange.id)
        if not self.lost_since:
            self.lost_since = len(self.visits) - 1

    def _close(self, seen: Segments) -> Site:
        """Combine what was seen with the description of the present place, and leave it."""
        left = self.here
        left.describe(seen_from_frame(self.frame, seen), self.config)
        self.displacements[-1] = self.displacement
        return left

    def _new_place(self, pose: Pose) -> Site:
        site = Site(id=self.next_id, frame=relative(self.displacement, pose))
        self.sites[site.id] = site
        self.next_id += 1
        return site

    def _begin_visit(self, place: int) -> None:
        self.current = place
        self.looked_from = np.full(3, np.nan)
        self.visits.append(place)
        self.displacements.append(self.displacement)
        self.version += 1

    def keep_visits(self, wanted: Bool[np.ndarray, "visits"]) -> Int64[np.ndarray, "visits"]:
        """Forget all visits but those wanted and those by which it knows its way.

        These are the first to each place, that in which the robot lost its way, and the
        present one.

        Returns:
            The new number of each visit, -1 where it is forgotten.
        """
        kept = wanted.copy()
        kept[[0, self.lost_since, -1]] = True
        kept[[self.visits.index(place) for place in self.sites if place in self.visits]] = True
        numbers = np.where(kept, np.cumsum(kept) - 1, -1)
        self.visits = [self.visits[k] for k in np.flatnonzero(kept)]
        self.displacements = [self.displacements[k] for k in np.flatnonzero(kept)]
        self.lost_since = int(numbers[self.lost_since])
        return numbers

    def _enduring(self, line: Line) -> Segments:
        return seen_from_frame(self.displacement, line[None])

    def _align(self, passage: Passage, line: Line) -> None:
        """Lay the place behind an exit of the present one at it (algorithm 7, line 13).

        The thesis takes the exit seen as the reference for position and direction. A doorway
        seen in passing gives its direction to some 10° only, and its place to the thickness of
        the wall, for it is seen from either side; with something beside it, to half its
        width. So the two places are laid together by what both remember of their exit, and the
        exit seen counts only where it lies in the direction remembered. Where the map is about
        right it is left alone.
        """
        entered = self.sites[passage.leads_to]
        frame = compose(self.displacement, entered.frame)
        at = transform_points(frame, middle(entered.passages[passage.exit_there].line))
        mine = transformed(self.frame, passage.line[None])[0]
        targets = [middle(mine)]
        if abs(wrap_angle(direction(line) - direction(mine))) < STRAIGHT:
            targets.append(middle(line))
        for target in targets:
            if np.hypot(*(target - at)) >= self.config.agreement:
                self.displacement = self.displacement + np.array([*(target - at), 0.0])
                at = target

    def identify(self, step: int, other: Site, pose: Pose) -> None:
        """The present place is the other, whose frame lies at `pose` in the map."""
        here, frame = self.here, self.frame
        if other.id < here.id:
            self.displacement = compose(pose, inverse(other.frame))
            merge(self, step, other, here, relative(pose, frame))
        else:
            merge(self, step, here, other, relative(frame, pose))
        self.version += 1
