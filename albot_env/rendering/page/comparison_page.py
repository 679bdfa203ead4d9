"""The page of a comparison: what several mappers believe of one drive, over one line of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from albot_core.geometry.types import Poses, Segments
from albot_core.sensing.reading import Reading
from albot_env.rendering.page.document import document
from albot_env.rendering.page.episode_page import centimetres, single
from albot_env.rendering.page.tables import Arrays, LifetimeTable, millimetres
from albot_env.rendering.page.tracks import Track, pose_numbers

RADIUS = 0.25
"""Radius of the robot where it is not known (m)."""


def comparison_page(
    title: str,
    heading: Mapping[str, Any],
    *,
    readings: Sequence[Reading],
    tracks: Sequence[Track],
    errors: Mapping[str, np.ndarray],
    poses: Poses | None = None,
    walls: Segments | None = None,
    command: str = "",
) -> bytes:
    """Return the page of a comparison as HTML.

    Args:
        title: Its title.
        heading: What is told of the drive, by name.
        readings: The robot's readings: the moments of the page.
        tracks: What each mapper believed, all in one frame.
        errors: The position error of each mapper at each moment (m), by its name.
        poses: True poses of the robot in that frame; None if unknown.
        walls: The world's walls in that frame; None if unknown.
        command: The command that makes the comparison again.
    """
    known = np.empty((0, 3)) if poses is None else poses
    arrays: Arrays = {
        "times": np.array([reading.stamp for reading in readings]),
        "poses": pose_numbers(known),
        "walls": millimetres(np.empty((0, 4)) if walls is None else walls),
        **{f"things.{name}": each for name, each in LifetimeTable(4).arrays.items()},
        **{f"curve.{k}": single(each) for k, each in enumerate(errors.values())},
    }
    for number, track in enumerate(tracks):
        arrays |= {f"track.{number}.{name}": each for name, each in track.arrays.items()}
    start = known[0] if len(known) else np.zeros(3)
    facts: dict[str, Any] = {
        "title": title,
        "heading": dict(heading),
        "command": command,
        "start": start.tolist(),
        "radius": RADIUS,
        "led": False,
        "map_interval": 0,
        "rooms": [],
        "terms": [],
        "curves": [f"position error of {name}" for name in errors],
        "events": [],
        "tracks": [track.facts for track in tracks],
        "laser": None,
    }
    scans = [reading.laser for reading in readings]
    geometries = {scan.geometry if scan else None for scan in scans}
    if len(known) and len(geometries) == 1 and scans[0] is not None:
        arrays["scans"] = np.array([centimetres(scan) for scan in scans if scan], np.uint16)
        arrays["bearings"] = scans[0].geometry.bearings.astype(np.float32)
        facts["laser"] = {"mount": list(scans[0].geometry.mount)}
    return document(title, facts, arrays)
