"""Events of RatSLAM: re-localisations, and losses of all activity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from albot_core.mappers.ratslam.arrays import Table
from albot_core.mappers.schema import Field, Schema
from albot_core.mappers.stored import Stored

RELOCALISED, SEEDED = 0, 1
"""The kinds of events."""


@dataclass(frozen=True, kw_only=True)
class Event:
    """A re-localisation, or the loss of all activity."""

    kind: int
    """`RELOCALISED`, or `SEEDED` if the network had lost all activity."""
    reading: int
    """Number of the reading at which it happened."""
    view: int
    """The view that caused it; -1 for none."""
    before: int
    """Id of the experience before."""
    after: int
    """Id of the experience after."""
    jump: float
    """Distance that the packet jumped in the plane of the pose cells (m)."""
    turn: float
    """Angle that the packet turned (rad)."""

    def __str__(self) -> str:
        """Return the event as one line."""
        if self.kind == SEEDED:
            return f"reading {self.reading}: all activity was lost, seeded anew"
        return (
            f"reading {self.reading}: view {self.view} re-localised the robot from E{self.before} "
            f"to E{self.after}, {self.jump:.2f} m and {np.degrees(self.turn):.0f}° in the pose "
            "cells"
        )


class EventLog(Stored):
    """The events in order."""

    SCHEMA = Schema(parts=("_table",))

    def __init__(self) -> None:
        whole = (Field(name, "", int) for name in ("reading", "view", "before", "after"))
        kind = Field("kind", "", int, least=RELOCALISED, most=SEEDED)
        self._table = Table("events", kind, *whole, Field("jump"), Field("turn"))

    def clear(self) -> None:
        """Remove all events."""
        self._table.clear()

    def add(self, event: Event) -> None:
        """Append an event."""
        self._table.append(**vars(event))

    @property
    def events(self) -> tuple[Event, ...]:
        """All events."""
        names = tuple(Event.__dataclass_fields__)
        columns = [self._table.rows(name).tolist() for name in names]
        return tuple(
            Event(**dict(zip(names, row, strict=True))) for row in zip(*columns, strict=True)
        )
