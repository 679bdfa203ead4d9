"""Wayfinding over the network of places: exit by exit, one place at a time.

The thesis's third experiment (section 4.2.3) uses the network to know which exit comes next. The
search over it is ours (Dijkstra); its costs are the straight ways between a place's exits.
"""

from __future__ import annotations

import heapq
import math

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative, transform_points, transform_segments
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.place import LearnedPlace, middle

ExitStep = tuple[int, int]
"""A place's id, and the index of the exit to take."""

CROSSING = 0.5
"""Cost of going through an exit, in addition to the way to it (m): of two ways of equal length the
one through fewer exits is taken."""


def route(
    network: PlaceNetwork, pose: Pose, target: int, goal: Points | None = None
) -> list[ExitStep]:
    """Return the shortest way from the robot to a place: the exits to take, in order.

    Args:
        network: The network of places.
        pose: The robot's pose in the map.
        target: The id of the place to go to.
        goal: A point in that place, in its frame (m); without it the way ends at the place's exit.

    Returns:
        The exits; none if the robot is in that place, or no known way leads there.
    """
    if network.current == target:
        return []
    start = relative(network.frame, pose)[:2]
    queue: list[tuple[float, ExitStep, tuple[ExitStep, ...]]] = []
    _push(queue, network.here, start, 0.0, ())
    done: set[ExitStep] = set()
    while queue:
        cost, step, way = heapq.heappop(queue)
        place, index = step
        if place == target and index == -1:
            return list(way)
        if step in done:
            continue
        done.add(step)
        door = network.places[place].exits[index]
        there = network.places[door.leads_to]
        at = middle(there.exits[door.exit_there].line)
        if there.id == target:
            rest = 0.0 if goal is None else float(np.hypot(*(goal - at)))
            heapq.heappush(queue, (cost + CROSSING + rest, (target, -1), (*way, step)))
        elif there.id != place:
            _push(queue, there, at, cost + CROSSING, (*way, step))
    return []


def _push(
    queue: list[tuple[float, ExitStep, tuple[ExitStep, ...]]],
    place: LearnedPlace,
    at: Points,
    cost: float,
    way: tuple[ExitStep, ...],
) -> None:
    """Put the ways from a point in a place to each of its exits on the queue."""
    for index, door in enumerate(place.exits):
        away = float(np.hypot(*(middle(door.line) - at)))
        heapq.heappush(queue, (cost + away, (place.id, index), way))


def way_lines(network: PlaceNetwork, pose: Pose, target: int) -> Segments:
    """Return the exits on the way to a place, at their believed positions in the map (n, 4; m).

    Raises:
        InputError: There is no such place.
    """
    goal = np.zeros(2)
    lines = []
    for place_id, index in route(network, pose, _known(network, target), goal):
        place = network.places[place_id]
        frame = compose(network.map_to_graph, place.frame)
        lines.append(transform_segments(frame, place.exits[index].line[None])[0])
    return np.reshape(lines, (-1, 4)).astype(float)


def waypoint_home(network: PlaceNetwork, pose: Pose, walls: Segments) -> tuple[Points, float]:
    """Return the next point to drive to along the breadcrumbs home.

    Args:
        network: The network of places, with the breadcrumbs.
        pose: The robot's pose in the map.
        walls: The surfaces in view, in the robot's frame (m).

    Returns:
        The waypoint in the map's frame (m), NaN near home; and the length of the way home (m),
        infinite if no way leads home or the robot is lost.
    """
    here = network.in_graph_frame(pose)
    point, length = network.breadcrumbs.waypoint(network.current, here, walls)
    at = transform_points(network.map_to_graph, point)
    return at, np.inf if network.lost_since else length


def pointing(network: PlaceNetwork, pose: Pose, place: int) -> Float64[np.ndarray, "2"]:
    """Return a place's direction from the robot's heading (rad) and its distance (m).

    For the place that the robot set out from, the target is its starting point; for any other
    place, it is the point where the robot first entered it.

    Raises:
        InputError: There is no such place.
    """
    frame = network.places[_known(network, place)].frame
    x, y = relative(pose, compose(network.map_to_graph, frame))[:2]
    return np.array((math.atan2(y, x), math.hypot(x, y)))


def _known(network: PlaceNetwork, place: int) -> int:
    if place not in network.places:
        ids = ", ".join(map(str, sorted(network.places)))
        raise InputError("place", f"one of {ids}", str(place))
    return place
