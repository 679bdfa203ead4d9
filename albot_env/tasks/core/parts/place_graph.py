"""The part `place_graph`: the mapper's places around the robot and how they are connected."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

from albot_core.geometry.pose_kernels import length_of, rotate_back
from albot_core.geometry.types import Points, Poses
from albot_core.kernels.compiled import kernel
from albot_core.ranges import Range, check_fields
from albot_env.tasks.core.map_arrays import MapArrays
from albot_env.tasks.core.parts.beliefs import all_towards, observe_point
from albot_env.tasks.core.parts.part import GraphScratch, Need, ObservationPart, Sources
from albot_env.tasks.core.parts.scales import Scales, make_log_scale, scaled, unscaled

COLUMNS = 9
"""Number of numbers per place and per connection."""
_PLACES = Range("a whole number from 2 to 10,000", 2.0, 10_000.0, whole=True)
_CONNECTIONS = Range("a whole number from 0 to 10,000", 0.0, 10_000.0, whole=True)
VISITS = make_log_scale(1.0, 31.0)
"""The scale of visits."""


@dataclass(frozen=True, kw_only=True)
class PlaceGraphConfig:
    """Size of the part `place_graph`."""

    places: int = 32
    """Number of places that are shown: the present place, home, and the nearest."""
    connections: int = 64
    """Number of connections between them that are shown, the first."""

    def __post_init__(self) -> None:
        check_fields(self, _PLACES, "places")
        check_fields(self, _CONNECTIONS, "connections")


@dataclass(frozen=True, kw_only=True, eq=False)
class ObservedGraph:
    """The places around the robot, as far as they are shown, and the connections between them."""

    points: Points
    """Positions of the places: the present one and home, then the nearest (m, robot's frame)."""
    visits: Float64[np.ndarray, "places"]
    """Number of stays in each; 0 if the mapper does not count them."""
    is_current: Bool[np.ndarray, "places"]
    """Which is the present place."""
    is_home: Bool[np.ndarray, "places"]
    """Which is the place where the robot started."""
    ends: Int64[np.ndarray, "connections 2"]
    """Source and target of each connection: rows of `points`."""
    motions: Poses
    """Pose of the target's frame in the source's frame, of each connection (m, rad)."""


def _decode_place_graph(numbers: Float[np.ndarray, "rows 9"], scales: Scales) -> ObservedGraph:
    """Return the places and connections that are shown."""
    places, connections = numbers[: scales.graph.places], numbers[scales.graph.places :]
    places, connections = places[places[:, 0] > 0], connections[connections[:, 0] > 0]
    last = max(scales.graph.places - 1, 1)
    ends = np.rint((np.asarray(connections[:, 1:3], np.float64) + 1) * last / 2)
    turns = np.arctan2(connections[:, 7], connections[:, 6])
    steps = all_towards(connections[:, 3:6], scales)
    return ObservedGraph(
        points=all_towards(places[:, 1:4], scales),
        visits=np.array([round(unscaled(float(n), VISITS), 3) for n in places[:, 4]]),
        is_current=places[:, 5] > 0,
        is_home=places[:, 6] > 0,
        ends=ends.astype(np.int64),
        motions=np.concatenate((steps, turns[:, None]), axis=1),
    )


PLACE_GRAPH = ObservationPart(
    name="place_graph",
    numbers="(32 + 64) × 9",
    meaning=(
        "on request, with mappers that have a place graph: one row for each of 32 places, the "
        "present one and home, then the nearest (1, direction and distance, number of stays in "
        "it, whether it is the present place, whether it is home, 0, 0), then one for each of 64 "
        "connections between them (1, rows of source and target, direction and distance of the "
        "target's frame in the source's, cosine and sine of its heading, 0); rows that are not "
        "used are -1, 0, 0, …"
    ),
    shape=lambda sizes: (sizes.graph_rows, COLUMNS) if sizes.graph_rows else (0,),
    needs=frozenset((Need.MAP,)),
    decode=_decode_place_graph,
)


@kernel()
def fill_place_graph(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in the places around robot i and the connections between them."""
    maps, scales, scratch = sources.maps, sources.scales, sources.graph
    belief = sources.state.beliefs[i]
    size = scales.graph
    for k in range((size.places + size.connections) * COLUMNS):
        row[k] = np.float32(-1.0 if k % COLUMNS == 0 else 0.0)
    count = _nearest_places(i, maps, belief, scratch)
    cos, sin = math.cos(belief[2]), math.sin(belief[2])
    for k in range(count):
        place = maps.places.rows[i, scratch.shown[k]]
        begin = k * COLUMNS
        ahead, left = rotate_back(cos, sin, place[0] - belief[0], place[1] - belief[1])
        row[begin] = np.float32(1.0)
        observe_point(ahead, left, scales.home, row[begin + 1 : begin + 4])
        row[begin + 4] = scaled(place[2], VISITS)
        row[begin + 5] = np.float32(1.0 if scratch.shown[k] == maps.current[i] else -1.0)
        row[begin + 6] = np.float32(1.0 if scratch.shown[k] == maps.home[i] else -1.0)
    last, shown = max(size.places - 1, 1), 0
    for k in range(maps.ends.counts[i]):
        ends = maps.ends.rows[i, k]
        source, target = scratch.rows[ends[0]], scratch.rows[ends[1]]
        if source < 0 or target < 0 or shown == size.connections:
            continue
        begin, motion = (size.places + shown) * COLUMNS, maps.motions.rows[i, k]
        row[begin] = np.float32(1.0)
        row[begin + 1] = np.float32(2.0 * source / last - 1.0)
        row[begin + 2] = np.float32(2.0 * target / last - 1.0)
        observe_point(motion[0], motion[1], scales.home, row[begin + 3 : begin + 6])
        row[begin + 6] = np.float32(math.cos(motion[2]))
        row[begin + 7] = np.float32(math.sin(motion[2]))
        shown += 1


@kernel()
def _nearest_places(i: int, maps: MapArrays, belief: np.ndarray, scratch: GraphScratch) -> int:
    """Find the places of robot i that are shown, and return their number.

    The present place and home come first, then the nearest; places as far away as each other stand
    in the order of the graph.
    """
    most, count = scratch.shown.shape[0], 0
    for place in range(maps.places.counts[i]):
        scratch.rows[place] = -1
        x, y = maps.places.rows[i, place, 0], maps.places.rows[i, place, 1]
        away = length_of(x - belief[0], y - belief[1])
        if place == maps.current[i] or place == maps.home[i]:
            away = -1.0
        if count == most and away >= scratch.away[most - 1]:
            continue
        k = min(count, most - 1)
        while k > 0 and scratch.away[k - 1] > away:
            scratch.away[k], scratch.shown[k] = scratch.away[k - 1], scratch.shown[k - 1]
            k -= 1
        scratch.away[k], scratch.shown[k] = away, place
        count = min(count + 1, most)
    for k in range(count):
        scratch.rows[scratch.shown[k]] = k
    return count
