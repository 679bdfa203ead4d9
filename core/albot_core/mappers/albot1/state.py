"""All that a robot remembers as arrays by name, to be saved and restored.

The names are those of the saved files; the fields of the program may be called otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Bool

from albot_core.errors import InputError
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.perceptual_map.memory import (
    FREE,
    MAP_ROOM_AT_FIRST,
    NEXT_ID,
    NOT_RECOGNIZED,
    USED,
    VIEW_ROOM_AT_FIRST,
    VISIT,
    LocatedView,
    PerceptualMap,
    empty_map,
    empty_view,
    file_all,
    living,
)
from albot_core.mappers.albot1.perceptual_map.odometer_error import ROW, UNSIGNED
from albot_core.mappers.albot1.perceptual_map.viewing import SECTORS
from albot_core.mappers.albot1.places.exits import (
    CROSSING_EXPECTED,
    CROSSING_SEEN,
    MAX_EXITS,
    NOT_CROSSING,
    ExitMemory,
    empty_exits,
)
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.network_state import rebuilt_network, stored_network
from albot_core.mappers.stored_arrays import Shape, check_finite, check_lengths, check_shapes

STORED_ROWS = {
    "progress": "progress",
    "odometer": "odometers",
    "sectors": "sectors",
    "since": "since",
    "trod": "crumb_poses",
}
"""The fields of `BatchArrays` from which, with a robot's arrays, all others follow, by their names
in the state."""


def stored_arrays(
    pm: PerceptualMap, view: LocatedView, exits: ExitMemory, network: PlaceNetwork
) -> dict[str, np.ndarray]:
    """Copies of its arrays, as far as they are in use; `part.field` is each one's name."""
    parts = {
        "places": stored_network(network),
        "exits": stored_exits(exits),
        "memory": stored_map(pm),
        "view": stored_view(view),
    }
    return {f"{part}.{name}": a for part, arrays in parts.items() for name, a in arrays.items()}


def rebuilt_arrays(
    state: Mapping[str, np.ndarray], config: PlacesConfig
) -> tuple[PerceptualMap, LocatedView, ExitMemory, PlaceNetwork]:
    """What `stored_arrays` was given.

    Raises:
        InputError: The arrays contradict each other.
    """
    pm = rebuilt_map(_part(state, "memory."))
    view = rebuilt_view(_part(state, "view."), living(pm))
    exits = rebuilt_exits(_part(state, "exits."))
    network = rebuilt_network(_part(state, "places."), config)
    if len(network.visits) != pm.counts[VISIT] + 1:
        expected = f"the map's {pm.counts[VISIT]} visits"
        raise InputError("places.visits", expected, str(len(network.visits) - 1))
    return pm, view, exits, network


def check_rows(state: Mapping[str, np.ndarray]) -> None:
    """Check the arrays of STORED_ROWS.

    Raises:
        InputError: One of them is not what it should be.
    """
    progress = state["progress"]
    if progress.shape != (5,) or (progress < 0).any():
        raise InputError("progress", "5 counts", str(progress.tolist()))
    readings = state["readings"]
    if readings.shape != () or readings < 0:
        raise InputError("readings", "a count", str(readings.tolist()))
    odometer = state["odometer"]
    if (
        odometer.shape != (ROW,)
        or not np.isfinite(odometer).all()
        or (odometer[UNSIGNED] < 0).any()
    ):
        expected = "a mean square, a flag, a translation and a mean square"
        raise InputError("odometer", expected, str(odometer.tolist()))
    for name, size in (("since", 3), ("trod", 3), ("sectors", SECTORS)):
        if state[name].shape != (size,) or not np.isfinite(state[name]).all():
            raise InputError(name, f"{size} finite numbers", str(state[name].tolist()))


def _part(state: Mapping[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    """The arrays whose names begin with a prefix, without it."""
    return {
        name.removeprefix(prefix): array for name, array in state.items() if name.startswith(prefix)
    }


STORED_FIELDS = {
    "surfaces": "surfaces",
    "edges": "edges",
    "ids": "ids",
    "marks": "marks",
    "met_in": "reobserved_in",
    "met": "reobserved",
    "free": "free",
    "counts": "counts",
}
"""The fields of `PerceptualMap` from which it can be rebuilt, by their names in the state; its grid
follows from them."""


def stored_map(pm: PerceptualMap) -> dict[str, np.ndarray]:
    """Copies of the stored fields, as far as they are in use."""
    used, freed = pm.counts[USED], pm.counts[FREE]
    return {
        "surfaces": pm.surfaces[:used].copy(),
        "edges": pm.edges[:used].copy(),
        "ids": pm.ids[:used].copy(),
        "marks": pm.marks[:used].copy(),
        "met_in": pm.reobserved_in[:used].copy(),
        "met": pm.reobserved[: pm.counts[VISIT] + 1].copy(),
        "free": pm.free[:freed].copy(),
        "counts": pm.counts.copy(),
    }


def _filled_map(stored: Mapping[str, np.ndarray], capacity: int) -> PerceptualMap:
    pm = empty_map(capacity)
    for name, field in STORED_FIELDS.items():
        getattr(pm, field)[: len(stored[name])] = stored[name]
    file_all(pm)
    return pm


def enlarged_map(pm: PerceptualMap) -> PerceptualMap:
    """The same map with twice the room.

    Slots are used in the same order and the search sorts its answer: a map that has grown
    behaves exactly as one that was large from the start.
    """
    return _filled_map(stored_map(pm), 2 * len(pm.ids))


_MAP_SHAPES: dict[str, Shape] = {
    "surfaces": ("slots", 4),
    "edges": ("slots", 2),
    "ids": ("slots",),
    "marks": ("slots",),
    "met_in": ("slots",),
    "met": ("visits", 2),
    "free": ("freed",),
    "counts": (6,),
}


def rebuilt_map(stored: Mapping[str, np.ndarray]) -> PerceptualMap:
    """The map with the given fields.

    Raises:
        InputError: The fields contradict each other.
    """
    ids, counts = stored["ids"], stored["counts"]
    check_shapes(stored, _MAP_SHAPES, "memory.")
    check_lengths("memory.surfaces", stored["surfaces"])
    alive = ids >= 0
    expected = [alive.sum(), len(ids) - alive.sum(), counts[NEXT_ID], len(ids)]
    if counts[:VISIT].tolist() != expected:
        raise InputError("memory.counts", str(expected), str(counts.tolist()))
    visit, candidate = counts[VISIT:].tolist()
    if visit < 1 or not 0 <= candidate <= visit or len(stored["met"]) != visit + 1:
        found = f"{visit}, {candidate} and {stored['met'].shape}"
        raise InputError("memory.met", "a row for each visit up to the present one", found)
    if ((stored["marks"][alive] < 1) | (stored["marks"][alive] > visit)).any():
        raise InputError("memory.marks", f"visits from 1 to {visit}", "others")
    if not np.array_equal(np.sort(stored["free"]), np.flatnonzero(~alive)):
        raise InputError("memory.free", "exactly the slots without a surface", "others")
    surfaces = stored["surfaces"]
    if not (np.isfinite(surfaces[alive]).all() and np.isnan(surfaces[~alive]).all()):
        raise InputError("memory.surfaces", "finite surfaces, NaN in freed slots", "others")
    if len(np.unique(ids[alive])) != alive.sum() or (ids >= counts[NEXT_ID]).any():
        raise InputError("memory.ids", "every id once and below the next", "others")
    return _filled_map(stored, max(MAP_ROOM_AT_FIRST, len(ids), visit + 2))


VIEWED = ("surfaces", "edges", "landmark", "slots")
"""The fields of a view with one row a surface."""


def stored_view(view: LocatedView) -> dict[str, np.ndarray]:
    """Copies of a view's fields, as far as they are in use."""
    stored = {field: getattr(view, field)[: view.size[0]].copy() for field in VIEWED}
    return stored | {"pose": view.pose.copy()}


def rebuilt_view(stored: Mapping[str, np.ndarray], alive: Bool[np.ndarray, "slots"]) -> LocatedView:
    """The view with the given fields, whose landmarks are in slots of a map that hold a surface.

    Raises:
        InputError: The fields contradict each other or the map.
    """
    size = len(stored["slots"])
    view = empty_view(max(VIEW_ROOM_AT_FIRST, size))
    view.size[0] = size
    shapes: dict[str, Shape] = {field: (size, *getattr(view, field).shape[1:]) for field in VIEWED}
    check_shapes(stored, shapes | {"pose": (3,)}, "view.")
    for field in (*VIEWED, "pose"):
        getattr(view, field)[: len(stored[field])] = stored[field]
    if not np.isin(stored["slots"], (NOT_RECOGNIZED, *np.flatnonzero(alive))).all():
        raise InputError("view.slots", "slots of surfaces in the map", "others")
    check_finite(stored, "surfaces", "pose", prefix="view.")
    check_lengths("view.surfaces", stored["surfaces"])
    return view


def stored_exits(exits: ExitMemory) -> dict[str, np.ndarray]:
    """Copies of the fields, as far as they are in use."""
    return {
        "lines": exits.lines[: exits.counts[0]].copy(),
        "gate": exits.crossing.copy(),
        "counts": exits.counts[:2].copy(),
    }


def rebuilt_exits(stored: Mapping[str, np.ndarray]) -> ExitMemory:
    """The exits with the given fields.

    Raises:
        InputError: The fields contradict each other.
    """
    exits = empty_exits()
    lines, counts = stored["lines"], stored["counts"]
    if counts.shape != (2,) or counts.tolist() not in [
        [len(lines), crossing] for crossing in (NOT_CROSSING, CROSSING_SEEN, CROSSING_EXPECTED)
    ]:
        raise InputError("exits.counts", f"{len(lines)} and 0 to 2", str(counts.tolist()))
    check_shapes(stored, {"lines": ("exits", 4), "gate": (5,)}, "exits.")
    if len(lines) > MAX_EXITS:
        raise InputError("exits.lines", f"{MAX_EXITS} exits at most", str(len(lines)))
    check_finite(stored, "lines", "gate", prefix="exits.")
    check_lengths("exits.lines", lines)
    exits.lines[: len(lines)] = lines
    exits.crossing[:], exits.counts[:2] = stored["gate"], counts
    return exits
