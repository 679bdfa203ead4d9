"""Events: what the tree of maps made of each travel."""

from __future__ import annotations

from dataclasses import dataclass

from albot_core.mappers.ratslam.arrays import Table
from albot_core.mappers.schema import Field, Schema
from albot_core.mappers.stored import Stored

NEW, RECOGNISED, CONTRADICTED = 0, 1, 2
"""The kinds of events."""


@dataclass(frozen=True, kw_only=True)
class Event:
    """A travel to a place, and the maps that agree with it."""

    kind: int
    """`NEW` or `RECOGNISED` as the preferred map has it, or `CONTRADICTED` if no map agreed."""
    reading: int
    """Number of the reading at which the place was left again, and its star was complete."""
    place: int
    """Id of the place in the preferred map."""
    gateways: int
    """Number of its gateways."""
    maps: int
    """Number of maps that are kept."""
    minimal: int
    """Number of maps that circumscription leaves."""
    forgotten: int
    """Number of maps forgotten at this travel because of the limit."""
    switched: int
    """1 if the preferred map holds other places for the earlier visits than before, else 0."""

    def __str__(self) -> str:
        """Return the event as one line."""
        what = {
            NEW: f"P{self.place} is new",
            RECOGNISED: f"P{self.place} is recognised",
            CONTRADICTED: f"no map agrees, P{self.place} is taken for new",
        }[self.kind]
        text = (
            f"reading {self.reading}: {what}, {self.gateways} gateways; {self.maps} maps agree, "
            f"{self.minimal} of them minimal"
        )
        if self.switched:
            text += "; another map is preferred now"
        if self.forgotten:
            text += f"; the limit is met, {self.forgotten} maps are forgotten"
        return text


class EventLog(Stored):
    """The events in order."""

    SCHEMA = Schema(parts=("_table",))

    def __init__(self) -> None:
        names = ("reading", "place", "gateways", "maps", "minimal", "forgotten")
        self._table = Table(
            "events",
            Field("kind", "", int, least=NEW, most=CONTRADICTED),
            *(Field(name, "", int, least=0) for name in names),
            Field("switched", "", int, least=0, most=1),
        )

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
