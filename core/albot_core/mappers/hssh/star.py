"""The star of a place: its local topology (Beeson et al. 2010, sections 5 and 6).

The gateways stand in their circular order, counter-clockwise. A local path leads through a place,
from one gateway to the one that continues it, or ends there. Where the place was not seen to its
border, any number of gateways may still lie: an unknown arm. The paper's robot sees all of a place
before it leaves; the unknown arms are ours.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from functools import cached_property, lru_cache
from typing import NamedTuple

from albot_core.errors import InputError

ENDS = -1
"""What continues a gateway whose local path ends in the place, as far as it was seen."""
MAYBE = -2
"""What continues a gateway if another that was seen on another visit only may continue it."""
_MOST = 24
"""Number of merges of two stars from which on those with fewer common gateways are left out."""


class Star:
    """The local topology of a place.

    Args:
        continues: The gateway that continues each gateway's local path, `ENDS` or `MAYBE`. Empty
            for a place without gateways.
        unknown: Where there are unknown arms: k for one between gateway k and the one before.

    Raises:
        InputError: A gateway continues itself, one that does not continue it, or none; or an
            unknown arm lies beside no gateway.
    """

    def __init__(self, *continues: int, unknown: Collection[int] = ()) -> None:
        for gateway, other in enumerate(continues):
            is_mutual = 0 <= other < len(continues) and continues[other] == gateway != other
            if other not in {ENDS, MAYBE} and not is_mutual:
                expected = f"{ENDS}, {MAYBE}, or a gateway that continues gateway {gateway} in turn"
                raise InputError("Star", expected, str(other), place=f"gateway {gateway}")
        if any(not 0 <= arm < max(len(continues), 1) for arm in unknown):
            expected = f"numbers below {max(len(continues), 1)}"
            raise InputError("Star", expected, str(sorted(unknown)), place="unknown")
        self.continues = tuple(int(other) for other in continues)
        self.unknown = frozenset(int(arm) for arm in unknown)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Star):
            return NotImplemented
        return (self.continues, self.unknown) == (other.continues, other.unknown)

    @cached_property
    def _hash(self) -> int:
        return hash((self.continues, self.unknown))

    def __hash__(self) -> int:
        return self._hash

    def __repr__(self) -> str:
        if self.is_whole:
            return f"Star{self.continues}"
        return f"Star({', '.join(map(str, self.continues))}, unknown={sorted(self.unknown)})"

    @property
    def gateways(self) -> int:
        """Number of gateways."""
        return len(self.continues)

    @property
    def is_whole(self) -> bool:
        """Whether all gateways are known."""
        return not self.unknown

    @cached_property
    def paths(self) -> int:
        """Number of local paths, as far as they are known."""
        return self.gateways - sum(other > k for k, other in enumerate(self.continues))

    def turned(self, shift: int) -> Star:
        """Return the star with its gateways counted from another: gateway `shift` becomes 0."""
        count = self.gateways
        continues = (
            other if other < 0 else (other - shift) % count
            for other in (self.continues[(k + shift) % count] for k in range(count))
        )
        return Star(*continues, unknown={(arm - shift) % max(count, 1) for arm in self.unknown})

    @cached_property
    def kind(self) -> Star:
        """The star from the gateway that makes it the least; equal for stars of one shape."""
        turned = [self.turned(shift) for shift in range(self.gateways)]
        return min(turned, key=lambda star: (star.continues, sorted(star.unknown)), default=self)


class Merge(NamedTuple):
    """How a star as it was seen may lie on a known one, and the star that both make."""

    star: Star
    """What is known then. It is counted from gateway 0 of the known star on."""
    seen: tuple[int, ...]
    """The number in it of each gateway of the seen star."""
    known: tuple[int, ...]
    """The number in it of each gateway of the known star."""


_Pair = tuple[int, int]
"""A gateway of the seen star and one of the known star, -1 for none: they are the same."""


@lru_cache(maxsize=1 << 16)
def merges(seen: Star, known: Star, arrived: int) -> tuple[Merge, ...]:
    """Return the ways in which a star may lie on a known one, by its gateway `arrived` on.

    The circular orders must agree. A gateway without a partner must lie in an unknown arm of the
    other star; local paths must agree as far as both stars know them. Between stars without unknown
    arms these are the isomorphisms. The ways in which `arrived` is a gateway of the known star come
    first, in the order of that gateway. Of very many ways only those with most common gateways are
    returned.
    """
    found: list[Merge] = []
    for alone in range(seen.gateways + known.gateways + 1):
        for start in range(known.gateways):
            orders = _orders(seen, known, ((arrived, start),), alone)
            found += filter(None, (_merge(seen, known, order) for order in orders))
        if alone:
            for start in sorted(known.unknown):
                orders = _orders(seen, known, ((arrived, -1),), alone - 1, start)
                found += filter(None, (_merge(seen, known, order) for order in orders))
        if len(found) >= _MOST or (seen.is_whole and known.is_whole):
            break
    return tuple(sorted(found, key=lambda merge: _rank(merge, arrived)))


def _rank(merge: Merge, arrived: int) -> tuple[int, int]:
    """Return what merges are sorted by."""
    at, count = merge.seen[arrived], len(merge.known)
    return (merge.known.index(at) if at in merge.known else count), merge.star.gateways


def _orders(
    seen: Star, known: Star, first: tuple[_Pair, ...], alone: int, start: int = 0
) -> Iterator[tuple[_Pair, ...]]:
    """Yield the circular orders that two stars make, with `alone` gateways in one of them only.

    Args:
        seen: The star as it was seen.
        known: The known star.
        first: The first pair of the order.
        alone: Number of further gateways without a partner.
        start: The unknown arm of the known star in which the first pair lies, if it has no partner.
    """
    arrived, there = first[0]
    start = there if there >= 0 else start

    def onward(order: tuple[_Pair, ...], i: int, j: int, left: int) -> Iterator[tuple[_Pair, ...]]:
        more, others = seen.gateways - i, known.gateways - j
        if abs(more - others) > left:
            return
        if more == others == 0:
            if left == 0:
                yield order
            return
        a, b = (arrived + i) % seen.gateways, (start + j) % known.gateways
        if more and others:
            yield from onward((*order, (a, b)), i + 1, j + 1, left)
        if left and more and b in known.unknown:
            yield from onward((*order, (a, -1)), i + 1, j, left - 1)
        if left and others and a in seen.unknown:
            yield from onward((*order, (-1, b)), i, j + 1, left - 1)

    yield from onward(first, 1, int(there >= 0), alone)


def _merge(seen: Star, known: Star, order: tuple[_Pair, ...]) -> Merge | None:
    """Return the star that two stars make in an order; None if their local paths differ."""
    zero = next(k for k, (_, b) in enumerate(order) if b == 0)
    order = order[zero:] + order[:zero]
    at_seen = {a: k for k, (a, _) in enumerate(order) if a >= 0}
    at_known = {b: k for k, (_, b) in enumerate(order) if b >= 0}
    continues = []
    for a, b in order:
        told = [
            (star.continues[gateway], at)
            for star, gateway, at in ((seen, a, at_seen), (known, b, at_known))
            if gateway >= 0
        ]
        onward = {at[other] for other, at in told if other >= 0}
        # No gateway of a star in which the path ends continues it.
        others = {k for other, at in told if other == ENDS for k in at.values()}
        if len(onward) > 1 or onward & others:
            return None
        continues.append(max(onward, default=ENDS if len(others) == len(order) else MAYBE))
    return Merge(
        Star(*continues, unknown=_common_arms(seen, known, order)),
        tuple(at_seen[a] for a in range(seen.gateways)),
        tuple(at_known[b] for b in range(known.gateways)),
    )


def _common_arms(seen: Star, known: Star, order: tuple[_Pair, ...]) -> list[int]:
    """Return before which places of an order both stars have an unknown arm."""
    # Before each place: the next gateway of either star.
    following = []
    a = next(a for a, _ in order if a >= 0)
    b = next(b for _, b in order if b >= 0)
    for one, other in reversed(order):
        a, b = (one if one >= 0 else a), (other if other >= 0 else b)
        following.append((a, b))
    arms = reversed(following)
    return [k for k, (a, b) in enumerate(arms) if a in seen.unknown and b in known.unknown]
