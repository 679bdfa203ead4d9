"""The tree of topological maps (Beeson et al. 2010, section 6; Remolina and Kuipers 2004).

A map says which visits were to the same place, and which gateways a travel joined. Where the star
of a visit fits several known places, each gives a map of its own, and a new place gives one more.
All maps that agree with the experience and the axioms are kept. The tree branches at travels only,
since a star describes all turns at its place.

Prioritized circumscription prefers the maps with the fewest paths, and of these the ones with the
fewest places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from albot_core.errors import InputError
from albot_core.mappers.hssh.star import Star
from albot_core.mappers.hssh.topological_map import Judge, TopologicalMap, Travel, Visit, anything
from albot_core.ranges import FROM_ONE, check_fields


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

    def preview(
        self,
        travel: Travel,
        judge: Judge = anything,
        some: Sequence[TopologicalMap] | None = None,
    ) -> list[TopologicalMap]:
        """Return the maps that a travel would leave, the preferred ones first; keep the tree.

        Args:
            travel: The travel.
            judge: Evidence besides the stars.
            some: The maps to extend; None for all.

        Raises:
            InputError: There is no such gateway.
        """
        before = self.travels[-1].star if self.travels else self.start
        self._check("left", travel.left, before)
        self._check("arrived", travel.arrived, travel.star)
        planar = self.config.planar
        maps = self.maps if some is None else some
        maps = [more for each in maps for more in each.extended(travel, planar, judge)]
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
        expected = "visits that fit the travels"
        for number, each in enumerate(visits):
            leaf = TopologicalMap.beginning(star)
            known = [list(each[0].gateways)]
            if known[0] != sorted(set(known[0])) or len(known[0]) != star.gateways:
                raise InputError(f"map {number}", expected, f"{each[0]} at visit 0")
            for step, (travel, visit) in enumerate(zip(travels, each[1:], strict=True), start=1):
                onward = leaf.followed(travel, visit, known)
                if onward is None:
                    raise InputError(f"map {number}", expected, f"{visit} at visit {step}")
                leaf = onward
            if any(row != list(range(len(row))) for row in known):
                raise InputError(f"map {number}", expected, "gateways that no visit has")
            tree.maps.append(leaf)
        return tree
