"""Which of a scan's points count in the refinement of a pose."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.matching.likelihood_field import FieldConfig, LikelihoodField
from albot_core.matching.refinement import refine

HALF = 2.0
"""Half the side of the field (m)."""


@pytest.mark.parametrize("outside", [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1)])
def test_points_outside_the_field_count_as_nothing(outside):
    """The field has surfaces all over it, also where a wrong index would lead."""
    field = LikelihoodField(FieldConfig(cell=0.1, sigma=0.1, half=HALF))
    field.clear(np.zeros(2))
    across = np.arange(-1.55, 1.6, 0.1)
    field.add(np.zeros(3), np.stack(np.meshgrid(across, across), axis=-1).reshape(-1, 2))
    rng = np.random.default_rng(0)
    inside = rng.uniform(-1.2, 1.2, (20, 2))
    beyond = rng.uniform(-1.2, 1.2, (30, 2)) + 2 * HALF * np.array(outside)
    start, sure = np.zeros(3), np.full(3, 1e12)
    one, both = (
        refine(field, points, np.zeros_like(points), start, start, sure)
        for points in (inside, np.concatenate((inside, beyond)))
    )
    assert one.response > 0.5
    assert both.response * 50 == pytest.approx(one.response * 20)
    np.testing.assert_allclose(both.information, one.information)
