"""The network of places as arrays, to be saved and restored."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from albot_core.errors import InputError
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.places.events import EVENT_COLUMNS, Event, EventKind
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.place import LearnedExit, LearnedPlace
from albot_core.mappers.albot1.trail.breadcrumbs import Breadcrumbs, rebuilt_breadcrumbs
from albot_core.mappers.albot1.trail.path_tree import MIN_LINK
from albot_core.mappers.stored_arrays import (
    LONGEST,
    Shape,
    check_finite,
    check_lengths,
    check_shapes,
)

_SHAPES: dict[str, Shape] = {
    "ids": ("places",),
    "frames": ("places", 3),
    "sizes": ("places", 2),
    "surfaces": ("surfaces", 4),
    "lines": ("exits", 4),
    "links": ("exits", 2),
    "visits": ("visits",),
    "displacements": ("visits", 3),
    "stays": ("stays", 2),
    "standing": (4,),
    "displacement": (3,),
    "leg": (3,),
    "looked_from": ("looks", 3),
    "events": ("events", EVENT_COLUMNS),
    "trail": ("points", 5),
    "trail_links": ("links", 3),
}
"""The arrays and their shapes; names stand for lengths that must agree."""


def stored_network(network: PlaceNetwork) -> dict[str, np.ndarray]:
    """Everything that the network holds, as arrays by name."""
    places = [network.places[key] for key in sorted(network.places)]
    exits = [door for place in places for door in place.exits]
    crumbs = network.breadcrumbs
    return {
        "ids": np.array([place.id for place in places], np.int64),
        "frames": np.array([place.frame for place in places]),
        "sizes": np.array([(len(s.surfaces), len(s.exits)) for s in places], np.int64),
        "surfaces": np.concatenate([place.surfaces for place in places]),
        "lines": np.reshape([p.line for p in exits], (-1, 4)).astype(float),
        "links": np.reshape([(p.leads_to, p.exit_there) for p in exits], (-1, 2)).astype(np.int64),
        "visits": np.array(network.visits, np.int64),
        "displacements": np.array(network.visit_transforms),
        "stays": np.array(network.stays, np.int64),
        "standing": np.array(
            (
                network.current,
                network.next_id,
                network.lost_since,
                crumbs.last,
            ),
            np.int64,
        ),
        "displacement": network.map_to_graph.copy(),
        "leg": np.array([*network.leg_start, network.way_before]),
        "looked_from": network.compared_from[None][~np.isnan(network.compared_from[:1])],
        "events": np.array([event.row() for event in network.log.events]),
        "trail": np.column_stack((crumbs.points, crumbs.places, crumbs.last_used, crumbs.readings)),
        "trail_links": crumbs.tree.links,
    }


def rebuilt_network(stored: Mapping[str, np.ndarray], config: PlacesConfig) -> PlaceNetwork:
    """The network with the given arrays.

    Raises:
        InputError: The arrays contradict each other.
    """
    check_shapes(stored, _SHAPES, "places.")
    check_finite(stored, *_SHAPES, prefix="places.")
    for name in ("surfaces", "lines"):
        check_lengths(f"places.{name}", stored[name])
    _check_places(stored)
    network = PlaceNetwork(config)
    network.places = _places(stored)
    network.visits = stored["visits"].tolist()
    network.visit_transforms = list(stored["displacements"].copy())
    network.stays = [(first, place) for first, place in stored["stays"].tolist()]
    standing = stored["standing"].tolist()
    network.current, network.next_id, network.lost_since = standing[:3]
    network.breadcrumbs = _breadcrumbs(stored)
    network.map_to_graph = stored["displacement"].copy()
    network.leg_start, network.way_before = stored["leg"][:2].copy(), float(stored["leg"][2])
    if len(stored["looked_from"]):
        network.compared_from = stored["looked_from"][-1].copy()
    network.log.events = [Event.of_row(row) for row in stored["events"]]
    return network


def _places(stored: Mapping[str, np.ndarray]) -> dict[int, LearnedPlace]:
    places: dict[int, LearnedPlace] = {}
    first, first_exit = 0, 0
    for key, frame, (surfaces, exits) in zip(
        stored["ids"].tolist(), stored["frames"], stored["sizes"].tolist(), strict=True
    ):
        own = slice(first_exit, first_exit + exits)
        doors = [
            LearnedExit(line=line.copy(), leads_to=leads_to, exit_there=there)
            for line, (leads_to, there) in zip(
                stored["lines"][own], stored["links"][own].tolist(), strict=True
            )
        ]
        seen = stored["surfaces"][first : first + surfaces].copy()
        places[key] = LearnedPlace(id=key, frame=frame.copy(), surfaces=seen, exits=doors)
        first, first_exit = first + surfaces, first_exit + exits
    return places


def _breadcrumbs(stored: Mapping[str, np.ndarray]) -> Breadcrumbs:
    points, last = stored["trail"], int(stored["standing"][3])
    places, last_used, readings = points[:, 2:].T.astype(np.int64)
    return rebuilt_breadcrumbs(
        points[:, :2], places, last_used, readings, last, stored["trail_links"]
    )


def _check_places(stored: Mapping[str, np.ndarray]) -> None:
    ids, sizes = stored["ids"].tolist(), stored["sizes"]
    totals = [len(stored["surfaces"]), len(stored["lines"])]
    if ids[:1] != [0] or sorted(set(ids)) != ids:
        raise InputError("places.ids", "ascending numbers from 0", str(ids))
    if (sizes < 0).any() or sizes.sum(axis=0).tolist() != totals:
        raise InputError("places.sizes", f"counts that add up to {totals}", "others")
    _check_links(ids, sizes[:, 1].tolist(), stored["links"].tolist())
    _check_breadcrumbs(ids, stored)
    current, next_id, lost_since, _ = stored["standing"].tolist()
    visits = stored["visits"].tolist()
    known = current in ids and set(visits[1:]) <= set(ids)
    if not known or visits[:1] != [-1] or visits[-1] != current:
        raise InputError(
            "places.visits", "visits to known places, the last to the present one", "others"
        )
    firsts, stays = stored["stays"].T
    if not (
        len(stays) and firsts[0] == 0 and (np.diff(firsts) >= 0).all() and set(stays) <= set(ids)
    ):
        raise InputError("places.stays", "first readings and known places, in order", "others")
    if next_id <= max(ids) or not 0 <= lost_since < len(visits):
        raise InputError("places.standing", "the next id and a visit", f"{next_id}, {lost_since}")
    kinds = stored["events"][:, 1]
    if not np.isin(kinds, list(EventKind)).all():
        raise InputError("places.events", "known happenings", "others")


def _check_breadcrumbs(ids: list[int], stored: Mapping[str, np.ndarray]) -> None:
    points, ends = len(stored["trail"]), stored["trail_links"][:, :2]
    last = int(stored["standing"][3])
    if not (np.isin(stored["trail"][:, 2], ids).all() and -1 <= last < points):
        raise InputError("places.trail", "points of known places", "others")
    lengths = stored["trail_links"][:, 2]
    if ((ends < 0) | (ends >= points) | (ends % 1 != 0)).any():
        raise InputError("places.trail_links", f"pairs of {points} points", "others")
    if ((lengths < MIN_LINK) | (lengths > LONGEST)).any():
        expected = f"lengths from {MIN_LINK:g} to {LONGEST:g} m"
        raise InputError("places.trail_links", expected, "others")


def _check_links(ids: list[int], exits: list[int], links: list[list[int]]) -> None:
    """Raise InputError unless every exit leads to one that leads back."""
    doors = [(key, door) for key, count in zip(ids, exits, strict=True) for door in range(count)]
    leads_to = dict(zip(doors, ((key, door) for key, door in links), strict=True))
    for door, there in leads_to.items():
        if leads_to.get(there) != door:
            raise InputError(
                "places.links", f"an exit that leads back to {door}", f"{leads_to.get(there)}"
            )
