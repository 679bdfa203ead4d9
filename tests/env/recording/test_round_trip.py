"""What is written can be read: by us, exactly, and by whoever reads MCAP."""

from __future__ import annotations

import json
import os
from pathlib import Path

import gymnasium
import jsonschema
import numpy as np
import pytest
from mcap.reader import make_reader

from albot_core.errors import InputError
from albot_core.mappers.registry import make_mapper
from albot_env.recording.episode import Moment, NullRecorder, Recorder
from albot_env.recording.layers import plain_layer
from albot_env.recording.log import EpisodeLog, read_episode_log, read_log_or_episode
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.schemas import TOPICS
from albot_env.recording.writer import CHUNK_MOMENTS, EpisodeWriter
from albot_maps import load_world
from tests.env.conftest import drive


class _Memory:
    """A recorder that keeps what it is given."""

    def __init__(self) -> None:
        self.moments: list[Moment] = []

    def begin(self, header) -> None:
        self.header = header

    def add(self, moment: Moment) -> None:
        self.moments.append(moment)

    def close(self) -> None:
        pass


def _flat(moment: Moment) -> list[np.ndarray]:
    return [
        np.array((moment.reading.stamp, moment.reward, moment.path_length, moment.updates)),
        np.empty(0) if moment.action is None else moment.action,
        moment.reading.motion,
        moment.reading.laser.ranges,
        moment.pose,
        moment.belief,
        moment.home,
        np.empty(0) if moment.snapshot is None else moment.snapshot.segments,
    ]


def test_recorders_are_recorders(tmp_path: Path) -> None:
    assert isinstance(NullRecorder(), Recorder)
    assert isinstance(EpisodeWriter(tmp_path / "a.mcap"), Recorder)


def test_what_is_read_is_what_was_written_to_the_last_bit(make_env, episode: Path) -> None:
    env, memory = make_env(mapper="albot1"), _Memory()
    env.recorder = memory
    drive(env, 40)
    reader = EpisodeReader(episode)
    read = list(reader.moments())
    assert not reader.torn
    assert len(read) == len(memory.moments) == 41
    for ours, theirs in zip(read, memory.moments, strict=True):
        for one, other in zip(_flat(ours), _flat(theirs), strict=True):
            assert np.array_equal(one, other)
        assert ours.terms == theirs.terms
        assert ours.facts == theirs.facts
        assert (ours.collided, ours.room) == (theirs.collided, theirs.room)
    header = reader.header
    assert (header.world, header.mapper, header.seed) == ("two-rooms", "albot1", 5)
    assert reader.header.agent == "chance"
    assert np.array_equal(header.walls, memory.header.walls)
    assert header.laser == memory.header.laser


def test_an_episode_knows_the_environment_that_it_is_from(tmp_path: Path) -> None:
    chosen = {"world": "square-loop", "mapper": "odometry", "config": {"weights": {"time": -0.5}}}
    env = gymnasium.make("Albot/Explore-v0", **chosen)
    env.unwrapped.recorder = EpisodeWriter(tmp_path / "a.mcap")
    env.reset(seed=5)
    info = env.step(np.array((1.0, 0.0, -1.0), np.float32))[-1]
    env.close()
    reader = EpisodeReader(tmp_path / "a.mcap")
    spec = gymnasium.envs.registration.EnvSpec.from_json(json.dumps(reader.header.spec))
    assert (spec.id, spec.kwargs) == ("Albot/Explore-v0", chosen)
    facts = list(reader.moments())[-1].facts
    assert facts["coverage"] == info["coverage"] > 0
    assert facts["rooms_entered"] == info["rooms_entered"]
    again = gymnasium.make(spec)
    again.reset(seed=reader.header.seed)
    assert again.step(np.array((1.0, 0.0, -1.0), np.float32))[-1]["coverage"] == facts["coverage"]
    again.close()


def test_an_environment_that_json_cannot_hold_is_recorded_without_its_spec(tmp_path: Path) -> None:
    env = gymnasium.make("Albot/Explore-v0", world=load_world("square-loop"), mapper="odometry")
    env.unwrapped.recorder = EpisodeWriter(tmp_path / "a.mcap")
    env.reset(seed=5)
    env.close()
    assert EpisodeReader(tmp_path / "a.mcap").header.spec is None


def test_recorded_readings_rebuild_the_map(episode: Path) -> None:
    mapper = make_mapper("albot1")
    for moment in EpisodeReader(episode).moments():
        mapper.update(moment.reading)
        assert np.array_equal(mapper.estimate.pose, moment.belief)
        matched = mapper.estimate.matched_reading
        assert matched == moment.matched_reading
        if moment.snapshot is not None:
            mine, theirs = mapper.snapshot(), moment.snapshot
            assert np.array_equal(mine.segments, theirs.segments)
            assert plain_layer(mine.place_graph) == plain_layer(theirs.place_graph)


def test_the_same_seed_gives_the_same_bytes(make_env, tmp_path: Path) -> None:
    for name in ("a", "b"):
        env = make_env(mapper="albot1")
        env.agent, env.recorder = "chance", EpisodeWriter(tmp_path / name)
        drive(env, 30)
        env.close()
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_any_mcap_reader_finds_messages_as_their_schemas_say(episode: Path) -> None:
    counts: dict[str, int] = {}
    with episode.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert {c.topic for c in summary.channels.values()} == set(TOPICS)
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            assert schema.name == TOPICS[channel.topic]["title"]
            jsonschema.validate(json.loads(message.data), json.loads(schema.data))
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
    assert counts["/albot/header"] == counts["/walls"] == 1
    for topic in ("/albot/step", "/scan", "/tf", "/home"):
        assert counts[topic] == 41
    assert 1 <= counts["/albot/map"] == counts["/map/segments"] < 41


def test_foxglove_shows_things_where_they_are(episode: Path) -> None:
    """Transforms, scan and scene against the moment's own numbers."""
    moments = list(EpisodeReader(episode).moments())
    with episode.open("rb") as stream:
        messages = [
            (channel.topic, json.loads(message.data))
            for _, channel, message in make_reader(stream).iter_messages()
        ]
    last = moments[-1]
    robot = [content for topic, content in messages if topic == "/tf"][-1]["transforms"][1]
    assert (robot["parent_frame_id"], robot["child_frame_id"]) == ("world", "robot")
    assert [robot["translation"][axis] for axis in "xyz"] == [*last.pose[:2], 0.0]
    turn = robot["rotation"]
    assert 2 * np.arctan2(turn["z"], turn["w"]) == pytest.approx(last.pose[2])
    scan = [content for topic, content in messages if topic == "/scan"][-1]
    assert len(scan["ranges"]) == 181
    assert (scan["start_angle"], scan["end_angle"]) == pytest.approx((-np.pi / 2, np.pi / 2))
    scene = [content for topic, content in messages if topic == "/map/segments"][-1]
    points = [[p["x"], p["y"]] for p in scene["entities"][0]["lines"][0]["points"]]
    surfaces = next(m.snapshot.segments for m in reversed(moments) if m.snapshot is not None)
    assert np.reshape(points, (-1, 4)) == pytest.approx(surfaces, abs=5.1e-4)


def test_what_was_driven_can_be_read_before_the_end(make_env, tmp_path: Path) -> None:
    """As after a crash: nobody has closed the file, and less than a chunk is missing."""
    path = tmp_path / "a.mcap"
    env = make_env()
    env.recorder = EpisodeWriter(path)
    env.reset(seed=5)
    for step in range(1, 61):
        env.step(np.array((0.3, 0.1, -1), np.float32))
        if step < 20:
            continue
        reader = EpisodeReader(path)
        assert step + 1 - len(list(reader.moments())) < CHUNK_MOMENTS
        assert reader.torn
    env.close()
    reader = EpisodeReader(path)
    assert len(list(reader.moments())) == 61
    assert not reader.torn


def test_one_file_holds_one_episode(make_env, tmp_path: Path) -> None:
    env = make_env()
    env.recorder = EpisodeWriter(tmp_path / "a.mcap")
    env.reset(seed=1)
    with pytest.raises(InputError, match="one episode a file"):
        env.reset(seed=2)
    env.close()


def test_a_file_that_cannot_be_written_is_refused(make_env, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    env = make_env()
    env.recorder = EpisodeWriter(tmp_path / "folder")
    with pytest.raises(InputError, match=r"folder: expected a file to write, found a folder"):
        env.reset(seed=1)


def test_a_pipe_is_refused(make_env, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    env = make_env()
    env.recorder = EpisodeWriter(tmp_path / "pipe")
    with pytest.raises(InputError, match=r"pipe: expected a file to write, found a pipe"):
        env.reset(seed=1)


def test_a_full_disk_is_said(make_env) -> None:
    env = make_env()
    env.recorder = EpisodeWriter(Path("/dev/full"))
    with pytest.raises(InputError, match=r"/dev/full"):
        drive(env, 60)


@pytest.mark.parametrize("name", ["a.mcap", "a.MCAP"])
def test_an_episode_is_known_by_its_suffix(episode: Path, tmp_path: Path, name: str) -> None:
    path = episode.rename(tmp_path / name)
    assert len(read_log_or_episode(path).readings) == len(read_episode_log(path).readings)


def test_an_episode_is_a_log_as_well(make_env, episode: Path) -> None:
    """In memory as from the file; a mapper led through it comes to the same."""
    env, kept = make_env(mapper="albot1"), EpisodeLog()
    env.recorder = kept
    *_, (_, info) = drive(env, 40)
    read, here = read_episode_log(episode), kept.log("here")
    assert read.sensors == here.sensors == {"laser", "sonar"}
    for name in ("stamps", "ranges", "odometry", "echoes", "reference"):
        np.testing.assert_array_equal(getattr(read, name), getattr(here, name))
    assert here.readings[3].stamp == pytest.approx(0.3)
    mapper = make_mapper("albot1")
    for reading in here.readings:
        mapper.update(reading)
    np.testing.assert_allclose(mapper.estimate.pose, info["belief"], atol=1e-9)
