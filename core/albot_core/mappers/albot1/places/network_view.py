"""The network of places in the thesis's terms, as it is at one moment: places and their exits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import relative, transform_points, transform_segments
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.maps.layers import PlaceEdge, PlaceGraph, PlaceNode


@dataclass(frozen=True, kw_only=True, eq=False)
class Exit:
    """An exit of a place, with its three values (Hossain 2014, section 4.1)."""

    line: Float64[np.ndarray, "4"]
    """Its whereabouts in this place: x1, y1, x2, y2 in the place's frame (m). A
    robot that goes from the first end to the second has the place to its left."""
    leads_to: int
    """The id of the place it leads to."""
    exit_there: int
    """Which exit of that place it is."""

    @property
    def middle(self) -> Points:
        """Its middle in the place's frame (m)."""
        return np.asarray(0.5 * (self.line[:2] + self.line[2:]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """A place: an inexact metric map with a frame of its own, and a list of exits."""

    id: int
    """Its number; that of a place found to be another is not used again."""
    frame: Pose
    """Where its frame lay in the map when the place was learned."""
    surfaces: Segments
    """Its description: surfaces in its frame (m)."""
    exits: tuple[Exit, ...]
    """Its exits; they are known by their place in this row."""

    @property
    def label(self) -> str:
        """What it is called: P1 is the first."""
        return f"P{self.id + 1}"

    @property
    def middle(self) -> Points:
        """The middle of its exits, or of its surfaces where it has none, in the map's frame."""
        points = [door.middle for door in self.exits]
        if not points and len(self.surfaces):
            points = [self.surfaces.reshape(-1, 2).mean(axis=0)]
        inside = np.mean(points, axis=0) if points else np.zeros(2)
        return transform_points(self.frame, inside)

    @property
    def placed_exits(self) -> Segments:
        """The lines across its exits in the map's frame (m)."""
        lines = np.reshape([door.line for door in self.exits], (-1, 4)).astype(float)
        return transform_segments(self.frame, lines)


@dataclass(frozen=True, kw_only=True, eq=False)
class Network:
    """Places, and which of them exits join, at one moment."""

    places: tuple[Place, ...] = ()
    """The places, in the order of their ids."""
    current: int | None = None
    """The id of the place that the robot believes to be in; None where it knows no places."""
    home: int | None = None
    """The id of the place that it set out from."""
    familiar: bool = False
    """Whether the robot knows the present place from an earlier visit."""

    def place(self, place_id: int) -> Place:
        """The place of an id.

        Raises:
            KeyError: There is none.
        """
        for place in self.places:
            if place.id == place_id:
                return place
        raise KeyError(place_id)

    @property
    def links(self) -> tuple[tuple[int, int], ...]:
        """The pairs of ids (less, greater) of places that an exit joins, each once, in order."""
        pairs = {
            (min(place.id, door.leads_to), max(place.id, door.leads_to))
            for place in self.places
            for door in place.exits
        }
        return tuple(sorted(pair for pair in pairs if pair[0] != pair[1]))

    @property
    def place_graph(self) -> PlaceGraph:
        """The network as a layer of a map; each exit is an edge."""
        nodes = {
            place.id: PlaceNode(
                id=place.id,
                label=place.label,
                pose=place.frame,
                middle=place.middle,
                segments=place.surfaces,
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
            nodes=tuple(nodes.values()), edges=edges, current=self.current, home=self.home
        )
