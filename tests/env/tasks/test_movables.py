"""Environments in which things move: the same alone and in a batch, shown, recorded, left out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

import albot_env  # noqa: F401 (registers)
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.rendering.canvas import paint_array
from albot_env.rendering.scene import lay_out
from albot_env.tasks.explore.env import ExploreEnv, ExploreVectorEnv
from albot_maps import Movables, load_world

WORLDS = "random:office:0..3?rooms=6&people=2&boxes=3&doors=2"


def run(env: ExploreEnv, seed: int, steps: int) -> list[tuple[Any, float, dict[str, Any]]]:
    """Drive by chance; observation, reward and info of each step, those of the reset first."""
    rng = np.random.default_rng(seed)
    observation, info = env.reset(seed=seed)
    seen = [(observation, 0.0, info)]
    for _ in range(steps):
        observation, reward, _, _, info = env.step(rng.uniform(-1, 1, 3).astype(np.float32))
        seen.append((observation, reward, info))
    return seen


@pytest.mark.parametrize("mapper", ["none", "odometry"])
def test_a_batch_among_things_gives_what_each_gives_alone(mapper):
    """Over two resets, each of which draws another of the worlds."""
    count, limit, steps = 4, 60, 150
    batch = ExploreVectorEnv(count, WORLDS, mapper=mapper, max_episode_steps=limit, threads=2)
    alone = [ExploreEnv(WORLDS, mapper=mapper) for _ in range(count)]
    rngs = [np.random.default_rng(seed) for seed in range(count)]
    observations, infos = batch.reset(seed=7)
    singles = [env.reset(seed=7 + k) for k, env in enumerate(alone)]
    worlds = set()
    for step in range(steps):
        for k, (observation, info) in enumerate(singles):
            assert np.array_equal(observations[k], observation)
            assert np.array_equal(infos["pose"][k], info["pose"])
            assert infos["collided"][k] == info["collided"]
            worlds.add(info["world"])
        actions = np.array([rng.uniform(-1, 1, 3) for rng in rngs], np.float32)
        observations, _, _, _, infos = batch.step(actions)
        if step % (limit + 1) == limit:  # In NextStep mode this step resets.
            singles = [env.reset() for env in alone]
        else:
            singles = []
            for env, action in zip(alone, actions, strict=True):
                observation, _, _, _, info = env.step(action)
                singles.append((observation, info))
    assert len(worlds) > 1


def test_left_out_they_are_as_if_the_world_had_none():
    world = load_world("random:office:1?rooms=6&people=2&boxes=3&doors=2")
    bare = replace(world, movables=Movables())
    left_out = run(ExploreEnv(world, mapper="none", movables=False), 3, 60)
    without = run(ExploreEnv(bare, mapper="none"), 3, 60)
    among = run(ExploreEnv(world, mapper="none"), 3, 60)
    assert all(np.array_equal(a[0], b[0]) for a, b in zip(left_out, without, strict=True))
    assert not all(np.array_equal(a[0], b[0]) for a, b in zip(among, without, strict=True))


def test_no_beam_passes_through_a_thing():
    env = ExploreEnv(
        "random:hall:2?people=6&boxes=8&doors=2",
        mapper="none",
        odometer="ideal",
        render_mode="rgb_array",
    )
    rng = np.random.default_rng(2)
    env.reset(seed=2)
    shortened = 0
    for step in range(60):
        env.step(rng.uniform((0, -1, -1), (1, 1, 1)).astype(np.float32))
        if step % 6:
            continue
        frame = env.frame
        laser = env._robot.ground_laser
        cos, sin = np.cos(frame.pose[2]), np.sin(frame.pose[2])
        x = frame.pose[0] + cos * laser.mount[0] - sin * laser.mount[1]
        y = frame.pose[1] + sin * laser.mount[0] + cos * laser.mount[1]
        shapes = [
            _lines(frame.walls),
            _lines(np.concatenate((frame.walls, frame.dynamic_obstacles))),
        ]
        ranges = env._robot.readings[0].laser.ranges
        for bearing, reach in zip(laser.bearings[::12], ranges[::12], strict=True):
            angle = frame.pose[2] + laser.mount[2] + bearing
            end = x + 40 * np.cos(angle), y + 40 * np.sin(angle)
            ray = shapely.LineString([(x, y), end])
            walls, everything = (
                shapely.Point(x, y).distance(ray.intersection(shape)) for shape in shapes
            )
            if np.isfinite(reach):
                assert reach == pytest.approx(everything, abs=0.06)
            shortened += everything < walls - 0.1
    assert shortened > 10


def _lines(segments: np.ndarray) -> shapely.MultiLineString:
    return shapely.multilinestrings(shapely.linestrings(segments.reshape(-1, 2, 2)))


def test_things_are_recorded_shown_and_read_back(tmp_path: Path):
    env = ExploreEnv("random:office:2?rooms=4&people=2&boxes=2&doors=1", mapper="none")
    env.recorder = EpisodeWriter(tmp_path / "moving.mcap")
    env.reset(seed=5)
    things = [env.frame.dynamic_obstacles]
    for _ in range(25):
        env.step(np.array([0.3, 0.1, -1], np.float32))
        things.append(env.frame.dynamic_obstacles)
    env.close()
    moments = list(EpisodeReader(tmp_path / "moving.mcap").moments())
    assert len(moments) == 26
    for moment, expected in zip(moments, things, strict=True):
        assert np.array_equal(moment.dynamic_obstacles, expected)
    assert not np.array_equal(things[0], things[-1])
    with_things = paint_array(lay_out(env.frame))
    without = paint_array(lay_out(replace(env.frame, dynamic_obstacles=np.empty((0, 4)))))
    assert not np.array_equal(with_things, without)
