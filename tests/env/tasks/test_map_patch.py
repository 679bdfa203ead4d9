"""The map as observed: what patches show of a map that is known, and where numbers come from."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, transform_points, transform_segments
from albot_core.mappers.registry import mapper_spec
from albot_core.maps.layers import (
    MapSnapshot,
    OccupancyGridLayer,
    PlaceEdge,
    PlaceGraph,
    PlaceNode,
    SegmentsLayer,
    TrajectoryLayer,
)
from albot_core.sensing.reading import LaserGeometry
from albot_env.tasks.core.map_arrays import MapReader, TrailConfig, thinned, thinned_trail
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.observation_builder import ObservationBuilder
from albot_env.tasks.core.parts.map_patch import (
    CHANNELS,
    MAP_PATCH,
    MapPatchConfig,
    channels_of,
    draw_line,
)
from albot_env.tasks.core.parts.place_graph import PLACE_GRAPH, PlaceGraphConfig
from albot_env.tasks.core.state import BatchState
from albot_env.tasks.explore.env import ExploreEnv
from albot_env.tasks.explore.task import ExploreConfig
from albot_maps import World

CONFIG = ObservationConfig(
    parts=("map_patch", "place_graph"),
    map_patch=MapPatchConfig(sides=(8.0, 40.0), cells=16),
    place_graph=PlaceGraphConfig(places=4, connections=3),
)
TRAIL = TrailConfig(0.5, 8)


class Drawn:
    """A mapper batch of one robot, whose map is what a test says it is."""

    def __init__(self, layers: MapSnapshot, name: str = "albot1") -> None:
        self.layers, self.spec = layers, mapper_spec(name)
        self.map_versions = np.ones(1, np.int64)

    def snapshot(self, row: int) -> MapSnapshot:
        assert row == 0
        return self.layers


def believed(pose: Any = (0.0, 0.0, 0.0), home: Any = (0.0, 0.0, 0.0)) -> BatchState:
    """The state of one robot that believes to be at a pose and home to be at another."""
    return BatchState(
        poses=np.zeros((1, 3)),
        beliefs=np.array([pose], float),
        homes_in_map=np.array([home], float),
        ways_home=np.full((1, 7), np.nan),
        is_recognised=np.zeros(1, np.bool_),
        is_lost=np.zeros(1, np.bool_),
        homes_in_robot=np.zeros((1, 3)),
        motions=np.zeros((1, 3)),
        true_ranges=np.full((1, 181), np.inf),
        ranges=np.full((1, 181), np.inf),
        echoes=np.full((1, 8), np.inf),
        compasses=np.zeros(1),
        time_left=np.full(1, np.inf),
        starts=np.zeros((1, 3)),
        true_homes=np.zeros((1, 3)),
    )


def observed(world: World, layers: MapSnapshot, state: BatchState, **mapper: str) -> np.ndarray:
    """What a robot with this map observes, flat."""
    drawn: Any = Drawn(layers, **mapper)
    config = CONFIG.fitted(LaserGeometry(), None, drawn.spec)
    builder = ObservationBuilder(1, config, LaserGeometry(), 0.25, drawn)
    builder.begin(0, world)
    rows = np.zeros((1, config.flat_space.shape[0]), np.float32)
    builder.observe(np.zeros(1, np.int64), state, rows)
    return rows[0]


def patch(world: World, layers: MapSnapshot, state: BatchState, channel: str) -> np.ndarray:
    """What the patches of a channel show: 2 scales of 16 × 16 cells of 0.5 m and of 2.5 m."""
    config = CONFIG.fitted(LaserGeometry(), None, mapper_spec("albot1"))
    decoded = config.decode(MAP_PATCH, observed(world, layers, state))
    assert decoded.sides == (8.0, 40.0)
    return np.asarray(decoded.channels[channel])


def shown(world: World, layers: MapSnapshot, state: BatchState, channel: str) -> list[Any]:
    """The cells (row, column) that show something, by scale."""
    return [np.argwhere(square > -1).tolist() for square in patch(world, layers, state, channel)]


NORTH = math.pi / 2


def test_a_wall_ahead_is_drawn_above_whatever_the_heading(two_rooms: World) -> None:
    # From 2.2 m ahead, 1.2 m to the left, to as far ahead 0.8 m to the right.
    wall = np.array([[2.2, 1.2, 2.2, -0.8]])
    for pose in ((0.0, 0.0, 0.0), (3.0, -2.0, NORTH), (1.0, 1.0, 2.5)):
        there = transform_segments(np.array(pose), wall)
        layers = MapSnapshot(layers=(SegmentsLayer(segments=there),))
        near, far = shown(two_rooms, layers, believed(pose), "walls")
        assert near == [[3, column] for column in (5, 6, 7, 8, 9)]
        assert far == [[7, 7], [7, 8]]


def test_home_is_marked_and_at_the_edge_where_it_is_farther_away(two_rooms: World) -> None:
    layers = MapSnapshot()
    # Home 6 m to the left of a robot that looks north: beyond the near patch.
    state = believed((6.0, 0.2, NORTH), (0.0, 0.3, 0.0))
    assert shown(two_rooms, layers, state, "home") == [[[7, 0]], [[7, 5]]]
    # At 100 m ahead, 50 m right: at the edge of both, in that direction.
    state = believed((0.0, 0.0, 0.0), (100.0, -50.0, 0.0))
    assert shown(two_rooms, layers, state, "home") == [[[0, 12]], [[0, 12]]]
    at_home = believed((1.0, 1.0, 1.0), (1.0, 1.0, 0.0))
    assert shown(two_rooms, layers, at_home, "home") == [[[8, 8]], [[8, 8]]]


def place(number: int, x: float, y: float, visits: int | None = None) -> PlaceNode:
    return PlaceNode(
        id=10 * number,
        label="",
        pose=np.array((x, y, 0.0)),
        middle=np.array((x, y)),
        visits=visits,
    )


def test_places_and_exits_lie_where_the_graph_s_frame_lies_on_the_map(two_rooms: World) -> None:
    doorway = np.array((0.0, 0.5, 0.0, -0.5))
    edge = PlaceEdge(source=0, target=10, motion=np.array((2.0, 0.0, 0.0)), doorway=doorway)
    graph = PlaceGraph(
        nodes=(place(0, 0.0, 0.0), place(1, 2.2, 0.2)),
        edges=(edge,),
        current=10,
        home=0,
        frame=np.array((1.1, 0.0, 0.0)),
    )
    layers = MapSnapshot(layers=(graph,))
    near, _ = shown(two_rooms, layers, believed(), "places")
    assert near == [[1, 7], [5, 8]]  # 3.3 m and 1.1 m ahead.
    near, _ = shown(two_rooms, layers, believed(), "exits")
    assert near == [[5, 7], [5, 8]]


def test_the_nearest_places_are_shown_with_the_present_one_and_home_first(two_rooms) -> None:
    # Home is the farthest of six, and only four are shown.
    nodes = (
        place(0, -9.0, 0.0, 3),
        *(place(k, float(k), 0.0, k) for k in (5, 4, 3, 2)),
        place(6, 0.0, 3.5, 1),
    )
    edges = tuple(
        PlaceEdge(source=source, target=target, motion=np.array((1.0, -1.0, 0.5)))
        for source, target in ((0, 60), (20, 30), (30, 20), (40, 50), (30, 40), (60, 60))
    )
    graph = PlaceGraph(nodes=nodes, edges=edges, current=60, home=0)
    config = CONFIG.fitted(LaserGeometry(), None, mapper_spec("albot1"))
    state = believed((1.0, 0.0, NORTH))
    row = observed(two_rooms, MapSnapshot(layers=(graph,)), state)
    seen = config.decode(PLACE_GRAPH, row)
    ahead, left = np.array((0.0, 3.5, 0.0, 0.0)), np.array((10.0, 1.0, -1.0, -2.0))
    np.testing.assert_allclose(seen.points, np.stack((ahead, left), axis=1), atol=1e-4)
    assert seen.visits.tolist() == [3, 1, 2, 3]
    assert seen.is_home.tolist() == [True, False, False, False]
    assert seen.is_current.tolist() == [False, True, False, False]
    # Those between places that are shown, the first three.
    assert seen.ends.tolist() == [[0, 1], [2, 3], [3, 2]]
    np.testing.assert_allclose(seen.motions, [[1.0, -1.0, 0.5]] * 3, atol=1e-4)


def test_a_graph_without_places_is_shown_as_empty(two_rooms: World) -> None:
    config = CONFIG.fitted(LaserGeometry(), None, mapper_spec("albot1"))
    row = observed(two_rooms, MapSnapshot(layers=(PlaceGraph(),)), believed())
    numbers = config.split(row)["place_graph"]
    assert (numbers[:, 0] == -1).all()
    assert (numbers[:, 1:] == 0).all()
    seen = config.decode(PLACE_GRAPH, row)
    assert len(seen.points) == len(seen.ends) == 0


def test_the_trail_fades_with_age_and_is_forgotten_in_the_end(two_rooms: World) -> None:
    reader = MapReader(1, None, TRAIL, reads_maps=False)
    reader.begin(0, 10.0)
    rows = np.zeros(1, np.int64)
    for x in np.arange(0.0, 6.0, 0.1):
        reader.update(rows, np.array([[x, 0.0, 0.0]]))
    counts, points = reader.arrays.trail
    assert counts.tolist() == [8]
    np.testing.assert_allclose(np.diff(points[0, :, 0]), 0.5, atol=0.11)
    assert points[0, -1, 0] > 5.4
    trail = reader.trail(0)
    reader.begin(0, 10.0)
    assert reader.arrays.trail.counts.tolist() == [0]
    reader.set_trail(0, trail, 5)
    assert reader.arrays.readings.tolist() == [4]
    assert reader.trail(0).tolist() == trail.tolist()
    config = CONFIG.fitted(LaserGeometry(), None, mapper_spec("albot1"))
    builder = ObservationBuilder(1, config, LaserGeometry(), 0.25, Drawn(MapSnapshot()))
    builder.begin(0, two_rooms)
    out = np.zeros((1, config.flat_space.shape[0]), np.float32)
    for x in (0.0, 0.6, 1.2):
        builder.observe(rows, believed((x, 0.0, 0.0)), out)
    near = config.decode(MAP_PATCH, out[0]).channels["trail"][0]
    assert near[[8, 9, 10], 8].tolist() == pytest.approx([1, 2 / 3, 1 / 3])
    assert (near > -1).sum() == 3
    for x in np.arange(1.9, 60.0, 0.6):  # Farther than the smaller square shows.
        builder.observe(rows, believed((x, 0.0, 0.0)), out)
    behind = config.decode(MAP_PATCH, out[0]).channels["trail"][0][8:, 8]
    assert behind[0] == 1
    assert 0 < behind[-1] < 0.15
    assert np.diff(behind).max() <= 0  # Two cells may share a line.


def test_a_trajectory_is_thinned_from_its_newest_point_back() -> None:
    points = np.stack((np.arange(0.0, 4.01, 0.2), np.zeros(21)), axis=1)
    taken = thinned_trail(points, 0.5, 100)
    np.testing.assert_allclose(taken[:, 0], np.arange(0.4, 4.01, 0.6), atol=1e-9)
    np.testing.assert_allclose(thinned_trail(points, 0.5, 3)[:, 0], (2.8, 3.4, 4.0))
    assert thinned_trail(points[:0], 0.5, 3).shape == (0, 2)


@given(st.lists(st.floats(-9, 17, width=16), min_size=4, max_size=4))
@settings(max_examples=300, deadline=None)
def test_a_line_is_drawn_in_the_cells_that_it_passes(ends: list[float]) -> None:
    """By shapely, but for cells that it only touches."""
    cells, line = 8, shapely.LineString((ends[:2], ends[2:]))
    square = np.full(cells * cells, -1.0, np.float32)
    draw_line(tuple(ends[:2]), tuple(ends[2:]), 1.0, cells, square)
    for row in range(cells):
        for column in range(cells):
            inner = shapely.box(column + 1e-6, row + 1e-6, column + 1 - 1e-6, row + 1 - 1e-6)
            outer = shapely.box(column - 1e-6, row - 1e-6, column + 1 + 1e-6, row + 1 + 1e-6)
            is_drawn = square[row * cells + column] == 1.0
            assert is_drawn or not line.intersects(inner), (row, column)
            assert line.intersects(outer) or not is_drawn, (row, column)


def test_an_occupancy_grid_s_walls_and_free_ground(two_rooms: World) -> None:
    """A wall of one cell of 5 cm, 1.2 m ahead, with free ground before it, and unknown beyond."""
    occupancy = np.full((40, 60), np.nan, np.float32)
    occupancy[:, :24], occupancy[:, 24] = 0.1, 0.9
    origin = np.array((0.0, -1.0, 0.0))
    grid = OccupancyGridLayer(origin=origin, resolution=0.05, occupancy=occupancy)
    occupied, free = thinned(grid)
    assert np.unique(occupied[:, 0]).tolist() == pytest.approx([1.125])
    assert free[:, 0].max() == pytest.approx(0.875)
    assert len(free) == 4 * 8
    for pose in ((0.0, 0.0, 0.0), (2.0, 1.0, NORTH)):
        turned = replace(grid, origin=compose(np.array(pose), origin))
        layers = MapSnapshot(layers=(turned, TrajectoryLayer(poses=np.array([pose]))))
        spec = mapper_spec("gmapping")
        drawn: Any = Drawn(layers, "gmapping")
        config = ObservationConfig(parts=("map_patch",), map_patch=CONFIG.map_patch)
        config = config.fitted(LaserGeometry(), None, spec)
        builder = ObservationBuilder(1, config, LaserGeometry(), 0.25, drawn)
        builder.begin(0, two_rooms)
        out = np.zeros((1, config.flat_space.shape[0]), np.float32)
        builder.observe(np.zeros(1, np.int64), believed(pose), out)
        seen = config.decode(MAP_PATCH, out[0]).channels
        assert np.argwhere(seen["walls"][0] > 0).tolist() == [[5, k] for k in (6, 7, 8, 9)]
        assert np.argwhere(seen["free"][0] > 0).tolist() == [
            [row, k] for row in (6, 7) for k in (6, 7, 8, 9)
        ]
        assert np.argwhere(seen["trail"][0] > 0).tolist() == [[8, 8]]


@given(
    st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3.1, 3.1)),
    st.integers(0, 2**31),
)
@settings(max_examples=25, deadline=None)
def test_moving_map_and_robot_together_changes_no_patch(
    two_rooms: World, motion: tuple[float, float, float], seed: int
) -> None:
    """But for single cells at whose edges rounding decides."""
    rng, shift = np.random.default_rng(seed), np.array(motion)
    walls, places = rng.uniform(-9, 9, (20, 4)), rng.uniform(-9, 9, (6, 2))
    pose, home = rng.uniform(-3, 3, (2, 3))
    rows = []
    for frame in (np.zeros(3), shift):
        nodes = tuple(place(k, *transform_points(frame, at)) for k, at in enumerate(places))
        layers = MapSnapshot(
            layers=(
                SegmentsLayer(segments=transform_segments(frame, walls)),
                PlaceGraph(nodes=nodes, current=0, home=10),
            )
        )
        state = believed(compose(frame, pose), compose(frame, home))
        rows.append(observed(two_rooms, layers, state))
    assert (np.abs(rows[0] - rows[1]) > 1e-3).mean() < 0.01


def test_another_channel_or_part_is_refused_by_name(two_rooms: World) -> None:
    for mapper, channel in (("none", "walls"), ("odometry", "exits"), ("gmapping", "places")):
        config = ObservationConfig(
            parts=("map_patch",), map_patch=MapPatchConfig(channels=("home", channel))
        )
        with pytest.raises(InputError) as error:
            ExploreEnv(two_rooms, mapper=mapper, config=ExploreConfig(observations=config))
        given_channels = channels_of(None if mapper == "none" else mapper_spec(mapper))
        assert str(error.value) == (
            f"MapPatchConfig.channels: expected some of {', '.join(given_channels)}, which the "
            f"mapper {mapper} can give, found {channel}"
        )
    for mapper in ("odometry", "grid-slam", "scan-matching"):
        for part in ("place_graph", "matches"):
            config = ExploreConfig(observations=ObservationConfig(parts=(part,)))
            with pytest.raises(InputError, match=rf"the mapper {mapper} can give.*found {part}"):
                ExploreEnv(two_rooms, mapper=mapper, config=config)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"sides": ()}, "MapPatchConfig.sides"),
        ({"sides": (16.0, -1.0)}, "MapPatchConfig.sides"),
        ({"sides": (math.inf,)}, "MapPatchConfig.sides"),
        ({"sides": (True,)}, "MapPatchConfig.sides"),
        ({"cells": 1}, "MapPatchConfig.cells"),
        ({"channels": ("wals",)}, "did you mean walls"),
        ({"channels": ()}, "each once"),
        ({"channels": ("home", "home")}, "each once"),
        ({"trail_spacing": 0.0}, "MapPatchConfig.trail_spacing"),
        ({"trail_spacing": 9.0, "trail_length": 5.0}, "at most trail_length, 5"),
    ],
)
def test_impossible_patches_are_refused(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        MapPatchConfig(**wrong)


def test_channels_are_shown_in_their_order(two_rooms: World) -> None:
    chosen = MapPatchConfig(channels=("home", "walls"))
    assert chosen.chosen(mapper_spec("albot1")) == ("walls", "home")
    by_default = MapPatchConfig().chosen(mapper_spec("albot1"))
    assert (*by_default, "obstacles") == CHANNELS
