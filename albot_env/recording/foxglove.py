"""Parts of Foxglove's messages: times, poses, and scenes of lines and texts."""

from __future__ import annotations

from typing import Any

import numpy as np

from albot_core.geometry.types import Pose, Segments
from albot_env.recording.schemas import PRIMITIVES

Message = tuple[str, dict[str, Any]]
"""A topic and the content of a message."""


def nanoseconds(stamp: float) -> int:
    """Return a simulated time (s) in whole nanoseconds."""
    return round(stamp * 1e9)


def time_of(stamp: float) -> dict[str, int]:
    """Return a time (s) as seconds and nanoseconds."""
    sec, nsec = divmod(nanoseconds(stamp), 1_000_000_000)
    return {"sec": sec, "nsec": nsec}


def pose_of(pose: Pose) -> dict[str, dict[str, float]]:
    """Return a pose on the floor as a 3D pose."""
    x, y, heading = pose.tolist()
    half = heading / 2
    return {
        "position": {"x": x, "y": y, "z": 0.0},
        "orientation": {"x": 0.0, "y": 0.0, "z": float(np.sin(half)), "w": float(np.cos(half))},
    }


def transform(stamp: float, parent: str, child: str, pose: Pose) -> dict[str, Any]:
    """Return the transform of a child frame, whose pose in the parent frame is given."""
    placed = pose_of(pose)
    return {
        "timestamp": time_of(stamp),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": placed["position"],
        "rotation": placed["orientation"],
    }


def lines(segments: Segments, colour: dict[str, float]) -> dict[str, Any]:
    """Return line segments, rounded to the millimetre."""
    points = np.round(segments.reshape(-1, 2), 3).tolist()
    return {
        "type": 2,
        "pose": pose_of(np.zeros(3)),
        "thickness": 0.05,
        "scale_invariant": False,
        "points": [{"x": x, "y": y, "z": 0.0} for x, y in points],
        "color": colour,
        "colors": [],
        "indices": [],
    }


def scene(name: str, frame: str, stamp: float, **shapes: list[dict[str, Any]]) -> dict[str, Any]:
    """Return a scene of shapes; it replaces an earlier one of the same name."""
    entity: dict[str, Any] = {
        "timestamp": time_of(stamp),
        "frame_id": frame,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True,
        "metadata": [],
    }
    entity.update({primitive: [] for primitive in PRIMITIVES})
    return {"deletions": [], "entities": [entity | shapes]}
