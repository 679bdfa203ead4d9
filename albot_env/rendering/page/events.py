"""Events: the moments of an episode that somebody who watches it wants to find."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from albot_core.counts import many
from albot_env.recording.episode import Fact, Moment

Kind = Literal["map", "place", "right", "wrong", "contact", "room", "fault", "end"]
"""What an event is: the map was updated; the mapper believes to be in another place; somebody was
right or wrong (about a place, or about home); contact; another room; a fault; begin or end."""

COUNTED: dict[str, tuple[Kind, str]] = {
    "right_claims": ("right", "claimed to know the place: right"),
    "false_claims": ("wrong", "claimed to know the place: false"),
    "re_entries": ("room", "a room entered again"),
    "right_known": ("right", "answered with the right stop"),
    "right_new": ("right", "answered new: right"),
    "false_known": ("wrong", "answered with a false stop"),
    "missed": ("wrong", "a known place missed"),
}
"""Facts that count something, and the event when they rise."""
TERMS: dict[str, tuple[Kind, str]] = {
    "place_recognized": ("right", "a known place recognised"),
    "place_mistaken": ("wrong", "a place mistaken for another"),
}
"""Terms of the reward that are zero but when something happens."""


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that happened."""

    step: int
    """Number of the moment after it."""
    kind: Kind
    text: str
    """What happened."""


class EventFinder:
    """Finds the events of an episode, moment by moment."""

    def __init__(self) -> None:
        self._before: Moment | None = None
        self._place: str | None = None
        self._step = -1

    def add(self, moment: Moment) -> Iterator[Event]:
        """Return what happened between the moment before and this one."""
        self._step += 1
        before, self._before = self._before, moment
        for kind, text in self._found(before, moment):
            yield Event(step=self._step, kind=kind, text=text)

    def _found(self, before: Moment | None, moment: Moment) -> Iterator[tuple[Kind, str]]:
        place = self._new_place(moment)
        if before is None:
            yield from _change(moment)
            return
        if place is not None:
            yield "place", f"believes to be in {place}"
        yield from _faults(before.facts, moment.facts)
        yield from _physical(before, moment)
        yield from _judged(before, moment)
        yield from _ends(before.facts, moment.facts)

    def _new_place(self, moment: Moment) -> str | None:
        """Return the label of the place that the robot believes to be in, if it is another one."""
        if moment.snapshot is None:
            return None
        graph = moment.snapshot.place_graph
        if graph.current is None or graph.is_dense:
            return None
        label = graph.node(graph.current).label
        changed, self._place = label != self._place, label
        return label if changed else None


def _change(moment: Moment) -> Iterator[tuple[Kind, str]]:
    """Return what has changed in the world since the way out."""
    change = moment.facts.get("change")
    if isinstance(change, str) and change not in ("", "none"):
        yield "end", f"since the way out: {change.replace('_', ' ')}"


def _faults(before: Mapping[str, Fact], facts: Mapping[str, Fact]) -> Iterator[tuple[Kind, str]]:
    """Return the faults that struck, and those that are over."""
    active, ended = _names(facts.get("fault")), _names(before.get("fault"))
    for name in active:
        if name not in ended:
            yield "fault", f"fault: {name.replace('-', ' ')}"
    for name in ended:
        if name not in active:
            yield "fault", f"{name.replace('-', ' ')} is over"
    if not active and _count(facts.get("faults_struck")) > _count(before.get("faults_struck")):
        yield "fault", "a fault struck"


def _names(fact: Fact) -> tuple[str, ...]:
    """Return the names in a fact that joins some by `+`."""
    return tuple(fact.split("+")) if isinstance(fact, str) and fact else ()


def _physical(before: Moment, moment: Moment) -> Iterator[tuple[Kind, str]]:
    """Return what happened to the robot and its map."""
    if moment.updates > before.updates:
        yield "map", f"map updated ({many(moment.updates, 'reading')} in it)"
    localised = moment.facts.get("localised")
    if localised != before.facts.get("localised"):
        yield "place", "localised in the saved map" if localised else "lost in the saved map"
    if moment.room != before.room and moment.room:
        yield "room", f"entered {moment.room}"
    if moment.collided and not before.collided:
        yield "contact", "touched something"


def _judged(before: Moment, moment: Moment) -> Iterator[tuple[Kind, str]]:
    """Return the places that were recognised, and whether rightly."""
    matched = moment.matched_reading
    if matched is not None and before.matched_reading is None:
        yield "place", f"recognised the place of reading {matched}"
    for name, (kind, text) in COUNTED.items():
        if _count(moment.facts.get(name)) > _count(before.facts.get(name)):
            yield kind, text
    for name, (kind, text) in TERMS.items():
        # Facts count the claims already, which these terms judge.
        if moment.terms.get(name) and "right_claims" not in moment.facts:
            yield kind, text


def _ends(before: Mapping[str, Fact], facts: Mapping[str, Fact]) -> Iterator[tuple[Kind, str]]:
    """Return whether home was declared or reached."""
    success = bool(facts.get("is_success"))
    if facts.get("declared") and not before.get("declared"):
        distance = facts.get("distance_home")
        if isinstance(distance, float):
            text = f"declared to be home, {distance:.2f} m from it"
        else:
            text = "declared to be home"
        yield ("right" if success else "wrong"), text
    elif success and not before.get("is_success"):
        yield "right", "success"


def _count(fact: Fact) -> int:
    """Return a fact that counts; 0 where there is none."""
    return fact if isinstance(fact, int) else 0
