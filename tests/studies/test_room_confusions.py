"""The program that counts the worlds in which a room is taken for another."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.albot1.places.events import Event, EventKind
from albot_studies.room_confusions import Drive, comparisons, measure, mistakes


def drive(rooms: str, events: dict[int, tuple[EventKind, int, int]]) -> tuple[Drive, np.ndarray]:
    """A drive through rooms, a letter a reading, in which something happens at some readings."""
    happened = [
        (Event(step=k + 1, kind=events[k][0], place=events[k][1], other=events[k][2]),)
        if k in events
        else ()
        for k in range(len(rooms))
    ]
    letters = np.array(list(rooms))
    points = np.zeros((len(rooms), 2))
    return Drive(points=points, events=tuple(happened)), letters[:, None] == letters


@pytest.mark.parametrize(("last", "wrong"), [("A", 0), ("C", 1)])
def test_a_room_taken_for_another_is_found(last, wrong):
    new, same = EventKind.NEW, EventKind.RECOGNIZED
    driven = drive("AAAABBBB" + 4 * last, {4: (new, 0, 1), 8: (new, 1, 2), 11: (same, 2, 0)})
    rooms, doors = mistakes(*driven)
    assert [k for k, _, _ in rooms] == [11] * wrong
    assert not doors


@pytest.mark.parametrize(
    ("after", "wrong"), [("AAAAAA", 0), ("CCCCCC", 1), ("CC", 0), ("AAACCC", 0)]
)
def test_a_wrong_door_is_found(after, wrong):
    driven = drive("AAAABBBB" + after, {4: (EventKind.NEW, 0, 1), 8: (EventKind.ENTERED, 1, 0)})
    rooms, doors = mistakes(*driven)
    assert [k for k, _, _ in doors] == [8] * wrong
    assert not rooms


@pytest.mark.parametrize(("last", "share"), [("A", 1.0), ("C", 0.0)])
@pytest.mark.parametrize("kind", [EventKind.REFUSED, EventKind.RECOGNIZED])
def test_comparisons_are_told_with_what_is_true(kind, last, share):
    new = EventKind.NEW
    driven = drive("AAAABBBB" + 4 * last, {4: (new, 0, 1), 8: (new, 1, 2), 11: (kind, 2, 0)})
    ((event, same),) = comparisons(*driven)
    assert (event.kind, same) == (kind, share)


def test_worlds_are_counted():
    found = measure("office", range(3, 4), 30.0, "albot1")
    assert (found["count"], found["worlds"]) == (1, "random:office:3..3")
    assert found["worlds_with_a_room_taken_for_another"] == found["merged_wrongly"] == 0
