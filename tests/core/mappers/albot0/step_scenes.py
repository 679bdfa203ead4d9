"""Steps without surfaces and echoes, from point to point."""

from __future__ import annotations

import numpy as np

from albot_core.mappers.albot0.steps import ECHOES, NO_STEPS, Steps, join_steps


def steps_along(*points: tuple[float, float]) -> Steps:
    """Steps from point to point, of 1 m each."""
    steps = NO_STEPS
    for start, end in zip(np.array(points[:-1]), np.array(points[1:]), strict=True):
        count = round(float(np.hypot(*(end - start))))
        ends = start + np.linspace(0, 1, count + 1)[:, None] * (end - start)
        lines = np.concatenate((ends[:-1], ends[1:]), axis=1)
        steps = join_steps(
            steps,
            Steps(
                lines=lines,
                widths=np.full((count, 2), 4.0),
                walled=np.zeros((count, 2), np.bool_),
                begins=np.arange(count) == 0,
                readings=np.arange(count) + len(steps.readings),
                echoes=np.zeros((count, ECHOES, 2)),
            ),
        )
    return steps
