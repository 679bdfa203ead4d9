"""Moments as messages. A step's `albot.Step` is written last: with it the step is complete."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from albot_core.geometry.types import Pose, Segments
from albot_core.sensing.reading import LaserScan, SonarGeometry, SonarScan
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.recording.schemas import PRIMITIVES

FORMAT = 2
"""Version of our own messages."""

WALL_COLOUR = {"r": 0.83, "g": 0.85, "b": 0.89, "a": 1.0}
THING_COLOUR = {"r": 0.83, "g": 0.55, "b": 0.86, "a": 1.0}
ECHO_COLOUR = {"r": 0.31, "g": 0.72, "b": 0.84, "a": 1.0}
SURFACE_COLOUR = {"r": 0.96, "g": 0.72, "b": 0.26, "a": 1.0}

Message = tuple[str, dict[str, Any]]
"""A topic and what is said on it."""


def header_messages(header: EpisodeHeader, agent: str) -> Iterator[Message]:
    """The messages that begin an episode."""
    laser = header.laser
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
            "agent": agent,
            "seed": header.seed,
            "laser": {
                "beams": laser.beams,
                "first_bearing": laser.first_bearing,
                "spacing": laser.spacing,
                "max_range": laser.max_range,
                "mount": list(laser.mount),
            },
            "sonar": None if header.sonar is None else _sonars(header.sonar),
        },
    )
    yield "/walls", _lines("walls", "world", header.walls, WALL_COLOUR, 0.0)


def moment_messages(moment: Moment, start: Pose) -> Iterator[Message]:
    """The messages of one step; `start` is where the map's frame lies in the world's."""
    stamp = moment.reading.stamp
    yield (
        "/tf",
        {
            "transforms": [
                _transform(stamp, "world", "map", start),
                _transform(stamp, "world", "robot", moment.pose),
                _transform(stamp, "map", "robot_believed", moment.belief),
            ]
        },
    )
    yield "/scan", _scan(stamp, moment.reading.laser)
    if moment.reading.sonar is not None:
        yield "/sonars", _arcs(stamp, moment.reading.sonar)
    yield (
        "/home",
        {"timestamp": _time(stamp), "frame_id": "robot_believed", "pose": _pose(moment.home)},
    )
    if len(moment.things):
        yield "/things", _lines("things", "world", moment.things, THING_COLOUR, stamp)
        yield "/albot/things", {"segments": moment.things.tolist()}
    if moment.surfaces is not None:
        yield "/surfaces", _lines("map", "map", moment.surfaces, SURFACE_COLOUR, stamp)
        yield "/albot/map", {"surfaces": moment.surfaces.tolist()}
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
        "pose": moment.pose.tolist(),
        "collided": moment.collided,
        "room": moment.room,
        "path_length": moment.path_length,
        "belief": moment.belief.tolist(),
        "home": moment.home.tolist(),
        "updates": moment.updates,
    }


def _scan(stamp: float, scan: LaserScan) -> dict[str, Any]:
    """JSON knows no infinity: a beam that brought nothing back has range 0."""
    bearings = scan.geometry.bearings
    return {
        "timestamp": _time(stamp),
        "frame_id": "robot",
        "pose": _pose(np.array(scan.geometry.mount)),
        "start_angle": float(bearings[0]),
        "end_angle": float(bearings[-1]),
        "ranges": np.where(np.isfinite(scan.ranges), scan.ranges, 0.0).tolist(),
        "intensities": [],
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
    """JSON knows no infinity: a sonar that heard nothing has null."""
    return [reach if math.isfinite(reach) else None for reach in scan.ranges.tolist()]


def _arcs(stamp: float, scan: SonarScan) -> dict[str, Any]:
    """Across the cone of each sonar that heard something, the chord at that range."""
    geometry = scan.geometry
    heard = np.isfinite(scan.ranges)
    bearings = np.array(geometry.bearings)[heard, None] + geometry.cone / 2 * np.array((-1, 1))
    reach = np.stack((np.cos(bearings), np.sin(bearings)), axis=-1) * scan.ranges[heard, None, None]
    ends = np.array(geometry.places)[heard, None] + reach
    return _lines("sonars", "robot", ends.reshape(-1, 4), ECHO_COLOUR, stamp)


def _lines(
    name: str, frame: str, segments: Segments, colour: dict[str, float], stamp: float
) -> dict[str, Any]:
    """A scene of line segments, to the millimetre; it replaces the one of the same name."""
    points = np.round(segments.reshape(-1, 2), 3).tolist()
    entity: dict[str, Any] = {
        "timestamp": _time(stamp),
        "frame_id": frame,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True,
        "metadata": [],
    }
    entity.update({primitive: [] for primitive in PRIMITIVES})
    entity["lines"] = [
        {
            "type": 2,
            "pose": _pose(np.zeros(3)),
            "thickness": 0.05,
            "scale_invariant": False,
            "points": [{"x": x, "y": y, "z": 0.0} for x, y in points],
            "color": colour,
            "colors": [],
            "indices": [],
        }
    ]
    return {"deletions": [], "entities": [entity]}


def nanoseconds(stamp: float) -> int:
    """Simulated time (s) in whole nanoseconds."""
    return round(stamp * 1e9)


def _time(stamp: float) -> dict[str, int]:
    sec, nsec = divmod(nanoseconds(stamp), 1_000_000_000)
    return {"sec": sec, "nsec": nsec}


def _transform(stamp: float, parent: str, child: str, pose: Pose) -> dict[str, Any]:
    placed = _pose(pose)
    return {
        "timestamp": _time(stamp),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": placed["position"],
        "rotation": placed["orientation"],
    }


def _pose(pose: Pose) -> dict[str, dict[str, float]]:
    x, y, heading = pose.tolist()
    half = heading / 2
    return {
        "position": {"x": x, "y": y, "z": 0.0},
        "orientation": {"x": 0.0, "y": 0.0, "z": float(np.sin(half)), "w": float(np.cos(half))},
    }
