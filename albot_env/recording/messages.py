"""Moments as messages. A step's `albot.Step` is written last and marks the step as complete."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from albot_core.geometry.types import Pose
from albot_core.sensing.reading import LaserGeometry, LaserScan, SonarGeometry, SonarScan
from albot_env.recording.activity import activity_messages
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.recording.foxglove import Message, lines, pose_of, scene, time_of, transform
from albot_env.recording.layers import map_messages

FORMAT = 7
"""Version of the project's own message formats."""

WALL_COLOUR = {"r": 0.83, "g": 0.85, "b": 0.89, "a": 1.0}
THING_COLOUR = {"r": 0.83, "g": 0.55, "b": 0.86, "a": 1.0}
ECHO_COLOUR = {"r": 0.31, "g": 0.72, "b": 0.84, "a": 1.0}


def header_messages(header: EpisodeHeader) -> Iterator[Message]:
    """Return the messages at the beginning of an episode."""
    yield (
        "/albot/header",
        {
            "format": FORMAT,
            "environment": header.environment,
            "world": header.world,
            "walls": header.walls.tolist(),
            "start": header.start.tolist(),
            "mapper": header.mapper,
            "odometer": header.odometer,
            "robot_radius": header.robot_radius,
            "agent": header.agent,
            "seed": header.seed,
            "spec": header.spec,
            "laser": None if header.laser is None else _laser(header.laser),
            "sonar": None if header.sonar is None else _sonars(header.sonar),
            "way_out": header.way_out.tolist(),
        },
    )
    yield "/walls", scene("walls", "world", 0.0, lines=[lines(header.walls, WALL_COLOUR)])


def moment_messages(moment: Moment, start: Pose) -> Iterator[Message]:
    """Return the messages of one step; `start` is the pose of the map frame (world frame)."""
    stamp = moment.reading.stamp
    yield (
        "/tf",
        {
            "transforms": [
                transform(stamp, "world", "map", start),
                transform(stamp, "world", "robot", moment.pose),
                transform(stamp, "map", "robot_believed", moment.belief),
            ]
        },
    )
    if moment.reading.laser is not None:
        yield "/scan", _scan(stamp, moment.reading.laser)
    if moment.reading.sonar is not None:
        yield "/sonars", _arcs(stamp, moment.reading.sonar)
    yield (
        "/home",
        {"timestamp": time_of(stamp), "frame_id": "robot_believed", "pose": pose_of(moment.home)},
    )
    if len(moment.dynamic_obstacles):
        yield (
            "/things",
            scene("things", "world", stamp, lines=[lines(moment.dynamic_obstacles, THING_COLOUR)]),
        )
        yield "/albot/things", {"segments": moment.dynamic_obstacles.tolist()}
    if moment.snapshot is not None:
        yield from map_messages(moment.snapshot, stamp)
    if moment.activity is not None:
        yield from activity_messages(moment.activity, stamp)
    yield "/albot/step", _step(moment)


def _step(moment: Moment) -> dict[str, Any]:
    return {
        "stamp": moment.reading.stamp,
        "action": None if moment.action is None else moment.action.tolist(),
        "reward": moment.reward,
        "terms": dict(moment.terms),
        "motion": moment.reading.motion.tolist(),
        "echoes": None if moment.reading.sonar is None else _echoes(moment.reading.sonar),
        "scene": moment.reading.scene,
        "compass": moment.reading.compass,
        "pose": moment.pose.tolist(),
        "collided": moment.collided,
        "room": moment.room,
        "path_length": moment.path_length,
        "belief": moment.belief.tolist(),
        "home": moment.home.tolist(),
        "updates": moment.updates,
        "matched_reading": moment.matched_reading,
        "facts": dict(moment.facts),
    }


def _scan(stamp: float, scan: LaserScan) -> dict[str, Any]:
    """Return a laser scan. JSON has no infinity: a beam without a return has range 0."""
    bearings = scan.geometry.bearings
    return {
        "timestamp": time_of(stamp),
        "frame_id": "robot",
        "pose": pose_of(np.array(scan.geometry.mount)),
        "start_angle": float(bearings[0]),
        "end_angle": float(bearings[-1]),
        "ranges": np.where(np.isfinite(scan.ranges), scan.ranges, 0.0).tolist(),
        "intensities": [],
    }


def _laser(geometry: LaserGeometry) -> dict[str, Any]:
    return {
        "beams": geometry.beams,
        "first_bearing": geometry.first_bearing,
        "spacing": geometry.spacing,
        "max_range": geometry.max_range,
        "mount": list(geometry.mount),
    }


def _sonars(geometry: SonarGeometry) -> dict[str, Any]:
    return {
        "bearings": list(geometry.bearings),
        "places": [list(place) for place in geometry.places],
        "cone": geometry.cone,
        "min_range": geometry.min_range,
        "max_range": geometry.max_range,
    }


def _echoes(scan: SonarScan) -> list[float | None]:
    """Return sonar ranges. JSON has no infinity: a sonar without an echo has null."""
    return [reach if math.isfinite(reach) else None for reach in scan.ranges.tolist()]


def _arcs(stamp: float, scan: SonarScan) -> dict[str, Any]:
    """Return, for each sonar with an echo, the chord across its cone at that range."""
    geometry = scan.geometry
    heard = np.isfinite(scan.ranges)
    bearings = np.array(geometry.bearings)[heard, None] + geometry.cone / 2 * np.array((-1, 1))
    reach = np.stack((np.cos(bearings), np.sin(bearings)), axis=-1) * scan.ranges[heard, None, None]
    ends = np.array(geometry.places)[heard, None] + reach
    return scene("sonars", "robot", stamp, lines=[lines(ends.reshape(-1, 4), ECHO_COLOUR)])
