"""Scales: many ranges at once are shown as each by itself."""

from __future__ import annotations

import numpy as np
import pytest

from albot_env.tasks.core.parts.scales import (
    make_log_scale,
    scale_ranges,
    scaled,
    unscale_ranges,
)

SCALE = make_log_scale(0.5, 30.0)
RANGES = np.array((0.0, 1e-3, 0.2, 0.5, 1.7, 6.3, 29.9, 30.0, 80.0, np.inf))


def test_ranges_are_shown_on_the_scale_of_lengths_from_the_other_side() -> None:
    shown = np.empty(len(RANGES), np.float32)
    scale_ranges(RANGES, SCALE, shown)
    assert shown == pytest.approx([-scaled(length, SCALE) for length in RANGES], abs=1e-6)
    assert unscale_ranges(shown, SCALE) == pytest.approx(
        np.minimum(RANGES, 30.0), rel=1e-4, abs=1e-6
    )
