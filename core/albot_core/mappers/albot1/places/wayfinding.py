"""Finding the way over the network of places: exit by exit, one place at a time.

The thesis's third experiment (section 4.2.3) uses the network to know which exit comes next;
the search over it is ours (Dijkstra), with the straight ways between a place's exits as cost.
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
"""A place, and which of its exits to take."""

CROSSING = 0.5
"""What going through an exit costs on top of the way to it (m): of two ways of one length the
one through fewer exits is taken."""


def route(
    network: PlaceNetwork, pose: Pose, target: int, goal: Points | None = None
) -> list[ExitStep]:
    """The shortest way from where the robot is to a place: the exits to take, in order.

    Args:
        network: The network of places.
        pose: Where the robot is in the map.
        target: The id of the place to go to.
        goal: Where in that place, in its frame (m); without it the way ends at its door.

    Returns:
        The steps; none where the robot is in that place, or no known way leads there.
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
    """The exits on the way to a place, where they are believed to be in the map (n, 4; m).

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
    """Where to drive next along the breadcrumbs home.

    Args:
        network: The network of places, with the breadcrumbs.
        pose: Where the robot is in the map.
        walls: The surfaces in view, in its own frame (m).

    Returns:
        The waypoint in the map's frame (m), NaN near home; and the length of the way home (m),
        infinite where none leads home, or the robot was moved.
    """
    here = network.in_graph_frame(pose)
    point, length = network.breadcrumbs.waypoint(network.current, here, walls)
    at = transform_points(network.map_to_graph, point)
    return at, np.inf if network.lost_since else length


def pointing(network: PlaceNetwork, pose: Pose, place: int) -> Float64[np.ndarray, "2"]:
    """Where a place is: its direction from the robot's heading (rad) and its distance (m).

    For the place that the robot set out from, that is where it stood; for another, the point
    at which the robot first entered it.

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
