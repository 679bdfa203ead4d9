"""The program that fits the weights by which two places are judged to be one."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_studies.place_evidence import Examples, fit, gather


def test_the_weights_of_made_up_examples_are_found():
    rng = np.random.default_rng(0)
    features = np.concatenate((np.ones((200_000, 1)), rng.uniform(0, 1, (200_000, 3))), 1)
    offset, true = -0.5 * rng.uniform(0, 2, 200_000) ** 2, np.array([-3.0, 4.0, 2.0, 1.0])
    same = rng.uniform(0, 1, 200_000) < 1 / (1 + np.exp(-(features @ true + offset)))
    examples = Examples(features=features, offset=offset, same=same, count=np.ones(200_000))
    np.testing.assert_allclose(fit(examples), true, atol=0.1)


def test_without_comparisons_there_is_nothing_to_fit():
    with pytest.raises(InputError, match="worlds in which places are compared"):
        gather("office", range(3, 4), 5.0)
