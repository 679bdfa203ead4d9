"""Mappers that nobody here has heard of, one of a grid and one of places: nothing leaves them out.

They stand in the tests (`tests.core.mappers`), loop over their robots, and are named by where
they are.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import jsonschema
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv
from mcap.reader import make_reader
from PIL import Image

from albot_core.drawing.figure import save_figure
from albot_core.drawing.palette import PLACE, rgb
from albot_core.maps.layers import (
    EMPTY_MAP,
    MapSnapshot,
    OccupancyGridLayer,
    PlaceGraph,
    TrajectoryLayer,
)
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.recording.layers import UNKNOWN, plain_layer
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.rendering import canvas, picture
from albot_env.rendering.frame import Frame
from albot_env.rendering.scene import lay_out
from albot_env.rendering.terminal import MARK, draw_text
from albot_env.tasks.explore.env import ExploreEnv
from albot_maps import World
from tests.env import quick
from tests.env.conftest import drive
from tests.env.vector.test_contract import assert_same

GRID = "tests.core.mappers.grid:grid"
PLACES = "tests.core.mappers.topological:topological"
BOTH = (GRID, PLACES)
COUNT, STEPS = 2, 60


@pytest.mark.parametrize("mapper", BOTH)
@pytest.mark.parametrize("environment", quick.IDS)
def test_a_batch_gives_what_single_environments_give(environment: str, mapper: str) -> None:
    """Over resets too; and all that is seen is inside the space."""
    settings = {"world": quick.LOOP, "max_episode_steps": 40, "mapper": mapper}
    settings |= quick.SETTINGS.get(environment, {})
    batch: Any = gymnasium.make_vec(environment, num_envs=COUNT, **settings)
    singles = SyncVectorEnv([lambda: gymnasium.make(environment, **settings)] * COUNT)
    seen = [batch.reset(seed=5)]
    assert_same(seen[0], singles.reset(seed=5))
    drawn = quick.drawn_actions(environment, np.random.default_rng(1), STEPS, COUNT)
    if environment in quick.DRIVEN:
        drawn[..., 0] = np.abs(drawn[..., 0])  # Forward, so that there is something to map.
    for actions in drawn:
        seen.append(batch.step(actions))
        assert_same(seen[-1], singles.step(actions), f"step {len(seen) - 1}")
    assert any((step[2] | step[3]).any() for step in seen[1:])
    space = batch.single_observation_space
    assert all(row in space for observations, *_ in seen for row in observations)
    if environment in quick.DRIVEN:
        assert max(int(step[-1]["updates"].max()) for step in seen) > 3
    if "Explore" in environment:  # Where the next episode begins no map is left.
        assert (seen[41][-1]["time"] == 0).all()
        assert (seen[41][-1]["updates"] <= 1).all()
    batch.close(), singles.close()


class _Recorder:
    """Keeps the moments, and writes them."""

    def __init__(self, path: Path) -> None:
        self.moments: list[Moment] = []
        self._writer = EpisodeWriter(path)

    def begin(self, header: EpisodeHeader) -> None:
        self._writer.begin(header)

    def add(self, moment: Moment) -> None:
        self.moments.append(moment)
        self._writer.add(moment)

    def close(self) -> None:
        self._writer.close()


@pytest.mark.parametrize("mapper", BOTH)
def test_an_episode_is_read_back_as_it_was(two_rooms: World, tmp_path: Path, mapper: str) -> None:
    env, path = ExploreEnv(two_rooms, mapper=mapper), tmp_path / "a.mcap"
    env.recorder = recorder = _Recorder(path)
    drive(env, 30)
    env.close()
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            jsonschema.validate(json.loads(message.data), json.loads(schema.data))
            if channel.topic == "/map/occupancy_grid":
                assert json.loads(message.data)["column_count"] == 128
    reader, maps = EpisodeReader(path), 0
    assert reader.header.mapper == mapper
    for read, written in zip(reader.moments(), recorder.moments, strict=True):
        assert np.array_equal(read.belief, written.belief)
        assert (read.updates, read.matched_reading) == (written.updates, written.matched_reading)
        assert (read.snapshot is None) == (written.snapshot is None)
        if read.snapshot is not None and written.snapshot is not None:
            _assert_same_map(read.snapshot, written.snapshot)
            maps += 1
    assert maps == 31 if mapper == GRID else 1 < maps < 31


def _assert_same_map(one: MapSnapshot, other: MapSnapshot) -> None:
    """All layers are equal, a grid's cells as nearly as a byte can tell."""
    assert len(other.layers) > 0
    assert list(map(type, one.layers)) == list(map(type, other.layers))
    for mine, theirs in zip(one.layers, other.layers, strict=True):
        if isinstance(mine, OccupancyGridLayer) and isinstance(theirs, OccupancyGridLayer):
            assert np.array_equal(mine.origin, theirs.origin)
            assert mine.resolution == theirs.resolution
            assert np.array_equal(np.isnan(mine.occupancy), np.isnan(theirs.occupancy))
            off = np.abs(mine.occupancy - theirs.occupancy)
            assert np.nanmax(off) <= 1 / (UNKNOWN - 1)
        else:
            assert plain_layer(mine) == plain_layer(theirs)


def _drawn_env(world: World, mapper: str) -> ExploreEnv:
    env = ExploreEnv(world, mapper=mapper, render_mode="rgb_array")
    drive(env, 40)
    return env


def _without_map(frame: Frame) -> Frame:
    """The same with nothing known; as much of the floor is shown."""
    grid = frame.snapshot.layer(OccupancyGridLayer)
    unknown = EMPTY_MAP
    if grid is not None:
        blank = replace(grid, occupancy=np.full_like(grid.occupancy, np.nan))
        unknown = MapSnapshot(layers=(blank, *frame.snapshot.layers[1:]))
    bare = replace(frame, snapshot=unknown)
    assert lay_out(bare).bounds == lay_out(frame).bounds
    return bare


def _changed(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where two pictures differ, in the truth and in the map."""
    different = (one != other).any(axis=2)
    half = different.shape[1] // 2
    return different[:, :half], different[:, half:]


@pytest.mark.parametrize("mapper", BOTH)
def test_a_frame_shows_what_they_map(two_rooms: World, mapper: str) -> None:
    env = _drawn_env(two_rooms, mapper)
    shown, frame = env.render(), env.frame
    assert shown is not None
    bare = canvas.paint_array(lay_out(_without_map(frame)))
    # Between the heading and the legend, which has what there is.
    above = canvas.MARGIN + canvas.LINE_HEIGHT + canvas.TITLE_HEIGHT
    below = 2 * canvas.MARGIN + 2 * canvas.LINE_HEIGHT + canvas.LEGEND_HEIGHT
    band = slice(above, -below)
    truth, mapped = _changed(shown[band], bare[band])
    assert not truth.any()
    colours = shown[band][:, truth.shape[1] :][mapped]
    if mapper == GRID:
        # Cells are drawn between free and occupied, as many pixels as there are cells known.
        grid = frame.snapshot.layer(OccupancyGridLayer)
        assert grid is not None
        known = grid.occupancy[~np.isnan(grid.occupancy)]
        x0, _, x1, _ = lay_out(frame).bounds
        cell = (truth.shape[1] - 2 * canvas.MARGIN) / (x1 - x0) * grid.resolution
        assert 0.5 < len(colours) / (len(known) * cell**2) < 1.3
        assert (colours >= canvas.FREE).all()
        assert (colours <= canvas.OCCUPIED).all()
        assert len(np.unique(colours, axis=0)) > 3
    else:
        for style in ("place", "link"):
            assert (colours == canvas.PALETTE[style]).all(axis=1).sum() > 20, style
    env.close()


@pytest.mark.parametrize("mapper", BOTH)
def test_pictures_and_terminals_show_what_they_map(
    two_rooms: World, tmp_path: Path, mapper: str
) -> None:
    frame = _drawn_env(two_rooms, mapper).frame
    pictures, texts = [], []
    for name, drawn in (("map", frame), ("bare", _without_map(frame))):
        path = tmp_path / f"{name}.png"
        save_figure(picture.episode_figure(drawn), path)
        with Image.open(path) as image:
            pictures.append(np.asarray(image.convert("RGB")))
        texts.append(draw_text(drawn, 160, 40).plain)
    shown, bare = texts
    assert f"what the robot believes ({frame.mapper})" in shown
    if mapper == GRID:
        truth, mapped = _changed(*(picture[60:-60] for picture in pictures))
        assert not truth.any()
        assert mapped.sum() > 1000
        dots, dots_of_bare = (sum(0x2800 < ord(c) < 0x2900 for c in text) for text in texts)
        assert dots > dots_of_bare + 10
    else:
        place = rgb(PLACE)
        painted, unpainted = ((p == place).all(axis=2).sum() for p in pictures)
        assert painted > 100 > unpainted == 0
        assert MARK in shown
        assert MARK not in bare


@pytest.mark.parametrize("mapper", BOTH)
def test_the_way_home_begins_with_the_map_of_the_way_out(mapper: str) -> None:
    settings = quick.SETTINGS["Albot/Homing-v0"]
    made = gymnasium.make("Albot/Homing-v0", mapper=mapper, render_mode="rgb_array", **settings)
    env: Any = made.unwrapped
    for _ in range(2):  # The second time the journey is a kept one.
        _, info = env.reset(seed=3)
        before = env.frame.snapshot
        assert info["updates"] > 2
        assert info["outward_length"] >= 1.0
        for _ in range(30):
            observation, _, _, _, info = env.step(np.array((1, 0.2, -1), np.float32))
            assert observation in env.observation_space
        after = env.frame.snapshot
        if mapper == GRID:
            path, longer = before.layer(TrajectoryLayer), after.layer(TrajectoryLayer)
            assert path is not None
            assert longer is not None
            assert len(path.poses) > 10
            assert len(longer.poses) == len(path.poses) + 30
            assert np.array_equal(longer.poses[: len(path.poses)], path.poses)
        else:
            graph, larger = before.layer(PlaceGraph), after.layer(PlaceGraph)
            assert graph is not None
            assert larger is not None
            assert 2 < len(graph.nodes) < len(larger.nodes)
            known = plain_layer(larger)["nodes"][: len(graph.nodes)]
            assert known == plain_layer(graph)["nodes"]
    env.close()
