"""The geometric map: the way of a journey, with the surfaces beside it; and its ASRs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from albot_core.errors import InputError
from albot_core.mappers.albot0.ground import Ground
from albot_core.mappers.albot0.paths import FARTHEST
from albot_core.mappers.albot0.regions import RegionConfig, Regions, split_journey
from albot_core.mappers.albot0.steps import ECHOES, NO_STEPS, Steps, join_steps
from albot_core.mappers.stored_arrays import LONGEST, Shape, check_finite, check_shapes

_SHORTEST = 1e-6
"""Every step has some length (m)."""
_SHAPES: dict[str, Shape] = {
    "lines": ("steps", 4),
    "widths": ("steps", 2),
    "walled": ("steps", 2),
    "begins": ("steps",),
    "readings": ("steps",),
    "echoes": ("steps", ECHOES, 2),
}


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

    def state(self, prefix: str) -> dict[str, np.ndarray]:
        """The steps, as arrays by name (copies)."""
        return {f"{prefix}.{name}": getattr(self.steps, name).copy() for name in _SHAPES}

    def restore(self, prefix: str, state: Mapping[str, np.ndarray], readings: int) -> None:
        """Become what gave `state`, after so many readings.

        Raises:
            InputError: The arrays are none that a state holds.
        """
        arrays = {name: state[f"{prefix}.{name}"] for name in _SHAPES}
        prefix = f"{prefix}."
        check_shapes(arrays, _SHAPES, prefix)
        check_finite(arrays, "lines", "widths", "echoes", prefix=prefix)
        lines, widths, numbers = arrays["lines"], arrays["widths"], arrays["readings"]
        if (np.abs(lines) > FARTHEST).any():
            raise InputError(f"{prefix}lines", f"coordinates within ±{FARTHEST:g} m", "others")
        lengths = np.hypot(*(lines[:, 2:] - lines[:, :2]).T)
        if ((lengths < _SHORTEST) | (lengths > LONGEST)).any():
            raise InputError(f"{prefix}lines", f"lengths up to {LONGEST:g} m", "others")
        if ((widths < 0) | (widths > LONGEST)).any() or (widths.sum(axis=1) < _SHORTEST).any():
            raise InputError(f"{prefix}widths", f"widths up to {LONGEST:g} m", "others")
        if (np.abs(arrays["echoes"]) > 2 * LONGEST).any():
            raise InputError(f"{prefix}echoes", f"places within ±{2 * LONGEST:g} m", "others")
        if len(numbers) and (
            numbers[0] < 0 or numbers[-1] >= readings or (np.diff(numbers) < 0).any()
        ):
            raise InputError(f"{prefix}readings", f"growing numbers of {readings}", "others")
        self.clear()
        self.extend(Steps(**{name: array.copy() for name, array in arrays.items()}))
