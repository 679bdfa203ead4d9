"""Sonar echoes and scenes go into an episode file and come back."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from albot_core.errors import InputError
from albot_core.sensing.reading import (
    LaserGeometry,
    LaserScan,
    Reading,
    SonarGeometry,
    SonarScan,
)
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.recording.log import read_episode_log
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter

LASER = LaserGeometry(beams=3, first_bearing=-1.5, spacing=1.5)
SONAR = SonarGeometry(bearings=(-0.1, 0.7), places=((0.1, -0.05), (0.125, 0.2)), cone=0.3)
HEADER = EpisodeHeader(
    environment="test",
    world="w",
    walls=np.array([[0.0, 0, 1, 0]]),
    start=np.zeros(3),
    mapper="odometry",
    odometer="ideal",
    robot_radius=0.25,
    seed=None,
    laser=LASER,
    sonar=SONAR,
)


def moment(stamp: float, echoes: list[float] | None, scene: int | None) -> Moment:
    sonar = None if echoes is None else SonarScan(ranges=np.array(echoes), geometry=SONAR)
    reading = Reading(
        stamp=stamp,
        motion=np.zeros(3),
        laser=LaserScan(ranges=np.array((1.0, np.inf, 2.0)), geometry=LASER),
        sonar=sonar,
        scene=scene,
    )
    return Moment(
        action=None,
        reward=0.0,
        terms={},
        reading=reading,
        pose=np.zeros(3),
        collided=False,
        room="",
        path_length=0.0,
        belief=np.zeros(3),
        home=np.zeros(3),
        updates=0,
        matched_reading=None,
        snapshot=None,
    )


def test_nothing_moves_where_nothing_is_said_to() -> None:
    assert moment(0.0, None, None).dynamic_obstacles.shape == (0, 4)


def write(path: Path, header: EpisodeHeader, moments: Sequence[Moment]) -> EpisodeReader:
    writer = EpisodeWriter(path)
    writer.begin(header)
    for each in moments:
        writer.add(each)
    writer.close()
    return EpisodeReader(path)


def test_echoes_and_scenes_come_back_to_the_last_bit(tmp_path: Path) -> None:
    moments = [moment(0.0, [0.1 + 0.2, np.inf], 7), moment(0.1, [np.inf, np.inf], None)]
    reader = write(tmp_path / "a.mcap", HEADER, moments)
    assert reader.header.sonar == SONAR
    first, second = (each.reading for each in reader.moments())
    assert first.sonar is not None and second.sonar is not None
    assert first.sonar.ranges.tolist() == [0.1 + 0.2, np.inf]
    assert second.sonar.ranges.tolist() == [np.inf, np.inf]
    assert first.sonar.geometry == SONAR
    assert (first.scene, second.scene) == (7, None)


@pytest.mark.parametrize("headings", [(0.1 + 0.2, -3.1), (None, None)])
def test_the_compass_comes_back_to_the_last_bit_and_stands_in_the_log(
    tmp_path: Path, headings: tuple[float | None, float | None]
) -> None:
    moments = [
        dataclasses.replace(each, reading=dataclasses.replace(each.reading, compass=heading))
        for each, heading in zip(
            (moment(0.1 * k, [1.0, 2.0], None) for k in range(2)), headings, strict=True
        )
    ]
    reader = write(tmp_path / "a.mcap", HEADER, moments)
    assert tuple(each.reading.compass for each in reader.moments()) == headings
    log = read_episode_log(tmp_path / "a.mcap")
    assert tuple(reading.compass for reading in log.readings) == headings
    assert ("compass" in log.sensors) == (None not in headings)
    assert log.with_scans(np.array((1,))).readings[0].compass == headings[1]


def test_a_robot_without_sonars_has_none_in_its_file(tmp_path: Path) -> None:
    header = dataclasses.replace(HEADER, sonar=None)
    reader = write(tmp_path / "a.mcap", header, [moment(0.0, None, 0)])
    (only,) = reader.moments()
    assert reader.header.sonar is None and only.reading.sonar is None
    assert only.reading.scene == 0


@pytest.mark.parametrize(("sonar", "echoes"), [(SONAR, None), (None, [1.0, 2.0])])
def test_echoes_without_sonars_are_refused(tmp_path: Path, sonar, echoes) -> None:
    header = dataclasses.replace(HEADER, sonar=sonar)
    reader = write(tmp_path / "a.mcap", header, [moment(0.0, echoes, None)])
    with pytest.raises(
        InputError, match=r"/albot/step at 0 s.echoes: expected echoes of the sonars"
    ):
        list(reader.moments())


def test_foxglove_shows_a_chord_across_each_cone_that_heard(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", HEADER, [moment(0.0, [np.inf, 2.0], None)])
    with (tmp_path / "a.mcap").open("rb") as stream:
        (shown,) = (
            json.loads(message.data)
            for _, channel, message in make_reader(stream).iter_messages()
            if channel.topic == "/sonars"
        )
    (entity,) = shown["entities"]
    assert entity["frame_id"] == "robot"
    found = [[point["x"], point["y"]] for point in entity["lines"][0]["points"]]
    expected = [
        [0.125 + 2 * np.cos(0.7 + side), 0.2 + 2 * np.sin(0.7 + side)] for side in (-0.15, 0.15)
    ]
    assert found == pytest.approx(np.array(expected), abs=5.1e-4)
