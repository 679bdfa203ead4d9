"""Every event says what happened and why, and survives being numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_core.mappers.albot1.places.events import (
    EVENT_COLUMNS,
    SEEN_THROUGH_EXIT,
    STANDS_WITHIN,
    Event,
    EventKind,
)

WORDS = {
    EventKind.SET_OUT: "view 7: set out in P3",
    EventKind.NEW: "view 7: left P3 through an exit never used before, into the new P5",
    EventKind.ENTERED: "view 7: left P3 through a known exit, 0.25 m from where it was expected, "
    "which leads to P5",
    EventKind.RECOGNIZED: "view 7: P3 is P5: 6 surfaces of P5 were met again, more than 4, and "
    "9 surfaces are the same (5 to the left, 4 to the right, 50% of the smaller description)",
    EventKind.REFUSED: "view 7: P3 is not taken for P5: 6 surfaces of P5 were met again, more "
    "than 4, but only 9 surfaces are the same (5 to the left, 4 to the right, 50% of the smaller "
    "description)",
    EventKind.FOLLOWED: "view 7: P3 is P5 too: one exit leads to both",
    EventKind.LOST: "view 7: lost: nothing in view is where it should be; calls it P5",
    EventKind.RETURNED: "view 7: came out of P5 into P3: it had gone into P5 unnoticed",
    EventKind.RELOCALISED: "view 7: found: P3 is P5, for 9 surfaces are the same (5 to the left, 4 "
    "to the right, 50% of the smaller description)",
}


@pytest.mark.parametrize("what", EventKind)
def test_every_event_explains_itself(what):
    event = Event(
        step=7,
        kind=what,
        place=2,
        other=4,
        reobserved=6,
        gate=4,
        matches=9,
        left=5,
        right=4,
        share=0.5,
        gap=0.25,
    )
    assert str(event) == WORDS[what]


def test_one_surface_is_told_of_as_one():
    event = Event(
        step=7, kind=EventKind.REFUSED, place=2, other=4, reobserved=1, gate=1, matches=1, left=1
    )
    text = "P3 is not taken for P5: 1 surface of P5 was met again, more than 1, but only 1 surface"
    assert f"{text} is the same (1 to the left" in str(event)


@pytest.mark.parametrize(
    ("needed", "why"),
    [
        (SEEN_THROUGH_EXIT, "P5 was in sight from the exit crossed"),
        (STANDS_WITHIN, "the robot seemed to stand within P5"),
    ],
)
def test_a_place_may_be_a_candidate_for_where_it_is(needed, why):
    event = Event(step=7, kind=EventKind.REFUSED, place=2, other=4, gate=needed)
    assert f"P3 is not taken for P5: {why}, but only 0 surfaces" in str(event)


@pytest.mark.parametrize(
    ("weighed", "text"),
    [
        ({"probability": 0.934}, "of the smaller description), with a probability of 93%"),
        ({"through_doorway": 1.0}, "description), seen from both sides of a doorway"),
    ],
)
def test_what_was_weighed_is_told(weighed, text):
    event = Event(step=7, kind=EventKind.RECOGNIZED, place=2, other=4, **weighed)
    assert str(event).endswith(text)


counts = st.integers(0, 2**31)


@given(
    st.builds(
        Event,
        step=counts,
        kind=st.sampled_from(EventKind),
        place=counts,
        other=st.integers(-1, 2**31),
        reobserved=counts,
        gate=counts,
        matches=counts,
        left=counts,
        right=counts,
        share=st.floats(0, 1),
        gap=st.floats(0, 1e6),
        nearest_in_sight=st.floats(0, 1),
        visit_in_sight=st.floats(0, 1),
        misfit=st.floats(0, 9),
        through_doorway=st.sampled_from((0.0, 1.0)),
        probability=st.floats(0, 1),
    )
)
def test_an_event_is_its_row(event):
    row = event.row()
    assert row.shape == (EVENT_COLUMNS,)
    assert row.dtype == np.float64
    assert Event.of_row(row) == event
