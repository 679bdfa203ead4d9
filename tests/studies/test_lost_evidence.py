"""The program that fits the weights by which it is judged where a lost robot is."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_studies.lost_evidence import Examples, fit, gather, probabilities


def test_the_weights_of_made_up_examples_are_found():
    rng, count = np.random.default_rng(0), 60_000
    features = np.concatenate((np.ones((count, 3, 1)), rng.uniform(0, 2, (count, 3, 4))), 2)
    features[rng.random((count, 3)) < 0.3] = np.nan
    true = np.array([-2.0, 2.0, 1.0, -2.0, -1.0])
    examples = Examples(features=features, right=np.zeros((count, 3), bool), count=np.ones(count))
    bounds = probabilities(examples, true).cumsum(axis=1)
    drawn = (rng.random(count)[:, None] > bounds).sum(axis=1)
    right = drawn[:, None] == np.arange(3)
    found = fit(Examples(features=features, right=right, count=np.ones(count)))
    np.testing.assert_allclose(found, true, atol=0.1)


def test_robots_that_are_lost_are_examples():
    examples = gather(("random:office:SEED?rooms=8",), range(7001, 7002), 1)
    assert examples.count.sum() == pytest.approx(1.0)
    assert 0 < examples.right.any(axis=1).sum() <= len(examples.right)
    assert not examples.right[np.isnan(examples.features[..., 0])].any()


def test_without_robots_that_notice_there_is_nothing_to_fit():
    with pytest.raises(InputError, match="worlds in which robots notice"):
        gather(("random:ring:SEED",), range(7000, 7001), 1)
