"""Experiment 1 of the Albot1 thesis: the map keeps the shape of the floor (section 3.2.1)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from albot_core.geometry.poses import relative
from albot_core.geometry.types import Points, Poses
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.mapper import Mapper
from albot_experiments.drawing import draw_map, draw_route
from albot_experiments.mapping import (
    MAPPERS,
    SHAPE_BOUND,
    MappedJourney,
    Shape,
    map_readings,
    median_and_worst,
    shape_of,
)
from albot_experiments.report import Figures, Report, each_seed, key
from albot_experiments.tours import Journey, guided_tour, true_motions
from albot_maps import World, load_world
from albot_maps.routes import Routes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ID = "albot1-e1"
TITLE = "The map computed (Hossain 2014, section 3.2.1, figures 3.14 and 3.15)"
PAPER = {"routes": 6, "shape_kept": True, "corridor_by_path_integration": True}
CORRIDOR = "P3"
"""A corridor with two side walls only, on the offices of the catalogue."""
_EQUAL = 1e-9
"""Motions that differ by less are the same (m, rad)."""
_OFTEN, _SELDOM = 0.1, 0.02
"""Landmarks fail in the corridor where they fail at this share of views, or more; and only
there where they fail elsewhere at this one, or less."""


@dataclass(frozen=True, kw_only=True)
class Route:
    """A way over a floor."""

    name: str
    world: str
    """The world's spec."""
    tour: str = ""
    """The world's own tour."""
    backwards: bool = False
    """The tour from its end to its beginning."""
    rooms: str = ""
    """Where there is no tour: the rooms to go through, joined by commas."""

    def waypoints(self, world: World) -> Points:
        """The way's corners (m)."""
        if self.rooms:
            return Routes(world).through_rooms(self.rooms.split(", "))
        return world.tours[self.tour][:: -1 if self.backwards else 1]


ROUTES = (
    Route(name="ring", world="office-ring", tour="single-loop"),
    Route(name="ring, backwards", world="office-ring", tour="single-loop", backwards=True),
    Route(name="double ring", world="office-double", tour="double-loop"),
    Route(
        name="rooms round the links",
        world="random:office:1001",
        rooms="link 1, meeting 1, meeting 2, office 1, meeting 3, office 2, meeting 4, link 4, "
        "meeting 10, meeting 9, office 6, meeting 7, link 1",
    ),
    Route(
        name="corridors",
        world="random:office:1001",
        rooms="corridor 1, office 5, link 3, office 8, corridor 2, office 9, link 1, meeting 5, "
        "corridor 1",
    ),
    Route(
        name="another floor",
        world="random:office:1002",
        rooms="link 2, office 5, office 11, office 12, office 18, office 16, meeting 2, "
        "office 13, office 8, office 7, office 1, office 3, link 2",
    ),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Trip:
    """A mapper's map of one journey along a route."""

    route: Route
    world: World
    journey: Journey
    mapped: MappedJourney
    shape: Shape

    @property
    def lost(self) -> np.ndarray:
        """(views,) bool: at which views no landmark was recognised."""
        return np.diff(self.mapped.watched, prepend=0) > 0

    @property
    def in_corridor(self) -> np.ndarray:
        """(views,) bool: which views were taken in the bare corridor."""
        return np.array(
            [self.world.room_at(x, y) == CORRIDOR for x, y in self.journey.truth[:, :2]]
        )

    def turn_errors(self) -> np.ndarray:
        """(views,): how far the turn that it believed in was from the true one (rad)."""
        return self._off(relative(self.mapped.poses[:-1], self.mapped.poses[1:]))

    def odometer_turn_errors(self) -> np.ndarray:
        """(views,): how far the turn that the odometer measured was from the true one (rad)."""
        return self._off(self._measured)

    def _off(self, motions: Poses) -> np.ndarray:
        off = relative(true_motions(self.journey)[1:], motions)
        return np.append(0.0, np.abs(off[:, 2]))

    @property
    def _measured(self) -> Poses:
        return np.array([reading.motion for reading in self.journey.readings[1:]])

    @property
    def by_odometer(self) -> np.ndarray:
        """(views,) bool: at which views it believed to have moved just as the odometer said."""
        believed = relative(self.mapped.poses[:-1], self.mapped.poses[1:])
        return np.append(True, np.abs(relative(self._measured, believed)).max(axis=1) < _EQUAL)


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Guide the robot along the routes, once a seed, and measure the shape of its maps.

    Raises:
        InputError: No seeds.
    """
    worlds = {route.name: load_world(route.world) for route in ROUTES}
    ways = {route.name: route.waypoints(worlds[route.name]) for route in ROUTES}
    trips: list[dict[str, Trip]] = []
    for seed in each_seed(seeds, progress):
        for route in ROUTES:
            world = worlds[route.name]
            journey = guided_tour(world, ways[route.name], np.random.default_rng(seed))
            trips.append({name: map_trip(name, route, world, journey) for name in MAPPERS})
    return _report(seeds, trips)


def map_trip(name: str, route: Route, world: World, journey: Journey) -> Trip:
    """Lead a mapper along a journey and measure its map."""
    mapped = map_readings(name, journey.readings, watch=_lost_views)
    shape = shape_of(mapped.mapper.snapshot().segments, mapped.poses, journey.truth, world.walls)
    return Trip(route=route, world=world, journey=journey, mapped=mapped, shape=shape)


def _lost_views(mapper: Mapper) -> int:
    """At how many views no landmark was recognised so far; 0 for mappers that recognise none."""
    return mapper.lost if isinstance(mapper, Albot1) else 0


def _report(seeds: range, trips: list[dict[str, Trip]]) -> Report:
    errors = {
        route.name: {
            name: [trip[name].shape.surface_error for trip in trips if trip[name].route is route]
            for name in MAPPERS
        }
        for route in ROUTES
    }
    kept = all(np.median(error["albot1"]) <= SHAPE_BOUND for error in errors.values())
    corridor = {
        name: _corridor([trip[name] for trip in trips if trip[name].in_corridor.any()])
        for name in MAPPERS[:2]
    }
    fell_back = all(
        of["lost_in_corridor"] >= _OFTEN and of["lost_elsewhere"] <= _SELDOM
        for of in corridor.values()
    )
    by_odometer = corridor["albot1-thesis"]["lost_by_odometer"] == 1.0
    measured: dict[str, Figures] = {
        "routes": len(ROUTES),
        "floors": len({route.world for route in ROUTES}),
        "shape_kept": kept,
        "corridor_by_path_integration": by_odometer,
    }
    measured |= {
        f"{key(name)}_surface_error_m": median_and_worst(
            [trip[name].shape.surface_error for trip in trips]
        )
        for name in MAPPERS
    }
    measured |= {
        route.name: _route([trip for trip in trips if trip["albot1"].route is route])
        for route in ROUTES
    }
    measured |= {f"bare corridor, {name}": figures for name, figures in corridor.items()}
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured | {"seeds": len(seeds)},
        holds=bool(kept and fell_back and by_odometer),
        text=_text(seeds),
        pictures={"maps": _picture(trips)},
    )


def _route(trips: list[dict[str, Trip]]) -> dict[str, Figures]:
    """The figures of one route, over the seeds."""
    journeys = [trip["albot1"].journey for trip in trips]
    figures: dict[str, Figures] = {
        "path_m": round(float(np.median([journey.path_length for journey in journeys])), 1),
        "views": int(np.median([len(journey.readings) for journey in journeys])),
        "albot1_updates": int(np.median([trip["albot1"].mapped.updates[-1] for trip in trips])),
    }
    for name in MAPPERS:
        shapes = [trip[name].shape for trip in trips]
        figures[f"{key(name)}_surface_error_m"] = median_and_worst(
            [shape.surface_error for shape in shapes]
        )
        figures[f"{key(name)}_path_error_m"] = median_and_worst(
            [shape.path_error for shape in shapes]
        )
    return figures


def _corridor(trips: list[Trip]) -> dict[str, float]:
    """What became of one mapper in the bare corridor, as shares of all its views."""
    lost = np.concatenate([trip.lost for trip in trips])
    inside = np.concatenate([trip.in_corridor for trip in trips])
    by_odometer = np.concatenate([trip.by_odometer for trip in trips])
    believed, measured = (
        np.concatenate([errors(trip) for trip in trips])
        for errors in (Trip.turn_errors, Trip.odometer_turn_errors)
    )
    return {
        "lost_in_corridor": _mean(lost[inside]),
        "lost_elsewhere": _mean(lost[~inside]),
        "lost_by_odometer": _mean(by_odometer[lost]),
        "turn_error_where_lost_deg": _mean(np.degrees(believed[lost])),
        "odometer_turn_error_there_deg": _mean(np.degrees(measured[lost])),
    }


def _mean(values: np.ndarray) -> float:
    """The mean, as a report holds it; 0 of nothing."""
    return round(float(values.mean()), 3) if len(values) else 0.0


def _text(seeds: range) -> str:
    ways = "\n".join(
        f"- {route.name}: `{route.world}`, "
        + (f"through {route.rooms}" if route.rooms else f"tour `{route.tour}`")
        + (" from its end" if route.backwards else "")
        for route in ROUTES
    )
    return f"""
A robot is guided start-stop, 1 m or 45° at a time, along six routes over four floors:

{ways}

The thesis judges the maps by eye. Here a map is laid on the floor by the rigid motion that
brings the believed path nearest to the true one; `surface_error_m` is then the median
distance from its surfaces to the nearest wall, `path_error_m` the root mean square distance of
the two paths. The shape counts as kept where the median over the seeds {seeds.start} to
{seeds.stop - 1} is at most {SHAPE_BOUND} m, the thickness of a wall, on every route; a floor
plan laid on itself askew has 0.5 to 0.8 m.

The corridor is `{CORRIDOR}` of the two catalogue floors. At the views where no landmark is
recognised `albot1-thesis` moves just as the odometer says. `albot1` recognises no landmark
there either, but the side walls, which it remembers, still correct its heading.
"""


def _picture(trips: list[dict[str, Trip]]) -> Figure:
    """Each route and beside it the map whose error is the median, as figures 3.14 and 3.15."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15, 12.5), layout="constrained")
    grid = figure.subplots(-(-len(ROUTES) // 2), 4).reshape(-1, 2)[: len(ROUTES)]
    for route, (left, right) in zip(ROUTES, grid, strict=True):
        ours = [trip["albot1"] for trip in trips if trip["albot1"].route is route]
        middle = sorted(ours, key=lambda trip: trip.shape.surface_error)[len(ours) // 2]
        draw_route(left, middle.world, middle.journey.truth[:, :2])
        left.set_title(f"{route.name}: {middle.journey.path_length:.0f} m", fontsize=10)
        mapped = middle.mapped
        draw_map(
            right, middle.world, mapped.mapper.snapshot().segments, mapped.poses, middle.shape.frame
        )
        right.set_title(f"albot1: {middle.shape.surface_error:.2f} m", fontsize=10)
    return figure
