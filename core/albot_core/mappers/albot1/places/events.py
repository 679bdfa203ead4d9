"""The events of the network of places: each acceptance and refusal, with its reasons."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from jaxtyping import Float64

from albot_core.counts import many
from albot_core.matching.line_matching import LineMatch


class EventKind(IntEnum):
    """The kinds of events."""

    SET_OUT = 0
    NEW = 1
    ENTERED = 2
    RECOGNIZED = 3
    REFUSED = 4
    FOLLOWED = 5
    LOST = 6
    RELOCALISED = 7
    RETURNED = 8


SEEN_THROUGH_EXIT = -1
"""Value of a gate: no surface needs to be re-observed, for the place was a candidate before the
last exit."""
STANDS_WITHIN = -2
"""Value of a gate: no surface needs to be re-observed, for the robot seems to stand in the
place."""
EVENT_COLUMNS = 16
"""Number of values of an event: see the fields of `Event`."""


@dataclass(frozen=True, kw_only=True)
class Event:
    """A change of the network, or a refused one."""

    step: int
    """The view at which it happened, counted from 1."""
    kind: EventKind
    """The kind of event."""
    place: int
    """The place in which the robot believed to be."""
    other: int
    """The place that the robot entered or that was compared; -1 for none."""
    reobserved: int = 0
    """Number of surfaces of an earlier visit to the other place that were observed again."""
    gate: int = 0
    """The place is a candidate with more re-observed surfaces than this; or SEEN_THROUGH_EXIT or
    STANDS_WITHIN."""
    matches: int = 0
    """Number of surfaces of the two places that match."""
    left: int = 0
    """Number of them to the left of the robot."""
    right: int = 0
    """Number of them to the right of the robot."""
    share: float = 0.0
    """The share of the smaller description that matches."""
    gap: float = 0.0
    """For a known exit: its distance from where it was expected (m)."""
    nearest_in_sight: float = 0.0
    """For places whose structure matches: the evidence, here and in the next fields
    (`Evidence`)."""
    visit_in_sight: float = 0.0
    misfit: float = 0.0
    through_doorway: float = 0.0
    probability: float = 0.0
    """The probability that the two places are one; 0 if it was not computed."""

    def row(self) -> Float64[np.ndarray, "columns"]:
        """Return the event as numbers."""
        return np.array([getattr(self, name) for name in _FIELDS], float)

    @classmethod
    def of_row(cls, row: Float64[np.ndarray, "columns"]) -> Event:
        """Return the event from the numbers that `row` returned."""
        whole = [int(number) for number in row[:9]]
        fields = dict(zip(_FIELDS, [*whole, *map(float, row[9:])], strict=True))
        fields["kind"] = EventKind(whole[1])
        return cls(**fields)  # type: ignore[arg-type]

    def __str__(self) -> str:
        """Return one line that says what happened and why."""
        return f"view {self.step}: {self._told()}"

    def _reason(self) -> str:
        """Return why the other place was a candidate."""
        other = f"P{self.other + 1}"
        if self.gate == SEEN_THROUGH_EXIT:
            return f"{other} was in sight from the exit crossed"
        if self.gate == STANDS_WITHIN:
            return f"the robot seemed to stand within {other}"
        met = many(self.reobserved, f"surface of {other} was", f"surfaces of {other} were")
        return f"{met} met again, more than {self.gate}"

    def _structure(self) -> str:
        """Return how the two places match."""
        structure = (
            f"{many(self.matches, 'surface is', 'surfaces are')} the same ({self.left} to the "
            f"left, {self.right} to the right, {self.share:.0%} of the smaller description)"
        )
        if self.through_doorway:
            return f"{structure}, seen from both sides of a doorway"
        if self.probability:
            return f"{structure}, with a probability of {self.probability:.0%}"
        return structure

    def _told(self) -> str:
        place, other, reason = f"P{self.place + 1}", f"P{self.other + 1}", self._reason()
        structure = self._structure()
        match self.kind:
            case EventKind.SET_OUT:
                return f"set out in {place}"
            case EventKind.NEW:
                return f"left {place} through an exit never used before, into the new {other}"
            case EventKind.ENTERED:
                return (
                    f"left {place} through a known exit, {self.gap:.2f} m from where it was "
                    f"expected, which leads to {other}"
                )
            case EventKind.RETURNED:
                return f"came out of {other} into {place}: it had gone into {other} unnoticed"
            case EventKind.RECOGNIZED:
                return f"{place} is {other}: {reason}, and {structure}"
            case EventKind.REFUSED:
                return f"{place} is not taken for {other}: {reason}, but only {structure}"
            case EventKind.FOLLOWED:
                return f"{place} is {other} too: one exit leads to both"
            case EventKind.LOST:
                return f"lost: nothing in view is where it should be; calls it {other}"
            case EventKind.RELOCALISED:
                return f"found: {place} is {other}, for {structure}"


_FIELDS = tuple(Event.__dataclass_fields__)


class EventLog:
    """The latest events, the oldest first.

    Args:
        kept: Maximum number of events remembered.
        start: The id of the place that the robot set out from.
    """

    def __init__(self, kept: int, start: int) -> None:
        self._kept = kept
        self.events: list[Event] = [Event(step=1, kind=EventKind.SET_OUT, place=start, other=-1)]

    def add(self, event: Event) -> None:
        """Add an event, and forget the oldest if there are too many."""
        self.events.append(event)
        del self.events[: -self._kept]

    def add_comparison(
        self,
        step: int,
        kind: EventKind,
        place: int,
        other: int,
        found: LineMatch,
        reobserved: int = 0,
        gate: int = 0,
        **weighed: float,
    ) -> None:
        """Add a comparison of two places: how they match, and the evidence if it was weighed."""
        self.add(
            Event(
                step=step,
                kind=kind,
                place=place,
                other=other,
                reobserved=reobserved,
                gate=gate,
                matches=found.matches,
                left=found.left,
                right=found.right,
                **({"share": found.share} | weighed),
            )
        )

    def seen_through_exit(self) -> set[int]:
        """Return the places refused as candidates just before the robot left for a new place."""
        is_earlier, places = False, set()
        for event in reversed(self.events):
            if event.kind == EventKind.REFUSED:
                if is_earlier and event.gate >= 0:
                    places.add(event.other)
            elif is_earlier or event.kind != EventKind.NEW:
                break
            else:
                is_earlier = True
        return places
