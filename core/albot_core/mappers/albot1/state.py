"""A robot's memory as arrays by name, to be saved and restored.

The names are those of the saved files; the fields of the program may have other names.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.perceptual_map.memory import (
    COUNTED_FOR,
    FREE,
    MAP_ROOM_AT_FIRST,
    NOT_RECOGNIZED,
    USED,
    VIEW_ROOM_AT_FIRST,
    VISIT,
    LocatedView,
    PerceptualMap,
    empty_map,
    empty_view,
    file_all,
)
from albot_core.mappers.albot1.perceptual_map.odometer_error import ROW, UNSIGNED
from albot_core.mappers.albot1.perceptual_map.viewing import SECTORS
from albot_core.mappers.albot1.places.exits import (
    CROSSING_EXPECTED,
    MAX_EXITS,
    NOT_CROSSING,
    ExitMemory,
    empty_exits,
)
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.network_state import (
    NETWORK,
    rebuilt_network,
    stored_network,
)
from albot_core.mappers.schema import (
    LONGEST,
    Arrays,
    Field,
    Pack,
    Schema,
    Sizes,
    refuse_unless,
)


def _check_slots(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless each slot holds a surface that was seen, or is free."""
    ids, surfaces, visit = state["memory.ids"], state["memory.surfaces"], sizes["visit"]
    alive = ids >= 0
    count = int(alive.sum())
    expected = f"{count} surfaces"
    refuse_unless(sizes["alive"] == count, "memory.counts", expected, sizes["alive"])
    marks = state["memory.marks"][alive]
    is_right = ((marks >= 1) & (marks <= visit)).all()
    refuse_unless(is_right, "memory.marks", f"visits from 1 to {visit}")
    counted_for = state["memory.met"][:, COUNTED_FOR]
    is_right = ((counted_for >= 0) & (counted_for <= visit)).all()
    refuse_unless(is_right, "memory.met", f"surfaces that count for visits up to {visit}")
    is_right = np.array_equal(np.sort(state["memory.free"]), np.flatnonzero(~alive))
    refuse_unless(is_right, "memory.free", "exactly the slots without a surface")
    is_right = np.isfinite(surfaces[alive]).all() and np.isnan(surfaces[~alive]).all()
    refuse_unless(is_right, "memory.surfaces", "finite surfaces, NaN in freed slots")
    refuse_unless(len(np.unique(ids[alive])) == count, "memory.ids", "every id once")


def _check_view(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless the landmarks of the view are surfaces in the map."""
    known = np.flatnonzero(state["memory.ids"] >= 0)
    is_right = np.isin(state["view.slots"], (NOT_RECOGNIZED, *known)).all()
    refuse_unless(is_right, "view.slots", "slots of surfaces in the map")


MAP = Schema(
    Field("memory.surfaces", "slots 4", finite=False, lengths=(0, LONGEST)),
    Field("memory.edges", "slots 2", np.int8),
    Field("memory.ids", "slots", int, least=-1, below="next_id"),
    Field("memory.marks", "slots", np.int32),
    Field("memory.met_in", "slots", np.int32),
    Field("memory.met", "visit+1 3", np.int32),
    Field("memory.free", "freed", np.int32),
    Pack(
        "memory.counts",
        int,
        Field("alive"),
        Field("freed"),
        Field("next_id"),
        Field("slots"),
        Field("visit", least=1),
        Field("candidate", least=0, most="visit"),
    ),
    rules=(_check_slots,),
)
"""The fields of `PerceptualMap` from which it can be rebuilt; its grid follows from them."""
EXITS = Schema(
    Field("exits.lines", "exits 4", lengths=(0, LONGEST)),
    Field("exits.gate", "5"),
    Pack(
        "exits.counts",
        int,
        Field("exits", most=MAX_EXITS),
        Field("crossing", least=NOT_CROSSING, most=CROSSING_EXPECTED),
    ),
)
SCHEMA = Schema(
    Field("progress", "5", int, least=0),
    Field("readings", "", int, least=0),
    Field("odometer", f"{ROW}", least=tuple(0 if k in UNSIGNED else -math.inf for k in range(ROW))),
    Field("sectors", f"{SECTORS}"),
    Field("since", "3"),
    Field("trod", "3"),
    *MAP.fields,
    *EXITS.fields,
    Field("view.surfaces", "seen 4", lengths=(0, LONGEST)),
    Field("view.edges", "seen 2", np.int8),
    Field("view.landmark", "seen", bool),
    Field("view.slots", "seen", int),
    Field("view.pose", "3"),
    *NETWORK.fields,
    rules=(*MAP.rules, _check_view, *NETWORK.rules),
)
STORED_ROWS = {
    "progress": "progress",
    "readings": "readings",
    "odometer": "odometers",
    "sectors": "sectors",
    "since": "since",
    "trod": "crumb_poses",
}
"""The fields of `BatchArrays` that are stored, by their names in the state. All others follow from
them and the robot's arrays."""
_STORED_FIELDS = {"met_in": "reobserved_in", "met": "reobserved"}
"""The fields of `PerceptualMap` that have other names in the state, by these names."""


def stored_arrays(
    pm: PerceptualMap, view: LocatedView, exits: ExitMemory, network: PlaceNetwork
) -> Arrays:
    """Return the used part of a robot's arrays, by their names in the state."""
    viewed = {
        f"view.{name}": getattr(view, name)[: view.size[0]]
        for name in ("surfaces", "edges", "landmark", "slots")
    }
    parts = stored_map(pm), stored_exits(exits), stored_network(network)
    return {"view.pose": view.pose, **viewed, **parts[0], **parts[1], **parts[2]}


def rebuilt_arrays(
    state: Arrays, config: PlacesConfig
) -> tuple[PerceptualMap, LocatedView, ExitMemory, PlaceNetwork]:
    """Return the arguments of `stored_arrays`, from a state that has been checked."""
    size = len(state["view.slots"])
    view = empty_view(max(VIEW_ROOM_AT_FIRST, size))
    view.size[0], view.pose[:] = size, state["view.pose"]
    for name in ("surfaces", "edges", "landmark", "slots"):
        getattr(view, name)[:size] = state[f"view.{name}"]
    return rebuilt_map(state), view, rebuilt_exits(state), rebuilt_network(state, config)


def stored_map(pm: PerceptualMap) -> Arrays:
    """Return the used part of the map's stored fields, by their names in the state."""
    lengths = {"met": pm.counts[VISIT] + 1, "free": pm.counts[FREE], "counts": len(pm.counts)}
    stored = {}
    for field in MAP.fields:
        name = field.name.removeprefix("memory.")
        array = getattr(pm, _STORED_FIELDS.get(name, name))
        stored[field.name] = array[: lengths.get(name, pm.counts[USED])]
    return stored


def rebuilt_map(state: Arrays, capacity: int = MAP_ROOM_AT_FIRST) -> PerceptualMap:
    """Return the map with the given fields and a capacity of at least `capacity` surfaces."""
    pm = empty_map(max(capacity, len(state["memory.ids"]), len(state["memory.met"]) + 1))
    for field in MAP.fields:
        name = field.name.removeprefix("memory.")
        array = state[field.name]
        getattr(pm, _STORED_FIELDS.get(name, name))[: len(array)] = array
    file_all(pm)
    return pm


def enlarged_map(pm: PerceptualMap) -> PerceptualMap:
    """Return the same map with twice the capacity.

    Slots are used in the same order and the search sorts its result, so a map that has grown
    behaves exactly as one that was large from the start.
    """
    return rebuilt_map(stored_map(pm), 2 * len(pm.ids))


def stored_exits(exits: ExitMemory) -> Arrays:
    """Return the used part of the exits' stored fields, by their names in the state."""
    lines, counts = exits.lines[: exits.counts[0]], exits.counts[:2]
    return {"exits.lines": lines, "exits.gate": exits.crossing, "exits.counts": counts}


def rebuilt_exits(state: Arrays) -> ExitMemory:
    """Return the exits with the given fields."""
    exits, lines = empty_exits(), state["exits.lines"]
    exits.lines[: len(lines)] = lines
    exits.crossing[:], exits.counts[:2] = state["exits.gate"], state["exits.counts"]
    return exits
