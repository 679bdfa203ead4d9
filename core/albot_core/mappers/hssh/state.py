"""What the fields of the state cannot express: visits, star and tree must fit together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Int64

from albot_core.errors import InputError
from albot_core.mappers.hssh.config import HsshConfig
from albot_core.mappers.hssh.map_tree import MapTree
from albot_core.mappers.hssh.topological_map import TopologicalMap, Travel
from albot_core.mappers.hssh.topological_map import Visit as Numbered
from albot_core.mappers.hssh.visit import Visit
from albot_core.mappers.hssh.visits import visits_of
from albot_core.mappers.schema import Arrays, Sizes, refuse_unless


def tree_of(state: Arrays, config: HsshConfig) -> MapTree | None:
    """Return the tree that a state holds: it knows all visits but the present one.

    Raises:
        InputError: The visits of a map do not fit what was perceived.
    """
    straight = config.gateways.straight
    visits = visits_of(state)
    known = state["tree.visits"].shape[1]
    if not known:
        return None
    stars = [visit.star(straight) for visit in visits[:known]]
    travels = [
        Travel(before.left, star, visit.arrived)
        for before, visit, star in zip(visits, visits[1:known], stars[1:], strict=False)
    ]
    maps = [[_numbered(numbers) for numbers in row] for row in state["tree.visits"].tolist()]
    try:
        tree = MapTree.replayed(stars[0], travels, maps, config.tree)
    except InputError as error:
        raise InputError("tree.visits", error.expected, error.found, place=error.source) from None
    tree.forgotten, tree.contradictions = state["tree.counts"].tolist()
    return tree


def _numbered(numbers: list[int]) -> Numbered:
    """Return the visit that a row of a state holds: the place, its gateways, and -1 to the end."""
    count = numbers.index(-1) if -1 in numbers else len(numbers)
    return Numbered(numbers[0], tuple(numbers[1 : max(count, 1)]))


def rows_of(maps: Sequence[TopologicalMap]) -> Int64[np.ndarray, "maps visits numbers"]:
    """Return the visits of maps as rows of a state."""
    visits = [visit for each in maps for visit in each.visits]
    width = 1 + max((len(visit.gateways) for visit in visits), default=0)
    rows = np.full((len(visits), width), -1)
    for row, (place, gateways) in zip(rows, visits, strict=True):
        row[0] = place
        row[1 : 1 + len(gateways)] = gateways
    return rows.reshape(len(maps), -1 if len(maps) else 0, width)


def _check_visits(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless the visits come in order, by gateways that exist."""
    visits = visits_of(state)
    for number, visit in enumerate(visits):
        _check_visit(visit, number, len(visits))
    entered = [visit.entered for visit in visits]
    is_right = entered == sorted(set(entered)) and (not entered or entered[0] == 0)
    refuse_unless(is_right, "visits.entered", "numbers that grow from 0", entered)
    expected = "visits, the last of a reading"
    is_right = bool(visits) == (sizes["readings"] > 0)
    refuse_unless(
        is_right and max(entered, default=-1) < max(sizes["readings"], 0),
        "visits",
        expected,
        entered,
    )


def _check_tree(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless the tree's maps fit the visits."""
    visits, config = visits_of(state), sizes["config"]
    maps, known = state["tree.visits"].shape[:2]
    refuse_unless((maps > 0) == (known > 0), "tree.visits", "visits of each map", known)
    # All but the last; and that as well if a later one turned out to be to no place.
    is_away = len(visits) > 1 and visits[-1].left >= 0
    expected = max(len(visits) - 1, 0)
    refuse_unless(
        known == expected or (is_away and known == len(visits)),
        "tree.visits",
        f"{expected} visits",
        known,
    )
    refuse_unless(maps <= config.tree.limit, "tree.visits", "maps within the limit", maps)
    if known:
        first = state["tree.visits"][:, 0, 0]
        refuse_unless(not first.any(), "tree.visits", "place 0 at the first visit", first)
    tree_of(state, config)


def _check_visit(visit: Visit, number: int, count: int) -> None:
    """Raise InputError unless a visit's gateways exist, and only the first begins at none."""
    gateways, is_last = len(visit.gateways), number == count - 1
    is_right = visit.arrived == -1 if number == 0 else 0 <= visit.arrived < gateways
    refuse_unless(is_right, "visits.arrived", f"a gateway of visit {number}", visit.arrived)
    is_right = all(0 <= arm < max(gateways, 1) for arm in visit.unknown)
    refuse_unless(is_right, "arms.before", f"gateways of visit {number}", visit.unknown)
    is_right = visit.left < gateways and (visit.left >= 0 or is_last)
    refuse_unless(is_right, "visits.left", f"a gateway of visit {number}", visit.left)
    widths = np.hypot(*(visit.gateways[:, 2:] - visit.gateways[:, :2]).T)
    refuse_unless((widths > 0).all(), "gateways.line", "lines of a length", visit.gateways)


RULES = (_check_visits, _check_tree)
