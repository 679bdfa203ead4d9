"""The star of a place: its local topology (Beeson et al. 2010, sections 5 and 6).

The gateways stand in their circular order, counter-clockwise. A local path leads through a place,
from one gateway to the one that continues it, or ends there.
"""

from __future__ import annotations

from functools import cached_property, lru_cache

from albot_core.errors import InputError

ENDS = -1
"""What continues a gateway whose local path ends in the place."""


class Star:
    """The local topology of a place.

    Args:
        continues: The gateway that continues each gateway's local path, or `ENDS`. Empty for a
            place without gateways.

    Raises:
        InputError: A gateway continues itself, one that does not continue it, or none.
    """

    def __init__(self, *continues: int) -> None:
        for gateway, other in enumerate(continues):
            is_mutual = 0 <= other < len(continues) and continues[other] == gateway != other
            if other != ENDS and not is_mutual:
                expected = f"{ENDS}, or a gateway that continues gateway {gateway} in turn"
                raise InputError("Star", expected, str(other), place=f"gateway {gateway}")
        self.continues = tuple(int(other) for other in continues)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Star) and self.continues == other.continues

    def __hash__(self) -> int:
        return hash(self.continues)

    def __repr__(self) -> str:
        return f"Star{self.continues}"

    @property
    def gateways(self) -> int:
        """Number of gateways."""
        return len(self.continues)

    @cached_property
    def paths(self) -> int:
        """Number of local paths."""
        return self.gateways - sum(other > k for k, other in enumerate(self.continues))

    def turned(self, shift: int) -> Star:
        """Return the star with its gateways counted from another: gateway `shift` becomes 0."""
        count = self.gateways
        return Star(
            *(
                ENDS if other == ENDS else (other - shift) % count
                for other in (self.continues[(k + shift) % count] for k in range(count))
            )
        )

    @cached_property
    def kind(self) -> Star:
        """The star from the gateway that makes it the least; equal for stars of one shape."""
        turned = [self.turned(shift) for shift in range(self.gateways)]
        return min(turned, key=lambda star: star.continues, default=self)


@lru_cache(maxsize=4096)
def alignments(seen: Star, known: Star) -> tuple[int, ...]:
    """Return how a star may lie on a known one: the isomorphisms of their circular orders.

    Each is a shift: gateway k of `seen` is gateway k + shift of `known`. Two stars without a
    gateway have the shift 0.
    """
    if seen.gateways != known.gateways:
        return ()
    shifts = range(max(known.gateways, 1))
    return tuple(shift for shift in shifts if known.turned(shift) == seen)
