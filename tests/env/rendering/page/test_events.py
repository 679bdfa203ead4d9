"""The events that a page tells, of moments made up for each."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from albot_core.maps.layers import MapSnapshot, PlaceGraph, PlaceNode
from albot_core.sensing.reading import Reading
from albot_env.recording.episode import Moment
from albot_env.rendering.page.events import EventFinder


def _moment(**changes: Any) -> Moment:
    given: dict[str, Any] = {
        "action": None,
        "reward": 0.0,
        "terms": {},
        "reading": Reading(stamp=0.0, motion=np.zeros(3)),
        "pose": np.zeros(3),
        "collided": False,
        "room": "hall",
        "path_length": 0.0,
        "belief": np.zeros(3),
        "home": np.zeros(3),
        "updates": 1,
        "matched_reading": None,
        "snapshot": None,
    }
    return Moment(**{**given, **changes})


def _in_place(label: str) -> MapSnapshot:
    node = PlaceNode(id=4, label=label, pose=np.zeros(3), middle=np.zeros(2))
    return MapSnapshot(layers=(PlaceGraph(nodes=(node,), current=4),))


def _between(before: Moment, after: Moment) -> list[tuple[str, str]]:
    finder = EventFinder()
    list(finder.add(before))
    found = list(finder.add(after))
    assert all(event.step == 1 for event in found)
    return [(event.kind, event.text) for event in found]


@pytest.mark.parametrize(
    ("before", "after", "event"),
    [
        ({}, {}, None),
        ({}, {"updates": 2}, ("map", "map updated (2 readings in it)")),
        ({}, {"room": "office 3"}, ("room", "entered office 3")),
        ({}, {"room": ""}, None),
        ({}, {"collided": True}, ("contact", "touched something")),
        ({"collided": True}, {"collided": True}, None),
        ({}, {"matched_reading": 7}, ("place", "recognised the place of reading 7")),
        ({"matched_reading": 6}, {"matched_reading": 7}, None),
        ({}, {"terms": {"place_recognized": 1.0}}, ("right", "a known place recognised")),
        ({}, {"terms": {"place_mistaken": -1.0}}, ("wrong", "a place mistaken for another")),
        ({}, {"facts": {"right_claims": 1}}, ("right", "claimed to know the place: right")),
        ({"facts": {"false_claims": 1}}, {"facts": {"false_claims": 1}}, None),
        (
            {"facts": {"false_claims": 1}},
            {"facts": {"false_claims": 2}},
            ("wrong", "claimed to know the place: false"),
        ),
        ({}, {"facts": {"missed": 1}}, ("wrong", "a known place missed")),
        (
            {"facts": {"declared": False}},
            {"facts": {"declared": True, "is_success": False, "distance_home": 3.2}},
            ("wrong", "declared to be home, 3.20 m from it"),
        ),
        (
            {"facts": {"declared": False}},
            {"facts": {"declared": True, "is_success": True, "distance_home": 0.1}},
            ("right", "declared to be home, 0.10 m from it"),
        ),
        ({}, {"facts": {"is_success": True}}, ("right", "success")),
        ({"snapshot": _in_place("P1")}, {"snapshot": _in_place("P1")}, None),
        (
            {"snapshot": _in_place("P1")},
            {"snapshot": _in_place("P2")},
            ("place", "believes to be in P2"),
        ),
    ],
)
def test_what_happens_between_two_moments(
    before: dict, after: dict, event: tuple[str, str] | None
) -> None:
    assert _between(_moment(**before), _moment(**after)) == ([] if event is None else [event])


def test_a_change_of_the_world_is_told_first() -> None:
    (event,) = EventFinder().add(_moment(facts={"change": "door_shut"}))
    assert (event.step, event.text) == (0, "since the way out: door shut")
    assert not list(EventFinder().add(_moment(facts={"change": "none"})))
