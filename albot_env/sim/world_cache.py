"""The world cache: objects computed once per world, for the worlds that robots are in."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

from albot_maps.world import World

KEPT = 64
"""Number of worlds kept for later, besides those with robots in them."""

Made = TypeVar("Made")


class WorldCache(Generic[Made]):
    """Cache of objects computed from worlds. Worlds are told apart by object identity.

    Args:
        robots: Number of robots.
        make: Computes the object of a world.
        clear: Called before the cache is emptied; objects still in use are then made again.
    """

    def __init__(
        self, robots: int, make: Callable[[World], Made], clear: Callable[[], None]
    ) -> None:
        self._make = make
        self._clear = clear
        self._worlds: list[World | None] = [None] * robots
        self._made: dict[int, tuple[World, Made]] = {}

    def enter(self, row: int, world: World) -> Iterator[tuple[int, Made]]:
        """Put a robot into a world; yield the rows that have changed, each with its object.

        Usually that is the robot's own row; after a clearing it is every row.
        """
        self._worlds[row] = world
        rows = [row]
        if id(world) not in self._made and len(self._made) >= 2 * len(self._worlds) + KEPT:
            self._clear()
            self._made.clear()
            rows = [k for k, other in enumerate(self._worlds) if other is not None]
        for k in rows:
            its = self._worlds[k]
            assert its is not None
            if id(its) not in self._made:
                self._made[id(its)] = its, self._make(its)
            yield k, self._made[id(its)][1]
