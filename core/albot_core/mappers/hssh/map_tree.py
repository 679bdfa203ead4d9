"""The tree of topological maps (Beeson et al. 2010, section 6; Remolina and Kuipers 2004).

A map says which visits were to the same place, and which gateways a travel joined. Where the star
of a visit fits several known places, each gives a map of its own, and a new place gives one more.
All maps that agree with the experience and the axioms are kept. The tree branches at travels only,
since a star describes all turns at its place.

The axioms: a gateway is joined to one other; a path runs through a place once at most; with
`planar`, the map can be drawn in the plane with the gateways of each place in their order (Savelli
and Kuipers, Loop-closing and planarity in topological map-building, IROS 2004).

Prioritized circumscription prefers the maps with the fewest paths, and of these the ones with the
fewest places.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from albot_core.errors import InputError
from albot_core.mappers.hssh.star import ENDS, Star, alignments
from albot_core.ranges import FROM_ONE, check_fields

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
    shift: int
    """Gateway k of the visit's star is gateway k + shift of the place."""


Judge = Callable[[int, int], bool]
"""Whether the latest visit can be to the place that was first visited at a visit, with a shift of
its gateways: the place for evidence besides the stars, such as the local maps. It is asked where a
travel closes a loop; where it follows a way that the map knows, the star is enough."""


def anything(first: int, shift: int) -> bool:
    """Accept every match: the stars alone decide."""
    return True


@dataclass(frozen=True, kw_only=True)
class TreeConfig:
    """Axioms and size of the tree."""

    planar: bool = True
    """Whether the map must be planar with its gateways in order."""
    limit: int = 1000
    """Largest number of maps that are kept; of more, the least preferred are forgotten, which
    `MapTree.forgotten` counts."""

    def __post_init__(self) -> None:
        check_fields(self, FROM_ONE, "limit")


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
        return cls((0,), (star,), ((OPEN,) * star.gateways,), (Visit(0, 0),), star.paths)

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
        place, shift = self.visits[visit]
        return place, (seen + shift) % self.stars[place].gateways

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
            at = OPEN if onward == ENDS else self.joined[at[0]][onward]
        return places

    def path_through(self, gateway: Gateway) -> list[int]:
        """Return the places of the path of a gateway, in order, its far end behind first."""
        place, number = gateway
        behind = self.stars[place].continues[number]
        before = [] if behind == ENDS else self.path_from((place, behind))
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

    def _with(self, one: Gateway, other: Gateway, visit: Visit) -> TopologicalMap:
        """Return this map with two gateways joined, and a visit to the second one's place."""
        joined = list(self.joined)
        for (place, number), to in ((one, other), (other, one)):
            joined[place] = (*joined[place][:number], to, *joined[place][number + 1 :])
        return TopologicalMap(
            self.firsts, self.stars, tuple(joined), (*self.visits, visit), self.paths - 1
        )

    def _with_new_place(self, one: Gateway, travel: Travel) -> TopologicalMap:
        """Return this map with a gateway joined to a new place."""
        wider = TopologicalMap(
            (*self.firsts, len(self.visits)),
            (*self.stars, travel.star),
            (*self.joined, (OPEN,) * travel.star.gateways),
            self.visits,
            self.paths + travel.star.paths,
        )
        return wider._with(one, (self.places, travel.arrived), Visit(self.places, 0))

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
        known = self.joined[here[0]][here[1]]
        if known != OPEN:
            visit = self._visit(travel, known)
            if visit is not None:
                yield TopologicalMap(
                    self.firsts, self.stars, self.joined, (*self.visits, visit), self.paths
                )
            return
        beside = set(self.face(here)) if planar else None
        for there in self.open_gateways():
            visit = self._visit(travel, there)
            if visit is None or there == here or (beside is not None and there not in beside):
                continue
            if not self._joins_twice(here, there) and judge(self.firsts[visit.place], visit.shift):
                yield self._with(here, there, visit)
        yield self._with_new_place(here, travel)

    def _visit(self, travel: Travel, there: Gateway) -> Visit | None:
        """Return the visit by which a travel came in through a gateway; None if its star differs.

        The gateway fixes how the star lies on that of the place.
        """
        place, number = there
        star = self.stars[place]
        shift = (number - travel.arrived) % max(star.gateways, 1)
        return Visit(place, shift) if shift in alignments(travel.star, star) else None

    def followed(self, travel: Travel, visit: Visit) -> TopologicalMap | None:
        """Return this map with a travel to a known visit; None if the two do not fit."""
        here = self.gateway(travel.left)
        if visit == (self.places, 0):
            return self.repaired(travel)
        if not 0 <= visit.place < self.places:
            return None
        there = visit.place, (travel.arrived + visit.shift) % max(travel.star.gateways, 1)
        if self._visit(travel, there) != visit:
            return None
        if self.joined[here[0]][here[1]] == there:
            visits = (*self.visits, visit)
            return TopologicalMap(self.firsts, self.stars, self.joined, visits, self.paths)
        is_open = self.joined[here[0]][here[1]] == self.joined[there[0]][there[1]] == OPEN
        return self._with(here, there, visit) if is_open and here != there else None

    def repaired(self, travel: Travel) -> TopologicalMap:
        """Return this map with a travel that contradicts it: the gateway leads to a new place."""
        here = self.gateway(travel.left)
        is_open = self.joined[here[0]][here[1]] == OPEN
        return (self if is_open else self._without(here))._with_new_place(here, travel)


class MapTree:
    """All maps that agree with the experience so far: the leaves of the tree.

    Args:
        star: The star of the first place.
        config: Axioms and size.
    """

    def __init__(self, star: Star, config: TreeConfig | None = None) -> None:
        self.config = config or TreeConfig()
        self.start = star
        self.travels: list[Travel] = []
        self.maps: list[TopologicalMap] = [TopologicalMap.beginning(star)]
        """The leaves, the preferred ones first; among equals the older branch first."""
        self.forgotten = 0
        """Number of maps that were forgotten because of the limit."""
        self.contradictions = 0
        """Number of travels that contradicted all maps."""

    @property
    def best(self) -> TopologicalMap:
        """The preferred map; of several the first."""
        return self.maps[0]

    @property
    def minimal(self) -> list[TopologicalMap]:
        """The maps that circumscription leaves: those of the least rank."""
        return [each for each in self.maps if each.rank == self.best.rank]

    def travel(self, travel: Travel, judge: Judge = anything) -> bool:
        """Extend all maps by a travel, and drop those that it contradicts.

        If it contradicts all maps, the perception was wrong; the paper assumes that it never is.
        Then the preferred map goes on alone, and the gateway leads to a new place in it.

        Returns:
            Whether any map agreed.

        Raises:
            InputError: There is no such gateway.
        """
        maps = self.preview(travel, judge)
        self.travels.append(travel)
        if not maps:
            self.contradictions += 1
            self.maps = [self.best.repaired(travel)]
            return False
        self.forgotten += max(len(maps) - self.config.limit, 0)
        self.maps = maps[: self.config.limit]
        return True

    def preview(self, travel: Travel, judge: Judge = anything) -> list[TopologicalMap]:
        """Return the maps that a travel would leave, the preferred ones first; keep the tree.

        Raises:
            InputError: There is no such gateway.
        """
        before = self.travels[-1].star if self.travels else self.start
        self._check("left", travel.left, before)
        self._check("arrived", travel.arrived, travel.star)
        planar = self.config.planar
        maps = [more for each in self.maps for more in each.extended(travel, planar, judge)]
        return sorted(maps, key=lambda each: each.rank)

    @staticmethod
    def _check(name: str, gateway: int, star: Star) -> None:
        if not 0 <= gateway < star.gateways:
            expected = f"a gateway below {star.gateways}"
            raise InputError("Travel", expected, str(gateway), place=name)

    @classmethod
    def replayed(
        cls,
        star: Star,
        travels: Sequence[Travel],
        visits: Sequence[Sequence[Visit]],
        config: TreeConfig | None = None,
    ) -> MapTree:
        """Return the tree after some travels, given the visits of each of its maps.

        Raises:
            InputError: The visits of a map do not fit the travels.
        """
        tree = cls(star, config)
        tree.travels = list(travels)
        tree.maps = []
        for number, each in enumerate(visits):
            leaf = TopologicalMap.beginning(star)
            for step, (travel, visit) in enumerate(zip(travels, each[1:], strict=True), start=1):
                onward = leaf.followed(travel, Visit(*visit))
                if onward is None:
                    expected = "visits that fit the travels"
                    raise InputError(f"map {number}", expected, f"{visit} at visit {step}")
                leaf = onward
            tree.maps.append(leaf)
        return tree
