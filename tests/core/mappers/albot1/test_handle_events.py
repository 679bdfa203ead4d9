"""What happened at a reading: the last view is laid over the map, and counts as laid."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.albot1.batch import Albot1Batch
from albot_core.mappers.albot1.handle_events import handle_events
from albot_core.mappers.albot1.step import CROSSED, KIDNAPPED
from albot_core.sensing.reading import Readings
from tests.core.scenes import ROOM, scan_from


@pytest.mark.parametrize("event", [CROSSED, KIDNAPPED])
def test_the_view_with_which_a_visit_begins_is_the_last_laid_over_the_map(event: int) -> None:
    batch, scan = Albot1Batch(1), scan_from(np.zeros(3), ROOM)
    still = Readings(
        stamps=np.zeros(1),
        motions=np.zeros((1, 3)),
        laser=scan.geometry,
        ranges=scan.ranges[None],
    )
    for _ in range(3):
        batch.update(np.array([0]), still)
    robot = batch._robot(0)
    robot.exits.crossing[:] = (2.0, -0.5, 2.0, 0.5, 1.0)
    robot.progress["inconsistent"] = 2
    updates = int(robot.progress["updates"])
    handle_events(robot, event, batch.config.limits)
    assert robot.progress["step"] == 3
    assert robot.progress["updated_at"] == 2  # Views are counted from 0.
    assert robot.progress["updates"] == updates + 1
    assert robot.progress["inconsistent"] == 0
    assert len(robot.network.visits) == 3
