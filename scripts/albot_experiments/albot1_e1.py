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
from albot_experiments.albot1_conditions import thesis_conditions
from albot_experiments.drawing import draw_map, draw_route, finish_maps
from albot_experiments.mapping import (
    ALBOT1,
    LARGEST_PATH_ERROR,
    LEAST_PRECISION,
    LEAST_RECALL,
    MAPPERS,
    WITHIN,
    MappedJourney,
    Shape,
    Walls,
    is_kept,
    map_readings,
    shape_figures,
    shape_of,
    surface_points,
)
from albot_experiments.report import Figures, Report, compared, each_seed
from albot_experiments.tours import TourRecord, guided_tour, true_motions
from albot_maps import World, load_world
from albot_maps.routes import Routes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ID = "albot1-e1"
TITLE = "The map computed (Hossain 2014, section 3.2.1, figures 3.14 and 3.15)"
PAPER = {"routes": 6, "shape_kept": True, "corridor_by_path_integration": True}
CONDITIONS = thesis_conditions(
    "catalogue floors `office-ring`, `office-double`, two random offices",
    ("start-stop, usually 1 m or 45°", "start-stop, 1 m or 45°"),
    ("6 routes, once each", "6 routes, 100 seeds each"),
)
CORRIDOR = "P3"
"""A corridor with only two side walls, on the offices of the catalogue."""
_EQUAL = 1e-9
"""Motions that differ by less than this are the same (m, rad)."""
_OFTEN, _SELDOM = 0.1, 0.02
"""Landmarks fail in the corridor if no landmark is recognised at this share of views or more; and
they fail only there if elsewhere this happens at the second share or less."""


@dataclass(frozen=True, kw_only=True)
class Route:
    """A route over a floor."""

    name: str
    world: str
    """The world's spec."""
    tour: str = ""
    """A tour of the world."""
    backwards: bool = False
    """Whether to follow the tour from its end to its beginning."""
    rooms: str = ""
    """The rooms to go through, joined by commas, if there is no tour."""

    def waypoints(self, world: World) -> Points:
        """Return the route's corners (m)."""
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
    journey: TourRecord
    mapped: MappedJourney
    shape: Shape

    @property
    def lost(self) -> np.ndarray:
        """(views,) bool: the views at which no landmark was recognised."""
        return np.diff(self.mapped.watched, prepend=0) > 0

    @property
    def in_corridor(self) -> np.ndarray:
        """(views,) bool: the views taken in the bare corridor."""
        return np.array(
            [self.world.room_at(x, y) == CORRIDOR for x, y in self.journey.truth[:, :2]]
        )

    def turn_errors(self) -> np.ndarray:
        """Return the errors of the believed turns, (views,) (rad)."""
        return self._off(relative(self.mapped.poses[:-1], self.mapped.poses[1:]))

    def odometer_turn_errors(self) -> np.ndarray:
        """Return the errors of the turns measured by the odometer, (views,) (rad)."""
        return self._off(self._measured)

    def _off(self, motions: Poses) -> np.ndarray:
        off = relative(true_motions(self.journey)[1:], motions)
        return np.append(0.0, np.abs(off[:, 2]))

    @property
    def _measured(self) -> Poses:
        return np.array([reading.motion for reading in self.journey.readings[1:]])

    @property
    def by_odometer(self) -> np.ndarray:
        """(views,) bool: the views at which the believed motion was exactly the odometer's."""
        believed = relative(self.mapped.poses[:-1], self.mapped.poses[1:])
        return np.append(True, np.abs(relative(self._measured, believed)).max(axis=1) < _EQUAL)


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Guide the robot along the routes, once per seed, and measure the shape of its maps.

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


def map_trip(name: str, route: Route, world: World, journey: TourRecord) -> Trip:
    """Lead a mapper along a journey and measure its map."""
    mapped = map_readings(name, journey.readings, watch=_lost_views)
    walls = Walls.of_journey(world.walls, journey.readings, journey.truth)
    points = surface_points(mapped.mapper.snapshot().segments)
    shape = shape_of(points, mapped.poses, journey.truth, walls)
    return Trip(route=route, world=world, journey=journey, mapped=mapped, shape=shape)


def _lost_views(mapper: Mapper) -> int:
    """Return the number of views without a landmark so far; 0 for mappers without landmarks."""
    return mapper.lost if isinstance(mapper, Albot1) else 0


def _report(seeds: range, trips: list[dict[str, Trip]]) -> Report:
    corridor = {
        name: _corridor([trip[name] for trip in trips if trip[name].in_corridor.any()])
        for name in ALBOT1
    }
    kept = {name: all(is_kept(_shapes(trips, name, route)) for route in ROUTES) for name in MAPPERS}
    by_odometer = corridor["albot1-thesis"]["lost_by_odometer"] == 1.0
    fell_back = {
        name: of["lost_in_corridor"] >= _OFTEN and of["lost_elsewhere"] <= _SELDOM
        for name, of in corridor.items()
    }
    verdicts = {name: kept[name] and fell_back[name] for name in ALBOT1}
    overall: dict[str, Figures] = {
        name: {
            "shape_kept": kept[name],
            "routes_kept": sum(is_kept(_shapes(trips, name, route)) for route in ROUTES),
            **shape_figures([trip[name].shape for trip in trips]),
        }
        for name in MAPPERS
    }
    measured: dict[str, Figures] = {
        "routes": len(ROUTES),
        "floors": len({route.world for route in ROUTES}),
        "shape_kept": kept["albot1"],
        "corridor_by_path_integration": by_odometer,
        "seeds": len(seeds),
        **overall,
    }
    for route in ROUTES:
        measured |= {
            f"{route.name}, {name}": _route([trip[name] for trip in trips], route)
            for name in MAPPERS
        }
    measured |= {f"bare corridor, {name}": figures for name, figures in corridor.items()}
    names = "path_error_m", "wall_precision", "wall_recall", "routes_kept"
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=bool(verdicts["albot1"] and by_odometer),
        verdicts=verdicts,
        compared=compared(measured, MAPPERS, names),
        conditions=CONDITIONS,
        text=_text(seeds),
        pictures={"maps": _picture(trips)},
    )


def _shapes(trips: list[dict[str, Trip]], name: str, route: Route) -> list[Shape]:
    """Return the shapes of one mapper's maps of one route, over the seeds."""
    return [trip[name].shape for trip in trips if trip[name].route is route]


def _route(trips: list[Trip], route: Route) -> dict[str, Figures]:
    """Return the figures of one mapper on one route, over the seeds."""
    along = [trip for trip in trips if trip.route is route]
    return {
        "path_m": round(float(np.median([trip.journey.path_length for trip in along])), 1),
        "views": int(np.median([len(trip.journey.readings) for trip in along])),
        "updates": int(np.median([trip.mapped.updates[-1] for trip in along])),
        **shape_figures([trip.shape for trip in along]),
    }


def _corridor(trips: list[Trip]) -> dict[str, float]:
    """Return the figures of one mapper in the bare corridor, as shares of all its views."""
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
    """Return the rounded mean; 0 for no values."""
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
brings the believed path nearest to the true one.

- `wall_precision`: share of the length of what the map remembers that lies within {WITHIN} m of a
  wall; `wall_recall`: share of the length of the walls seen that it holds as near.
- `path_error_m`: root mean square distance of the two paths.

The shape counts as kept where on every route the medians over the seeds {seeds.start} to
{seeds.stop - 1} are a precision of {LEAST_PRECISION} or more, a recall of {LEAST_RECALL} or more,
for the map is incomplete by intent, and a path error of {LARGEST_PATH_ERROR} m at most, half the
width of a corridor. A mapper reaches it if besides it finds no landmark at {_OFTEN:.0%} of the
views in the bare corridor, `{CORRIDOR}` of the two catalogue floors, or more, and elsewhere at
{_SELDOM:.0%} or fewer. Places are left out (chapter 4): no exit forces an update.

At the views without a landmark `albot1-thesis` moves just as the odometer says, and
`albot1-tracked` but for the turn, which it searches. `albot1` recognises no landmark there either,
but the side walls, which it remembers, still correct its heading.
"""


def _picture(trips: list[dict[str, Trip]]) -> Figure:
    """Draw each route, and its maps of the seed with albot1's median error (figure 3.14)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(16, 4 * len(ROUTES)), layout="constrained")
    grid = figure.subplots(len(ROUTES), 1 + len(ALBOT1), squeeze=False)
    for route, (first, *others) in zip(ROUTES, grid, strict=True):
        along = [trip for trip in trips if trip["albot1"].route is route]
        middle = sorted(along, key=lambda trip: trip["albot1"].shape.path_error)[len(along) // 2]
        journey = middle["albot1"].journey
        draw_route(first, middle["albot1"].world, journey.truth[:, :2])
        first.set_title(f"{route.name}: {journey.path_length:.0f} m", fontsize=10)
        for axes, name in zip(others, ALBOT1, strict=True):
            trip = middle[name]
            surfaces = trip.mapped.mapper.snapshot().segments
            draw_map(axes, trip.world, surfaces, trip.mapped.poses, trip.shape.frame)
            axes.set_title(f"{name}: path {trip.shape.path_error:.2f} m off", fontsize=10)
    finish_maps(figure)
    return figure
