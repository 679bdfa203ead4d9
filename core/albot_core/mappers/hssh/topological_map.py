"""One topological map: which visits were to one place, and which gateways a travel joined.

The axioms: a gateway is joined to one other; a path runs through a place once at most; with
`planar`, the map can be drawn in the plane with the gateways of each place in their order (Savelli
and Kuipers, Loop-closing and planarity in topological map-building, IROS 2004).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from albot_core.mappers.hssh.star import Merge, Star, merges

OPEN = (-1, -1)
"""What a gateway is joined to that the robot has not travelled through."""

Gateway = tuple[int, int]
"""A gateway of a map: the place and the gateway's number there."""


class Travel(NamedTuple):
    """One travel action and the place that it led to, as the robot perceived them."""

    left: int
    """The gateway through which it left, counted as at the visit that it left."""
    star: Star
    """The star of the place that it came to."""
    arrived: int
    """The gateway of that star through which it came."""


class Visit(NamedTuple):
    """One visit in a map."""

    place: int
    """The place; places are counted in the order of their first visits."""
    gateways: tuple[int, ...]
    """The gateway of the place that each gateway of the visit's star is."""


Common = tuple[tuple[int, int], ...]
"""The gateways of one visit that are those of another, in pairs."""

Judge = Callable[[int, Common, bool], bool]
"""Whether the latest visit can be to the place that was first visited at a visit, with these common
gateways: the place for evidence besides the stars, such as the local maps. The third argument is
whether the travel closes a loop. Else it follows a way that the map knows; the paper then asks the
star alone."""


def anything(first: int, common: Common, closes_loop: bool) -> bool:
    """Accept every match: the stars alone decide."""
    return True


class TopologicalMap:
    """One map: a leaf of the tree. It is never changed.

    Args:
        firsts: The first visit to each place.
        stars: The star of each place.
        joined: For each place, what each gateway is joined to (`OPEN` if to nothing).
        visits: All visits in order.
        paths: Number of paths.
    """

    __slots__ = ("firsts", "joined", "paths", "stars", "visits")

    def __init__(
        self,
        firsts: tuple[int, ...],
        stars: tuple[Star, ...],
        joined: tuple[tuple[Gateway, ...], ...],
        visits: tuple[Visit, ...],
        paths: int,
    ) -> None:
        self.firsts, self.stars, self.joined = firsts, stars, joined
        self.visits, self.paths = visits, paths

    @classmethod
    def beginning(cls, star: Star) -> TopologicalMap:
        """Return the map of one place."""
        visit = Visit(0, tuple(range(star.gateways)))
        return cls((0,), (star,), ((OPEN,) * star.gateways,), (visit,), star.paths)

    @property
    def places(self) -> int:
        """Number of places."""
        return len(self.stars)

    @property
    def here(self) -> Visit:
        """The present visit."""
        return self.visits[-1]

    @property
    def rank(self) -> tuple[int, int]:
        """What circumscription makes as small as it can: the paths first, then the places."""
        return self.paths, self.places

    def gateway(self, seen: int, visit: int = -1) -> Gateway:
        """Return the gateway of this map that a visit's star counts as `seen`."""
        place, gateways = self.visits[visit]
        return place, gateways[seen]

    def common(self, visit: int = -1) -> Common:
        """Return the gateways that a visit has in common with the first one to its place."""
        place, gateways = self.visits[visit]
        first = {each: k for k, each in enumerate(self.visits[self.firsts[place]].gateways)}
        return tuple((k, first[each]) for k, each in enumerate(gateways) if each in first)

    def open_gateways(self) -> Iterator[Gateway]:
        """Yield the gateways that are joined to nothing, in order."""
        for place, row in enumerate(self.joined):
            for gateway, other in enumerate(row):
                if other == OPEN:
                    yield place, gateway

    def edges(self) -> Iterator[tuple[Gateway, Gateway]]:
        """Yield the pairs of joined gateways, the smaller one first, in order."""
        for place, row in enumerate(self.joined):
            for gateway, other in enumerate(row):
                if other > (place, gateway):
                    yield (place, gateway), other

    def path_from(self, gateway: Gateway) -> list[int]:
        """Return the places of the path of a gateway beyond its own place, the nearest first.

        A path that runs in a circle ends before a place comes again.
        """
        places: list[int] = []
        at = self.joined[gateway[0]][gateway[1]]
        while at != OPEN and at[0] not in places:
            places.append(at[0])
            onward = self.stars[at[0]].continues[at[1]]
            at = OPEN if onward < 0 else self.joined[at[0]][onward]
        return places

    def path_through(self, gateway: Gateway) -> list[int]:
        """Return the places of the path of a gateway, in order, its far end behind first."""
        place, number = gateway
        behind = self.stars[place].continues[number]
        before = [] if behind < 0 else self.path_from((place, behind))
        return [*reversed(before), place, *self.path_from(gateway)]

    def face(self, gateway: Gateway) -> Iterator[Gateway]:
        """Yield the gateways along the face to the right of one that leads out of its place.

        The face's border runs out of a gateway into the one that it is joined to (an open gateway
        leads back into itself), and on by the next gateway in the circular order.
        """
        place, number = gateway
        while True:
            yield place, number
            other = self.joined[place][number]
            place, number = (place, number) if other == OPEN else other
            number = (number + 1) % self.stars[place].gateways
            if (place, number) == gateway:
                return

    def _joins_twice(self, one: Gateway, other: Gateway) -> bool:
        """Return whether joining two gateways would lead a path through one place twice."""
        places = [*self.path_through(one), *self.path_through(other)]
        return len(set(places)) < len(places)

    def _with(self, one: Gateway, other: Gateway) -> TopologicalMap:
        """Return this map with two gateways joined."""
        joined = list(self.joined)
        for (place, number), to in ((one, other), (other, one)):
            joined[place] = (*joined[place][:number], to, *joined[place][number + 1 :])
        return TopologicalMap(self.firsts, self.stars, tuple(joined), self.visits, self.paths - 1)

    def _with_new_place(self, one: Gateway, travel: Travel) -> TopologicalMap:
        """Return this map with a gateway joined to a new place."""
        wider = TopologicalMap(
            (*self.firsts, len(self.visits)),
            (*self.stars, travel.star),
            (*self.joined, (OPEN,) * travel.star.gateways),
            (*self.visits, Visit(self.places, tuple(range(travel.star.gateways)))),
            self.paths + travel.star.paths,
        )
        return wider._with(one, (self.places, travel.arrived))

    def _with_visit(self, place: int, merge: Merge) -> TopologicalMap:
        """Return this map with a visit to a place, whose star becomes that of the merge."""
        visits = (*self.visits, Visit(place, merge.seen))
        if merge.star == self.stars[place]:
            return TopologicalMap(self.firsts, self.stars, self.joined, visits, self.paths)

        def renumbered(gateway: Gateway) -> Gateway:
            is_there = gateway[0] == place and gateway != OPEN
            return (place, merge.known[gateway[1]]) if is_there else gateway

        joined = [tuple(map(renumbered, row)) for row in self.joined]
        row = [OPEN] * merge.star.gateways
        for old, new in enumerate(merge.known):
            row[new] = joined[place][old]
        joined[place] = tuple(row)
        visits = tuple(
            Visit(place, tuple(merge.known[each] for each in visit.gateways))
            if visit.place == place
            else visit
            for visit in self.visits
        )
        stars = (*self.stars[:place], merge.star, *self.stars[place + 1 :])
        return TopologicalMap(
            self.firsts,
            stars,
            tuple(joined),
            (*visits, Visit(place, merge.seen)),
            self.paths + merge.star.paths - self.stars[place].paths,
        )

    def _comes_once(self, place: int) -> bool:
        """Return whether each path through a place comes through each of its places once."""
        through = (self.path_through((place, k)) for k in range(self.stars[place].gateways))
        return all(len(set(places)) == len(places) for places in through)

    def _without(self, one: Gateway) -> TopologicalMap:
        """Return this map with a gateway joined to nothing."""
        joined = list(self.joined)
        other = joined[one[0]][one[1]]
        for place, number in (one, other):
            joined[place] = (*joined[place][:number], OPEN, *joined[place][number + 1 :])
        return TopologicalMap(self.firsts, self.stars, tuple(joined), self.visits, self.paths + 1)

    def extended(self, travel: Travel, planar: bool, judge: Judge) -> Iterator[TopologicalMap]:
        """Yield the maps that agree with this one and a travel; none if it contradicts the map.

        The maps in which the place is known come first, in the order of its gateways.
        """
        here = self.gateway(travel.left)
        there = self.joined[here[0]][here[1]]
        if there != OPEN:
            yield from self._along_known_way(travel, there, judge)
            return
        beside = set(self.face(here)) if planar else None
        for place, star in enumerate(self.stars):
            for merge in merges(travel.star, star, travel.arrived):
                if not judge(self.firsts[place], self._common_by(place, merge), True):
                    continue
                leaf = self._closed(travel, place, merge, beside)
                if leaf is not None:
                    yield leaf
        yield self._with_new_place(here, travel)

    def _common_by(self, place: int, merge: Merge) -> Common:
        """Return the gateways that a visit has in common with the first one, by a merge."""
        first = self.visits[self.firsts[place]].gateways
        at = {merge.known[each]: k for k, each in enumerate(first)}
        return tuple((k, at[each]) for k, each in enumerate(merge.seen) if each in at)

    def _along_known_way(
        self, travel: Travel, there: Gateway, judge: Judge
    ) -> Sequence[TopologicalMap]:
        """Return this map with a travel to the gateway that it knows, for each way to merge."""
        place, number = there
        leaves = [
            self._with_visit(place, merge)
            for merge in merges(travel.star, self.stars[place], travel.arrived)
            if merge.seen[travel.arrived] == merge.known[number]
        ]
        return [
            leaf
            for leaf in leaves
            if leaf._comes_once(place) and judge(self.firsts[place], leaf.common(), False)
        ]

    def _closed(
        self, travel: Travel, place: int, merge: Merge, beside: set[Gateway] | None
    ) -> TopologicalMap | None:
        """Return this map with a travel that closes a loop to a place; None if an axiom forbids it.

        Args:
            travel: The travel.
            place: The place.
            merge: How its star lies on that of the place.
            beside: The gateways on the face of the one by which the robot left; None for all.
        """
        here, at = self.gateway(travel.left), merge.seen[travel.arrived]
        if at in merge.known:
            there = place, merge.known.index(at)
            is_open = self.joined[place][there[1]] == OPEN
            if not is_open or there == here or (beside is not None and there not in beside):
                return None
            if self._joins_twice(here, there):
                return None
        leaf = self._with_visit(place, merge)
        one, other = leaf.gateway(travel.left, -2), leaf.gateway(travel.arrived)
        if at not in merge.known and beside is not None and other not in leaf.face(one):
            return None
        is_changed = leaf.stars[place] != self.stars[place]
        if is_changed and (leaf._joins_twice(one, other) or not leaf._comes_once(place)):
            return None
        return leaf._with(one, other)

    def followed(
        self, travel: Travel, visit: Visit, known: list[list[int]]
    ) -> TopologicalMap | None:
        """Return this map with a travel to a given visit; None if the two do not fit.

        Args:
            travel: The travel.
            visit: The visit; its place's gateways are counted as after all visits.
            known: The gateways of each place that are known so far, counted so. The visit's are
                added.
        """
        if visit.place == self.places:
            known.append(list(visit.gateways))
            is_first = visit.gateways == tuple(sorted(set(visit.gateways)))
            is_first &= len(visit.gateways) == travel.star.gateways
            return self.repaired(travel) if is_first else None
        if not 0 <= visit.place < self.places:
            return None
        every = sorted({*known[visit.place], *visit.gateways})
        seen = tuple(every.index(each) for each in visit.gateways)
        before = tuple(every.index(each) for each in known[visit.place])
        known[visit.place] = every
        for merge in merges(travel.star, self.stars[visit.place], travel.arrived):
            if (merge.seen, merge.known) == (seen, before):
                leaf = self._with_visit(visit.place, merge)
                one, other = leaf.gateway(travel.left, -2), leaf.gateway(travel.arrived)
                to = leaf.joined[one[0]][one[1]], leaf.joined[other[0]][other[1]]
                if to == (other, one):
                    return leaf
                return leaf._with(one, other) if to == (OPEN, OPEN) and one != other else None
        return None

    def repaired(self, travel: Travel) -> TopologicalMap:
        """Return this map with a travel that contradicts it: the gateway leads to a new place."""
        here = self.gateway(travel.left)
        is_open = self.joined[here[0]][here[1]] == OPEN
        return (self if is_open else self._without(here))._with_new_place(here, travel)
