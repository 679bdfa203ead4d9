"""Sets of worlds, from which each episode draws its own."""

from __future__ import annotations

import re
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from pathlib import Path

from albot_core.errors import InputError
from albot_maps.generators.spec import PREFIX, parse_spec
from albot_maps.load import load_world
from albot_maps.world import World

KEPT = 256
"""Worlds of a set that are kept once they were needed; others are made again."""

_MOST = 1_000_000_000
"""Largest set of random worlds."""
_RANGE = re.compile(
    re.escape(PREFIX) + r"(?P<kind>[^:?]*):(?P<first>\d+)\.\.(?P<last>\d+)(?P<rest>\?.*)?"
)


class WorldSet:
    """Worlds by their number. A world is loaded or made when it is first asked for.

    Args:
        worlds: The worlds, or their specs.

    Raises:
        InputError: There is none, or the first one is wrong.
    """

    def __init__(self, worlds: Sequence[str | Path | World]) -> None:
        if not len(worlds):
            raise InputError("worlds", "at least one world", "none")
        self._worlds = worlds
        self._loaded: OrderedDict[int, World] = OrderedDict()
        self[0]  # A wrong spec is told now, not in the middle of a training.

    def __len__(self) -> int:
        """How many worlds there are."""
        return len(self._worlds)

    def __iter__(self) -> Iterator[World]:
        """The worlds in turn."""
        return (self[number] for number in range(len(self)))

    def __getitem__(self, number: int) -> World:
        """The world of a number from 0 on.

        Raises:
            InputError: There is none of that number, or it is wrong.
        """
        if not 0 <= number < len(self):
            expected = f"a world's number below {len(self)}"
            raise InputError("worlds", expected, str(number))
        if number not in self._loaded:
            world = self._worlds[number]
            self._loaded[number] = world if isinstance(world, World) else load_world(world)
            if len(self._loaded) > KEPT:
                self._loaded.popitem(last=False)
        self._loaded.move_to_end(number)
        return self._loaded[number]


def load_worlds(spec: str | Path | World | WorldSet) -> WorldSet:
    """The worlds that a spec names.

    A spec with a range of seeds names as many random worlds: `random:office:0..99?rooms=8`
    those of the seeds 0 to 99. Any other names one world (see `load_world`).

    Raises:
        InputError: As `load_world`; or the range holds no seed, or the spec is none at all.
    """
    if isinstance(spec, WorldSet):
        return spec
    if not isinstance(spec, str | Path | World):
        raise InputError("world", "a world, a set of worlds, or a spec of them", repr(spec))
    found = _RANGE.fullmatch(spec) if isinstance(spec, str) else None
    if found is None:
        return WorldSet((spec,))
    first, last = int(found["first"]), int(found["last"])
    parse_spec(f"{PREFIX}{found['kind']}:{last}{found['rest'] or ''}")
    if not 0 <= last - first < _MOST:
        expected = f"a range of seeds A..B with B at least A, of {_MOST:,} seeds at most"
        raise InputError(str(spec), expected, f"{first}..{last}")
    return WorldSet(_Specs(found["kind"], range(first, last + 1), found["rest"] or ""))


class _Specs(Sequence[str]):
    """The specs of the random worlds of a range of seeds."""

    def __init__(self, kind: str, seeds: range, rest: str) -> None:
        self._kind, self._seeds, self._rest = kind, seeds, rest

    def __len__(self) -> int:
        return len(self._seeds)

    def __getitem__(self, number: int) -> str:  # type: ignore[override]
        return f"{PREFIX}{self._kind}:{self._seeds[number]}{self._rest}"
