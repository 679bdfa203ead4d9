"""What happened to the network of places, and why: each acceptance and refusal explained."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from jaxtyping import Float64

from albot_core.matching.lines import LineMatch


class Happening(IntEnum):
    """What can happen."""

    SET_OUT = 0
    NEW = 1
    ENTERED = 2
    RECOGNIZED = 3
    REFUSED = 4
    FOLLOWED = 5
    LOST = 6
    FOUND = 7
    RETURNED = 8


GLIMPSED = -1
"""As `Event.needed`, of a place suspected on the other side of an exit: none."""
AROUND = -2
"""The same of a place within which the robot seems to stand."""
COLUMNS = 11
"""Numbers of an event: see the fields of `Event`."""


@dataclass(frozen=True, kw_only=True)
class Event:
    """One happening."""

    step: int
    """The view at which it happened, counted from 1."""
    what: Happening
    """What happened."""
    place: int
    """The place that the robot believed to be in."""
    other: int
    """The place that it entered, or was thought to be in, or -1."""
    met: int = 0
    """How many surfaces of an earlier visit to the other place were met again."""
    needed: int = 0
    """More than how many arouse the suspicion; or GLIMPSED or AROUND."""
    matches: int = 0
    """How many surfaces of the two places are the same."""
    left: int = 0
    """How many of these are to the left of the robot."""
    right: int = 0
    """How many are to its right."""
    share: float = 0.0
    """Which share of the smaller description they make up."""
    gap: float = 0.0
    """For an exit that was known: how far it was from where it was expected (m)."""

    def row(self) -> Float64[np.ndarray, "columns"]:
        """The event as numbers."""
        return np.array([getattr(self, name) for name in _FIELDS], float)

    @classmethod
    def of_row(cls, row: Float64[np.ndarray, "columns"]) -> Event:
        """The event that `row` gave."""
        whole = [int(number) for number in row[:9]]
        fields = dict(zip(_FIELDS, [*whole, float(row[9]), float(row[10])], strict=True))
        fields["what"] = Happening(whole[1])
        return cls(**fields)  # type: ignore[arg-type]

    def __str__(self) -> str:
        """One line that says what happened and why."""
        return f"view {self.step}: {self._told()}"

    def _suspected(self) -> str:
        """Why the place was thought to be the other."""
        other = f"P{self.other + 1}"
        if self.needed == GLIMPSED:
            return f"{other} was in sight from the exit crossed"
        if self.needed == AROUND:
            return f"the robot seemed to stand within {other}"
        return f"{self.met} surfaces of {other} were met again, more than {self.needed}"

    def _told(self) -> str:
        place, other, suspicion = f"P{self.place + 1}", f"P{self.other + 1}", self._suspected()
        structure = (
            f"{self.matches} surfaces are the same ({self.left} to the left, {self.right} to "
            f"the right, {self.share:.0%} of the smaller description)"
        )
        match self.what:
            case Happening.SET_OUT:
                return f"set out in {place}"
            case Happening.NEW:
                return f"left {place} through an exit never used before, into the new {other}"
            case Happening.ENTERED:
                return (
                    f"left {place} through a known exit, {self.gap:.2f} m from where it was "
                    f"expected, which leads to {other}"
                )
            case Happening.RETURNED:
                return f"came out of {other} into {place}, which it had left by that exit unnoticed"
            case Happening.RECOGNIZED:
                return f"{place} is {other}: {suspicion}, and {structure}"
            case Happening.REFUSED:
                return f"{place} is not taken for {other}: {suspicion}, but only {structure}"
            case Happening.FOLLOWED:
                return f"{place} is {other} too: one exit leads to both"
            case Happening.LOST:
                return f"lost: nothing in view is where it should be; calls it {other}"
            case Happening.FOUND:
                return f"found: {place} is {other}, for {structure}"


_FIELDS = tuple(Event.__dataclass_fields__)


class Record:
    """The last happenings, the oldest first.

    Args:
        kept: How many are remembered.
        start: The id of the place that the robot set out from.
    """

    def __init__(self, kept: int, start: int) -> None:
        self._kept = kept
        self.events: list[Event] = [Event(step=1, what=Happening.SET_OUT, place=start, other=-1)]

    def note(self, event: Event) -> None:
        """Remember a happening, and forget the oldest if they are too many."""
        self.events.append(event)
        del self.events[: -self._kept]

    def explain(
        self,
        step: int,
        what: Happening,
        place: int,
        other: int,
        likeness: LineMatch,
        met: int = 0,
        needed: int = 0,
    ) -> None:
        """Remember that two places were compared, and how alike they were."""
        self.note(
            Event(
                step=step,
                what=what,
                place=place,
                other=other,
                met=met,
                needed=needed,
                matches=likeness.matches,
                left=likeness.left,
                right=likeness.right,
                share=likeness.share,
            )
        )

    def glimpsed(self) -> set[int]:
        """Places suspected, but refused, in the visit before the present one to a new place."""
        begun, glimpsed = False, set()
        for event in reversed(self.events):
            if event.what == Happening.REFUSED:
                if begun and event.needed >= 0:
                    glimpsed.add(event.other)
            elif begun or event.what != Happening.NEW:
                break
            else:
                begun = True
        return glimpsed
