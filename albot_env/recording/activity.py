"""Conversion of an attractor network's activity to messages and back.

Like a map, the activity is in an episode file twice: exactly, in `/albot/activity`, as a list of
active cells; and as a grid in the network's own frame, for display in Foxglove.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator
from typing import Any

import numpy as np

from albot_core.maps.activity import MOST_CELLS, Activity
from albot_core.plain_data import Location, read_array, read_record
from albot_env.recording.foxglove import Message, pose_of, time_of

_FIELDS = {
    "cell": float,
    "rows": int,
    "columns": int,
    "active": list[int],
    "values": Any,
    "packet": Any,
}


def activity_messages(activity: Activity, stamp: float) -> Iterator[Message]:
    """Return the messages of the activity at a time (s)."""
    values, cell = activity.values, activity.cell
    rows, columns = values.shape
    shades = np.rint(255 * values / max(float(values.max()), np.finfo(np.float32).tiny))
    yield (
        "/activity",
        {
            "timestamp": time_of(stamp),
            "frame_id": "network",
            "pose": pose_of(np.zeros(3)),
            "column_count": columns,
            "cell_size": {"x": cell, "y": cell},
            "row_stride": columns,
            "cell_stride": 1,
            "fields": [{"name": "activity", "offset": 0, "type": 1}],
            "data": base64.b64encode(shades.astype(np.uint8).tobytes()).decode(),
        },
    )
    active = np.flatnonzero(values)
    yield (
        "/albot/activity",
        {
            "cell": cell,
            "rows": rows,
            "columns": columns,
            "active": active.tolist(),
            "values": values.ravel()[active].tolist(),
            "packet": activity.packet.tolist(),
        },
    )


def activity_from_message(content: Any, where: Location) -> Activity:
    """Read the activity from an `/albot/activity` message; `where` is its place in the file.

    Raises:
        InputError: The message violates its schema; the error names the place.
    """
    fields = read_record(_FIELDS, content, where)
    for name in ("rows", "columns"):
        if not 0 < fields[name] <= MOST_CELLS:
            raise where.at(name).error(f"a number from 1 to {MOST_CELLS}", str(fields[name]))
    values = np.zeros((fields["rows"], fields["columns"]), np.float32)
    for cell in fields["active"]:
        if not 0 <= cell < values.size:
            raise where.at("active").error(f"numbers of {values.size} places", str(cell))
    active = np.array(fields["active"], np.int64)
    amounts = read_array((len(active),), fields["values"], where.at("values"))
    packet = read_array((3,), fields["packet"], where.at("packet"))
    # Values beyond float32 become infinite.
    with where.relocate_errors(), np.errstate(over="ignore"):
        values.ravel()[active] = amounts
        return Activity(cell=fields["cell"], values=values, packet=packet)
