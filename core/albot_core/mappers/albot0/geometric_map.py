"""The geometric map: the steps of a journey with the surfaces beside them, and its ASRs."""

from __future__ import annotations

import numpy as np

from albot_core.mappers.albot0.ground import Ground
from albot_core.mappers.albot0.regions import RegionConfig, Regions, split_journey
from albot_core.mappers.albot0.steps import NO_STEPS, Steps, join_steps


class GeometricMap:
    """The robot's map of one journey.

    Attributes:
        steps: The steps of the journey.
        regions: The ASRs into which the journey was split.
    """

    def __init__(self, config: RegionConfig) -> None:
        self._config = config
        self.clear()

    def clear(self) -> None:
        """Forget all steps."""
        self._ground = Ground()
        self.steps = NO_STEPS
        self.regions = self._split()

    def extend(self, steps: Steps) -> None:
        """Add the next steps, and split the whole journey again."""
        self._ground.add(steps.swaths)
        self.steps = join_steps(self.steps, steps)
        self.regions = self._split()

    def _split(self) -> Regions:
        steps, widths = self.steps, self.steps.widths.sum(axis=1)
        return split_journey(steps.lines, widths, steps.begins, self._ground, self._config)

    def region_at(self, reading: int) -> int:
        """Return the ASR where a reading was taken; 0 before the first step."""
        step = int(np.searchsorted(self.steps.readings, reading, side="right")) - 1
        return self.regions.of_step(max(step, 0))

    def part(self, region: int) -> Steps:
        """Return the steps of a region."""
        return self.steps.part(slice(*self.regions.splits[region : region + 2].tolist()))
