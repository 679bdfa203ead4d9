"""What happened to the robot's belief, and why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from albot_core.mappers.ratslam.arrays import Table

RELOCALISED, SEEDED = 0, 1
"""The kinds of events."""


@dataclass(frozen=True, kw_only=True)
class Event:
    """A re-localisation, or the end of all activity."""

    kind: int
    """`RELOCALISED`, or `SEEDED` where the network had lost all activity."""
    reading: int
    """At which reading it happened."""
    view: int
    """The view that caused it, -1 for none."""
    before: int
    """The experience before."""
    after: int
    """The experience after."""
    jump: float
    """How far the packet went in the plane of the pose cells (m)."""
    turn: float
    """How far it turned (rad)."""

    def __str__(self) -> str:
        """The event as one line."""
        if self.kind == SEEDED:
            return f"reading {self.reading}: all activity was lost, seeded anew"
        return (
            f"reading {self.reading}: view {self.view} re-localised the robot from E{self.before} "
            f"to E{self.after}, {self.jump:.2f} m and {np.degrees(self.turn):.0f}° in the pose "
            "cells"
        )


class EventLog:
    """The events in order."""

    def __init__(self) -> None:
        whole = dict.fromkeys(("kind", "reading", "view", "before", "after"), (np.int64, ()))
        self._table = Table(**whole, jump=(np.float64, ()), turn=(np.float64, ()))

    def clear(self) -> None:
        """Forget all."""
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

    def state(self) -> dict[str, np.ndarray]:
        """All events, as arrays by name."""
        return self._table.state("events")

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Become what gave `state`."""
        self._table.restore("events", state)
