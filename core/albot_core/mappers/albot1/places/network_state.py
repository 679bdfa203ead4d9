"""The network of places as arrays, to be saved and restored."""

from __future__ import annotations

import numpy as np

from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.places.events import EVENT_COLUMNS, Event, EventKind
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.place import LearnedExit, LearnedPlace
from albot_core.mappers.albot1.trail.breadcrumbs import Breadcrumbs, rebuilt_breadcrumbs
from albot_core.mappers.albot1.trail.path_tree import MIN_LINK
from albot_core.mappers.schema import (
    LONGEST,
    Arrays,
    Field,
    Pack,
    Schema,
    Sizes,
    refuse_unless,
)


def _check_places(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless all references to places are to known ones."""
    ids, visits = state["places.ids"].tolist(), state["places.visits"].tolist()
    refuse_unless(ids[:1] == [0], "places.ids", "ascending numbers from 0", ids)
    is_right = visits[:1] == [-1] and visits[-1] == sizes["current"] and {*visits[1:]} <= {*ids}
    expected = "visits to known places, the last to the present one"
    refuse_unless(is_right and sizes["current"] in ids, "places.visits", expected)
    firsts, stays = state["places.stays"].T
    is_right = firsts[:1].tolist() == [0] and (np.diff(firsts) >= 0).all() and {*stays} <= {*ids}
    refuse_unless(is_right, "places.stays", "first readings and known places, in order")
    next_id = sizes["next_place"]
    refuse_unless(next_id > max(ids), "places.standing", "the next id", next_id)
    is_right = np.isin(state["places.events"][:, 1], list(EventKind)).all()
    refuse_unless(is_right, "places.events", "known happenings")


def _check_trail(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless breadcrumbs are in known places, and links join two of them."""
    is_right = np.isin(state["places.trail"][:, 2], state["places.ids"]).all()
    refuse_unless(is_right, "places.trail", "points of known places")
    ends, lengths = state["places.trail_links"][:, :2], state["places.trail_links"][:, 2]
    is_right = ((ends >= 0) & (ends < sizes["points"]) & (ends % 1 == 0)).all()
    refuse_unless(is_right, "places.trail_links", f"pairs of {sizes['points']} points")
    is_right = ((lengths >= MIN_LINK) & (lengths <= LONGEST)).all()
    expected = f"lengths from {MIN_LINK:g} to {LONGEST:g} m"
    refuse_unless(is_right, "places.trail_links", expected)


def _check_links(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless every exit leads to an exit that leads back."""
    exits = zip(state["places.ids"].tolist(), state["places.sizes"][:, 1].tolist(), strict=True)
    doors = [(key, door) for key, count in exits for door in range(count)]
    leads_to = dict(zip(doors, map(tuple, state["places.links"].tolist()), strict=True))
    for door, there in leads_to.items():
        back = leads_to.get(there)
        refuse_unless(back == door, "places.links", f"an exit that leads back to {door}", back)


NETWORK = Schema(
    Field("places.ids", "places", int, rising=True, once=True),
    Field("places.frames", "places 3"),
    Field("places.sizes", "places 2", int, least=0, sums="surfaces doors"),
    Field("places.surfaces", "surfaces 4", lengths=(0, LONGEST)),
    Field("places.lines", "doors 4", lengths=(0, LONGEST)),
    Field("places.links", "doors 2", int),
    Field("places.visits", "visit+1", int),
    Field("places.displacements", "visit+1 3"),
    Field("places.stays", "stays 2", int),
    Pack(
        "places.standing",
        int,
        Field("current"),
        Field("next_place"),
        Field("lost_since", least=0, below="visit+1"),
        Field("last", least=-1, below="points"),
    ),
    Field("places.displacement", "3"),
    Field("places.leg", "3"),
    Field("places.looked_from", "looks 3"),
    Field("places.first_look", "first_looks 6"),
    Field("places.events", f"events {EVENT_COLUMNS}"),
    Field("places.trail", "points 5"),
    Field("places.trail_links", "links 3"),
    rules=(_check_places, _check_links, _check_trail),
)


def stored_network(network: PlaceNetwork) -> Arrays:
    """Return everything that the network holds, as arrays by name."""
    places = [network.places[key] for key in sorted(network.places)]
    exits = [door for place in places for door in place.exits]
    crumbs = network.breadcrumbs
    stored = {
        "ids": [place.id for place in places],
        "frames": [place.frame for place in places],
        "sizes": [(len(place.surfaces), len(place.exits)) for place in places],
        "surfaces": np.concatenate([place.surfaces for place in places]),
        "lines": [door.line for door in exits],
        "links": [(door.leads_to, door.exit_there) for door in exits],
        "visits": network.visits,
        "displacements": network.visit_transforms,
        "stays": network.stays,
        "standing": (network.current, network.next_id, network.lost_since, crumbs.last),
        "displacement": network.map_to_graph,
        "leg": [*network.leg_start, network.way_before],
        "looked_from": network.compared_from[None][~np.isnan(network.compared_from[:1])],
        "first_look": np.empty((0, 6)) if network.first_look is None else network.first_look[None],
        "events": [event.row() for event in network.log.events],
        "trail": np.column_stack((crumbs.points, crumbs.places, crumbs.last_used, crumbs.readings)),
        "trail_links": crumbs.tree.links,
    }
    return NETWORK.arrays({f"places.{name}": value for name, value in stored.items()})


def rebuilt_network(state: Arrays, config: PlacesConfig) -> PlaceNetwork:
    """Return the network from arrays that have been checked."""
    stored = {field.name.removeprefix("places."): state[field.name] for field in NETWORK.fields}
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
    if len(stored["first_look"]):
        network.first_look = stored["first_look"][-1].copy()
    network.log.events = [Event.of_row(row) for row in stored["events"]]
    return network


def _places(stored: Arrays) -> dict[int, LearnedPlace]:
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


def _breadcrumbs(stored: Arrays) -> Breadcrumbs:
    points, last = stored["trail"], int(stored["standing"][3])
    places, last_used, readings = points[:, 2:].T.astype(np.int64)
    return rebuilt_breadcrumbs(
        points[:, :2], places, last_used, readings, last, stored["trail_links"]
    )
