"""Checks of maps: whatever layers a snapshot has, its numbers are finite and its graph is sound."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from albot_core.maps.layers import (
    Layer,
    MapSnapshot,
    OccupancyGridLayer,
    ParticlesLayer,
    PlaceEdge,
    PlaceGraph,
    SegmentsLayer,
    TrajectoryLayer,
)

MOST_SURFACES = 20_000
"""Maximum number of surfaces of a map: a scan has 181 beams, and most of what it shows is known."""
FARTHEST = 1e5
"""Maximum coordinate of a map (m), far beyond where any robot drives."""


def check_map(snapshot: MapSnapshot) -> list[str]:
    """Check that a map's layers are finite and bounded; return what is wrong, in lines."""
    return [line for layer in snapshot.layers for line in _check_layer(layer)]


def check_places(graph: PlaceGraph, *, lost: bool = False) -> list[str]:
    """Check that a graph of places is consistent.

    All ends of connections are places; a connection and its reverse lead the two ways between the
    same places, each being the other's reverse; a doorway is a line; and each place but the first
    and the home can be entered from another one.

    Args:
        graph: The graph.
        lost: Whether the robot is lost. Where it was carried to, it begins a new place, into which
            no way leads until it knows where that is.
    """
    ids = [node.id for node in graph.nodes]
    wrong = [
        f"the place {id_} is there twice" for id_ in sorted({k for k in ids if ids.count(k) > 1})
    ]
    known = set(ids)
    for name, place in (("current", graph.current), ("home", graph.home)):
        if place is not None and place not in known:
            wrong.append(f"the {name} place {place} is none of {len(ids)} places")
    for index, edge in enumerate(graph.edges):
        wrong += _check_edge(index, edge, graph.edges, known)
    entered = {edge.target for edge in graph.edges if edge.source != edge.target}
    begun = {graph.home, *ids[:1]}
    if not lost:
        wrong += [f"no way leads into the place {k}" for k in ids if k not in entered | begun]
    return wrong


def _check_edge(
    index: int, edge: PlaceEdge, edges: tuple[PlaceEdge, ...], places: set[int]
) -> Iterable[str]:
    """Yield what is wrong with a connection."""
    name = f"the connection {index} from {edge.source} to {edge.target}"
    for end in {edge.source, edge.target} - places:
        yield f"{name}: there is no place {end}"
    if not np.isfinite(edge.motion).all():
        yield f"{name}: its motion is {edge.motion.tolist()}"
    if edge.doorway is not None and not np.isfinite(edge.doorway).all():
        yield f"{name}: its doorway is {edge.doorway.tolist()}"
    if edge.reverse is None:
        return
    if not 0 <= edge.reverse < len(edges):
        yield f"{name}: its reverse is number {edge.reverse} of {len(edges)}"
        return
    back = edges[edge.reverse]
    if (back.source, back.target) != (edge.target, edge.source):
        yield f"{name}: its reverse leads from {back.source} to {back.target}"
    elif back.reverse != index:
        yield f"{name}: the reverse of its reverse is {back.reverse}"


def _check_layer(layer: Layer) -> Iterable[str]:
    """Yield what is wrong with the numbers of a layer."""
    if isinstance(layer, SegmentsLayer):
        if len(layer.segments) > MOST_SURFACES:
            yield f"the map has {len(layer.segments)} surfaces"
        yield from _check_numbers("surface", layer.segments)
    elif isinstance(layer, OccupancyGridLayer):
        yield from _check_numbers("grid's origin", np.atleast_2d(layer.origin))
        known = layer.occupancy[~np.isnan(layer.occupancy)]
        if not ((known >= 0) & (known <= 1)).all():
            yield "the grid has a cell whose occupancy is no probability"
    elif isinstance(layer, ParticlesLayer):
        yield from _check_numbers("particle", layer.poses)
        total = float(layer.weights.sum())
        if not (layer.weights >= 0).all() or abs(total - 1) > 1e-6:
            yield f"the particles' weights are negative, or add up to {total:.9g}"
    elif isinstance(layer, TrajectoryLayer):
        yield from _check_numbers("pose of the trajectory", layer.poses)
    else:
        for node in layer.nodes:
            yield from _check_numbers(f"pose of place {node.id}", np.atleast_2d(node.pose))
            yield from _check_numbers(f"middle of place {node.id}", np.atleast_2d(node.middle))
            yield from _check_numbers(f"surface of place {node.id}", node.segments)


def _check_numbers(name: str, rows: np.ndarray) -> Iterable[str]:
    """Yield the first row that is not finite or is too far away."""
    wrong = np.flatnonzero(~(np.abs(rows) <= FARTHEST).all(axis=1))
    if len(wrong):
        yield f"the {name} ({wrong[0]} of {len(rows)}) is {rows[wrong[0]].tolist()}"
