"""The network of places at one moment, in the thesis's terms: places and their exits."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import relative, transform_points, transform_segments
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.maps.layers import PlaceEdge, PlaceGraph, PlaceNode


@dataclass(frozen=True, kw_only=True, eq=False)
class Exit:
    """An exit of a place, with its three values (Hossain 2014, section 4.1)."""

    line: Float64[np.ndarray, "4"]
    """Its ends x1, y1, x2, y2 in the place's frame (m). A robot that moves from the first end to
    the second has the place to its left."""
    leads_to: int
    """The id of the place to which the exit leads."""
    exit_there: int
    """The index of the same exit in that place's list."""

    @property
    def middle(self) -> Points:
        """The middle of the exit in the place's frame (m)."""
        return np.asarray(0.5 * (self.line[:2] + self.line[2:]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """A place: an inexact metric map with a frame of its own, and a list of exits."""

    id: int
    """The place's number; the number of a place merged into another is not used again."""
    frame: Pose
    """The pose of the place's frame in the map when the place was learned."""
    surfaces: Segments
    """The place's description: surfaces in its frame (m)."""
    exits: tuple[Exit, ...]
    """The place's exits, in the order of their indices."""
    visits: int = 1
    """Number of stays in the place so far."""

    @property
    def label(self) -> str:
        """The place's name: P1 is the first."""
        return f"P{self.id + 1}"

    @property
    def middle(self) -> Points:
        """The middle of its exits, or of its surfaces if it has no exit, in the map's frame."""
        points = [door.middle for door in self.exits]
        if not points and len(self.surfaces):
            points = [self.surfaces.reshape(-1, 2).mean(axis=0)]
        inside = np.mean(points, axis=0) if points else np.zeros(2)
        return transform_points(self.frame, inside)

    @property
    def placed_exits(self) -> Segments:
        """The lines across the place's exits in the map's frame (m)."""
        lines = np.reshape([door.line for door in self.exits], (-1, 4)).astype(float)
        return transform_segments(self.frame, lines)


@dataclass(frozen=True, kw_only=True, eq=False)
class Network:
    """The places and the exits that join them, at one moment."""

    places: tuple[Place, ...] = ()
    """The places, in the order of their ids."""
    current: int | None = None
    """The id of the place in which the robot believes to be; None if it knows no places."""
    home: int | None = None
    """The id of the place from which the robot set out."""
    familiar: bool = False
    """Whether the robot knows the present place from an earlier visit."""
    frame: Pose = field(default_factory=lambda: np.zeros(3))
    """Pose of the graph frame in the perceptual map's frame."""

    def place(self, place_id: int) -> Place:
        """Return the place with an id.

        Raises:
            KeyError: There is no such place.
        """
        for place in self.places:
            if place.id == place_id:
                return place
        raise KeyError(place_id)

    @property
    def links(self) -> tuple[tuple[int, int], ...]:
        """The pairs of ids (less, greater) of places joined by an exit, each once, in order."""
        pairs = {
            (min(place.id, door.leads_to), max(place.id, door.leads_to))
            for place in self.places
            for door in place.exits
        }
        return tuple(sorted(pair for pair in pairs if pair[0] != pair[1]))

    @property
    def place_graph(self) -> PlaceGraph:
        """The network as a layer of a map, in which each exit is an edge."""
        nodes = {
            place.id: PlaceNode(
                id=place.id,
                label=place.label,
                pose=place.frame,
                middle=place.middle,
                segments=place.surfaces,
                visits=place.visits,
            )
            for place in self.places
        }
        exits = [(place.id, door) for place in self.places for door in range(len(place.exits))]
        numbers = {door: number for number, door in enumerate(exits)}
        edges = tuple(
            PlaceEdge(
                source=place.id,
                target=door.leads_to,
                motion=relative(place.frame, nodes[door.leads_to].pose),
                doorway=door.line,
                reverse=numbers[door.leads_to, door.exit_there],
            )
            for place in self.places
            for door in place.exits
        )
        return PlaceGraph(
            nodes=tuple(nodes.values()),
            edges=edges,
            current=self.current,
            home=self.home,
            frame=self.frame,
        )
