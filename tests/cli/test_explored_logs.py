"""Logs of simulated robots."""

from __future__ import annotations

import pytest

from albot_agents.engine.local import LocalEngine
from albot_cli.explored_logs import Exploration, explore_all
from albot_core.errors import InputError
from tests.inline_engine import InlineEngine

SENSORS = {"laser": "none", "sonar": "none"}


def _exploration(**changes) -> Exploration:
    usual = {"world": "square-loop", "seed": 1, "agent": "random", "steps": 1, "sensors": SENSORS}
    return Exploration(**usual | changes)


def test_logs_come_in_the_order_of_their_explorations_whichever_ends_first() -> None:
    explorations = [
        _exploration(steps=1),
        _exploration(steps=2, seed=2),
        _exploration(steps=3, world="office-ring"),
    ]
    logs = explore_all(explorations, InlineEngine(backwards=True))
    assert [len(log.readings) for log in logs] == [2, 3, 4]
    assert [log.reference is not None for log in logs] == [True] * 3


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"world": "square-lop"}, "did you mean square-loop"),
        ({"agent": "oracle"}, "found oracle, which is for Albot/Homing-v0"),
        ({"sensors": {"laser": "lng"}}, "laser"),
    ],
)
def test_what_cannot_be_explored_is_refused_before_any_process_begins(changes, message) -> None:
    with pytest.raises(InputError, match=message):
        explore_all([_exploration(**changes)], LocalEngine(1))
