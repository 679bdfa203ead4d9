"""The world cache: what is made of the worlds that robots are in, once for each world."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

from albot_maps.world import World

KEPT = 64
"""Worlds that are kept beside those with robots in them, for whoever comes there next."""

Made = TypeVar("Made")


class WorldCache(Generic[Made]):
    """Keeps what is made of worlds. Which world it is goes by the object.

    Args:
        robots: How many robots there are.
        make: Makes it for a world.
        clear: Forgets all that was made. What robots still need is then made anew.
    """

    def __init__(
        self, robots: int, make: Callable[[World], Made], clear: Callable[[], None]
    ) -> None:
        self._make = make
        self._clear = clear
        self._worlds: list[World | None] = [None] * robots
        self._made: dict[int, tuple[World, Made]] = {}

    def enter(self, row: int, world: World) -> Iterator[tuple[int, Made]]:
        """Put a robot into a world; yield the rows that have changed, with what is made for them.

        Mostly the robot's own row alone; all of them where the cache was cleared.
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
