"""Albot1's network of places (chapter 4 of the thesis, algorithms 5 to 8)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int32

from albot_core.albot1.config import PlacesConfig
from albot_core.albot1.memory import NEVER
from albot_core.albot1.places import (
    Line,
    Passage,
    Site,
    middle,
    seen_from_frame,
    turned_round,
)
from albot_core.albot1.record import Event, Happening
from albot_core.albot1.structure import Likeness, compare
from albot_core.albot1.trail import Trail
from albot_core.geometry.poses import compose, inverse, relative, transform_points
from albot_core.geometry.poses import transform_segments as transformed
from albot_core.geometry.types import Pose, Segments
from albot_core.topology.network import Network

START = 0
"""The id of the place that the robot set out from; a place found to be it becomes it."""
GLIMPSED = -1
"""Surfaces that must be met again of a place suspected on the other side of an exit: none."""


class PlaceNetwork:
    """The places that one robot has visited and the exits between them.

    The perceptual map drifts as it grows, so places stand in an *enduring* frame, the
    map's as it was when they were learned, and `displacement` says where that frame lies in
    the perceptual map now, as far as the present place tells. It is set anew when a known
    place is entered or recognised: this is the alignment of algorithms 7 and 8.

    Args:
        config: The thresholds.
    """

    def __init__(self, config: PlacesConfig) -> None:
        self.config = config
        self.displacement: Pose = np.zeros(3)
        self.sites: dict[int, Site] = {START: Site(id=START, frame=np.zeros(3))}
        self.current = START
        self.lost_since = 0
        """The visit in which the robot lost its way; 0 where it has not."""
        self.version = 0
        """Grows with every change."""
        self.events: list[Event] = [Event(step=1, what=Happening.SET_OUT, place=START, other=-1)]
        self.trail = Trail()
        self.trail.tread(START, np.zeros(3), np.empty((0, 4)))
        self.came_from = -1
        self.next_id = 1
        self.looked_from: Pose | None = None
        """Where the robot was at the last comparison in its present visit, if there was one."""
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

    def snapshot(self) -> Network:
        """The network as users see it."""
        places = tuple(self.sites[key].as_place() for key in sorted(self.sites))
        return Network(places=places, current=self.current, home=START, familiar=self.is_familiar)

    def suspicions(self) -> Int32[np.ndarray, "visits"]:
        """More than how many surfaces of each visit must be met again to arouse suspicion.

        They are more for a larger place (section 4.1.2). What is met of places that an exit
        joins to the present one is seen through that exit, and they are not the same place.
        A place suspected on this side of the exit just crossed is suspected beyond it, for
        what was met of it there is the map's no more: this is ours. A robot that has lost its
        way may be anywhere.
        """
        glimpsed = self._glimpsed()
        joined = {self.current, *(passage.leads_to for passage in self.here.passages)}
        by_place = {
            key: NEVER if key in joined else self._needed(site, glimpsed)
            for key, site in self.sites.items()
        }
        needed = np.full(len(self.visits), NEVER, np.int32)
        if self.lost_since:
            needed[1:] = GLIMPSED
        else:
            needed[1:-1] = [by_place[place] for place in self.visits[1:-1]]
        return needed

    def _needed(self, site: Site, glimpsed: set[int]) -> int:
        config = self.config
        if site.id in glimpsed:
            return GLIMPSED
        share = round(config.suspicion_share * len(site.surfaces))
        return min(max(share, config.fewest_met), config.most_met)

    def remember_place(self, step: int, line: Line, seen: Segments, pose: Pose) -> None:
        """An exit is crossed (algorithms 5 and 7).

        Args:
            step: The view at which it was.
            line: The exit, with the place that was left to its left, in the map's frame (m).
            seen: The surfaces of the map that were seen in the visit that ends (m).
            pose: Where the robot is in the map.
        """
        left, local = self._close(seen), seen_from_frame(self.frame, line[None])[0]
        known = left.passage_at(local)  # line 13
        if known is None:
            entered = self._new_place(pose)
            left.passages.append(Passage(line=local, leads_to=entered.id, exit_there=0))
            there = seen_from_frame(entered.frame, self._enduring(turned_round(line)))[0]
            entered.passages.append(
                Passage(line=there, leads_to=left.id, exit_there=len(left.passages) - 1)
            )
            self._note(step, Happening.NEW, left.id, entered.id)
        else:
            passage = left.passages[known]
            entered = self.sites[passage.leads_to]
            self._align(entered, passage.exit_there, line)
            gap = float(np.hypot(*(middle(passage.line) - middle(local))))
            self._note(step, Happening.ENTERED, left.id, entered.id, gap=gap)
        self._begin_visit(entered.id, left.id)

    def recognize_place(
        self, step: int, met: Int32[np.ndarray, "visits"], seen: Segments, pose: Pose
    ) -> bool:
        """Enough surfaces of earlier visits were met again (algorithms 6 and 8).

        Args:
            step: The view at which they were.
            met: How many surfaces of each visit were met again in the present one.
            seen: The surfaces of the map that were seen in the present visit (m).
            pose: Where the robot is in the map.

        Returns:
            Whether the present place was found to be that of an earlier visit.
        """
        if not self._looks_again(pose):
            return False
        needed = self.suspicions()
        suspects = np.flatnonzero(met > needed)
        for visit in suspects[np.argsort(-met[suspects], kind="stable")].tolist():
            other = self.sites[self.visits[visit]]
            guess = compose(self.displacements[visit], other.frame)
            likeness = compare(seen, other.surfaces, guess, pose, self.config.alike)
            accepted = self._is_confirmed(likeness, other, pose)
            what = Happening.RECOGNIZED if accepted else Happening.REFUSED
            counts = {"met": int(met[visit]), "needed": int(needed[visit])}
            self._explain(step, what, other.id, likeness, **counts)
            if accepted:
                self._identify(step, other, self._settled(guess, likeness, seen, other, pose))
                return True
        return False

    def lose(self, step: int, seen: Segments, pose: Pose) -> None:
        """The robot is not where it believes to be: it begins anew, in a place without exits.

        The arguments are those of `remember_place`.
        """
        left = self._close(seen)
        strange = self._new_place(pose)
        self._note(step, Happening.LOST, left.id, strange.id)
        self.trail.last = -1
        self._begin_visit(strange.id, -1)
        if not self.lost_since:
            self.lost_since = len(self.visits) - 1

    def find(self, step: int, seen: Segments, pose: Pose) -> Pose | None:
        """Look for the present place among all that are known, wherever they may be.

        Returns:
            How the map since the loss must be moved to join on to what was known before;
            None where no place is recognised.
        """
        if not self._looks_again(pose):
            return None
        first = self.visits[self.lost_since]
        known = [site for site in self.sites.values() if site.id < first]
        anywhere = self.config.alike._replace(shift=np.inf, turn=np.pi)
        found = [(site, compare(seen, site.surfaces, self.frame, pose, anywhere)) for site in known]
        confirmed = [
            (site, likeness) for site, likeness in found if self._is_found(likeness, site, pose)
        ]
        if not confirmed:
            return None
        site, likeness = max(confirmed, key=lambda pair: (pair[1].matches, -pair[0].id))
        self._explain(step, Happening.FOUND, site.id, likeness)
        learned = self.displacements[self.visits.index(site.id)]
        motion = compose(compose(learned, site.frame), inverse(likeness.pose))
        for strange in self.sites.values():
            if strange.id >= first:
                frame = compose(motion, compose(self.displacement, strange.frame))
                strange.frame = relative(learned, frame)
        back = compose(relative(learned, motion), self.displacement)
        self.trail.move(self.trail.places >= first, back, None)
        self.displacement, self.lost_since = learned, 0
        self._identify(step, site, compose(motion, likeness.pose))
        return motion

    def _looks_again(self, pose: Pose) -> bool:
        """Whether the robot has gone or turned enough since the last comparison."""
        if self.looked_from is not None:
            x, y, turn = relative(self.looked_from, pose)
            if np.hypot(x, y) < self.config.look_spacing and abs(turn) < self.config.look_turn:
                return False
        self.looked_from = pose.copy()
        return True

    def _glimpsed(self) -> set[int]:
        """Places suspected, but refused, in the visit before the present one to a new place."""
        begun, glimpsed = False, set()
        for event in reversed(self.events):
            if event.what == Happening.REFUSED:
                if begun and event.needed >= 0:
                    glimpsed.add(event.other)
            elif begun or event.what != Happening.NEW:
                break
            else:
                begun = True
        return glimpsed

    def _are_joined(self, one: int, other: int) -> bool:
        """Whether an exit leads from the one place to the other."""
        return any(passage.leads_to == other for passage in self.sites[one].passages)

    def _is_confirmed(self, likeness: Likeness, site: Site, pose: Pose) -> bool:
        """Algorithm 6, line 11: more than 4 surfaces match, on both sides of the robot.

        A place's description holds what is seen through its exits. So we ask as well that
        the robot would stand within the place: otherwise it may be next door.
        """
        config = self.config
        return site.holds(relative(likeness.pose, pose)[:2]) and (
            likeness.matches > config.fewest_matches
            and min(likeness.left, likeness.right) > 0
            and likeness.share >= config.least_share
        )

    def _is_found(self, likeness: Likeness, site: Site, pose: Pose) -> bool:
        """Whether a robot that may be anywhere knows the place again. This is ours."""
        enough = likeness.matches >= self.config.fewest_found
        return enough and self._is_confirmed(likeness, site, pose)

    def _close(self, seen: Segments) -> Site:
        """Combine what was seen with the description of the present place, and leave it."""
        left = self.here
        left.describe(seen_from_frame(self.frame, seen), self.config.alike)
        self.displacements[-1] = self.displacement
        return left

    def _new_place(self, pose: Pose) -> Site:
        site = Site(id=self.next_id, frame=relative(self.displacement, pose))
        self.sites[site.id] = site
        self.next_id += 1
        return site

    def _begin_visit(self, place: int, came_from: int) -> None:
        self.current, self.came_from = place, came_from
        self.looked_from = None
        self.visits.append(place)
        self.displacements.append(self.displacement)
        self.version += 1

    def _enduring(self, line: Line) -> Segments:
        return seen_from_frame(self.displacement, line[None])

    def _align(self, site: Site, door: int, line: Line) -> None:
        """Lay a place at the exit that it shares with the one left (algorithm 7, line 13).

        The thesis takes the exit as the reference for position and direction. A doorway seen
        in passing gives its direction to some 10° only, and its place to the thickness of the
        wall, for it is seen from either side; where the map is about right it is left alone.
        """
        there = transform_points(
            compose(self.displacement, site.frame), middle(site.passages[door].line)
        )
        shift = middle(line) - there
        if np.hypot(*shift) < self.config.agreement:
            return
        self.displacement = self.displacement + np.array([shift[0], shift[1], 0.0])

    def _settled(
        self, believed: Pose, found: Likeness, seen: Segments, other: Site, robot: Pose
    ) -> Pose:
        """Where a recognised place's frame lies: where it was believed to, if that will do.

        An alignment by few surfaces is good to some 40 cm, the map is often better: it is
        corrected only where fewer surfaces are the same without.
        """
        near = self.config.alike._replace(shift=self.config.agreement, turn=np.radians(10.0))
        likeness = compare(seen, other.surfaces, believed, robot, near)
        return believed if likeness.matches >= found.matches - 1 else found.pose

    def _identify(self, step: int, other: Site, pose: Pose) -> None:
        """The present place is the other, whose frame lies at `pose` in the map."""
        here, frame = self.here, self.frame
        if other.id < here.id:
            self.displacement = compose(pose, inverse(other.frame))
            self._merge(step, other, here, relative(pose, frame))
        else:
            self._merge(step, here, other, relative(frame, pose))
        self.version += 1

    def _merge(self, step: int, kept: Site, gone: Site, pose: Pose) -> None:
        """Make two places one; `pose` is where the frame of the one gone lies in the other's.

        An exit that both have leads to one place: if they have it lead to two, these are
        one as well (line 13).
        """
        kept.describe(transformed(pose, gone.surfaces), self.config.alike)
        first = len(kept.passages)
        for passage in gone.passages:
            passage.line = transformed(pose, passage.line[None])[0]
            kept.passages.append(passage)
        for site in self.sites.values():
            for passage in site.passages:
                if passage.leads_to == gone.id:
                    passage.leads_to, passage.exit_there = kept.id, passage.exit_there + first
        self._forget(gone, kept, pose)
        while kept.id in self.sites and self._unite_exits(step, kept):
            pass

    def _forget(self, gone: Site, kept: Site, pose: Pose) -> None:
        """Nothing speaks of a place any more but as of the one that it is."""
        del self.sites[gone.id]
        # In a visit to the one, the other's frame lay where it does from here.
        moved = compose(compose(gone.frame, inverse(pose)), inverse(kept.frame))
        self.trail.move(self.trail.places == gone.id, inverse(moved), kept.id)
        for visit, place in enumerate(self.visits):
            if place == gone.id:
                self.visits[visit] = kept.id
                self.displacements[visit] = compose(self.displacements[visit], moved)
        self.current = kept.id if self.current == gone.id else self.current
        self.came_from = kept.id if self.came_from == gone.id else self.came_from

    def _unite_exits(self, step: int, site: Site) -> bool:
        """Make two exits one that are in one place; false where all are apart."""
        for later, passage in enumerate(site.passages):
            earlier = site.passage_at(passage.line, later)
            if earlier is None:
                continue
            mine = site.passages[earlier]
            if mine.leads_to == passage.leads_to:
                self._drop(self.sites[passage.leads_to], passage.exit_there)
                self._drop(site, later)
                return True
            if not self._are_joined(mine.leads_to, passage.leads_to):
                self._follow_up(step, mine, passage)
                return True
        return False

    def _drop(self, site: Site, door: int) -> None:
        """Take an exit out of a place's list; those behind it move up, and are known so."""
        del site.passages[door]
        for moved in site.passages[door:]:
            self.sites[moved.leads_to].passages[moved.exit_there].exit_there -= 1

    def _follow_up(self, step: int, mine: Passage, theirs: Passage) -> None:
        """Two exits found to be one: what they lead to is one place."""
        first, second = sorted((mine, theirs), key=lambda passage: passage.leads_to)
        kept, gone = self.sites[first.leads_to], self.sites[second.leads_to]
        turn = gone.frame[2] - kept.frame[2]
        pose = np.array([0.0, 0.0, turn])
        there = transform_points(pose, middle(gone.passages[second.exit_there].line))
        pose[:2] = middle(kept.passages[first.exit_there].line) - there
        self._note(step, Happening.FOLLOWED, gone.id, kept.id)
        if gone.id == self.current:
            self.displacement = compose(compose(self.frame, inverse(pose)), inverse(kept.frame))
        self._merge(step, kept, gone, pose)

    def _note(self, step: int, what: Happening, place: int, other: int, gap: float = 0.0) -> None:
        self._add(Event(step=step, what=what, place=place, other=other, gap=gap))

    def _explain(
        self,
        step: int,
        what: Happening,
        other: int,
        likeness: Likeness,
        met: int = 0,
        needed: int = 0,
    ) -> None:
        self._add(
            Event(
                step=step,
                what=what,
                place=self.current,
                other=other,
                met=met,
                needed=needed,
                matches=likeness.matches,
                left=likeness.left,
                right=likeness.right,
                share=likeness.share,
            )
        )

    def _add(self, event: Event) -> None:
        self.events.append(event)
        del self.events[: -self.config.events_kept]
