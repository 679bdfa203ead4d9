"""The geometric map: the way of a journey, with the surfaces beside it; and its ASRs."""

from __future__ import annotations

import numpy as np

from albot_core.mappers.albot0.ground import Ground
from albot_core.mappers.albot0.regions import RegionConfig, Regions, split_journey
from albot_core.mappers.albot0.steps import NO_STEPS, Steps, join_steps


class GeometricMap:
    """What the robot mapped on one journey.

    Attributes:
        steps: Its way.
        regions: The ASRs that the way was split into.
    """

    def __init__(self, config: RegionConfig) -> None:
        self._config = config
        self.clear()

    def clear(self) -> None:
        """Forget all."""
        self._ground = Ground()
        self.steps = NO_STEPS
        self.regions = self._split()

    def extend(self, steps: Steps) -> None:
        """Add what follows, and split the whole journey anew."""
        self._ground.add(steps.swaths)
        self.steps = join_steps(self.steps, steps)
        self.regions = self._split()

    def _split(self) -> Regions:
        steps, widths = self.steps, self.steps.widths.sum(axis=1)
        return split_journey(steps.lines, widths, steps.begins, self._ground, self._config)

    def region_at(self, reading: int) -> int:
        """The ASR where a reading was taken; 0 before the first step."""
        step = int(np.searchsorted(self.steps.readings, reading, side="right")) - 1
        return self.regions.of_step(max(step, 0))

    def part(self, region: int) -> Steps:
        """The steps of a region."""
        return self.steps.part(slice(*self.regions.splits[region : region + 2].tolist()))
