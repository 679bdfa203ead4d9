"""How probable it is that a lost robot is here or there."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.places.hypothesis import (
    OF_ACROSS,
    OF_MATCH,
    OF_MISSING,
    OF_SHARE,
    PRIOR,
    Hypothesis,
    weighed,
)
from albot_core.matching.line_matching import LineMatch


def hypothesis(
    matches: int, share: float = 1.0, missing: float = 0.0, across: int = 0
) -> Hypothesis:
    match = LineMatch(np.zeros(3), matches, matches, 0, share)
    return Hypothesis(0, match, np.zeros(3), missing, across)


def probability(one: Hypothesis, *others: Hypothesis) -> float:
    return weighed((one, *others))[0].probability


def test_the_log_odds_add_up():
    odds = PRIOR + 9 * OF_MATCH + 0.5 * OF_SHARE + 0.1 * OF_MISSING + 2 * OF_ACROSS
    assert hypothesis(9, 0.5, 0.1, 2).log_odds == pytest.approx(odds)
    assert probability(hypothesis(9, 0.5, 0.1, 2)) == pytest.approx(1 / (1 + np.exp(-odds)))


def test_the_hypotheses_compete_with_each_other_and_with_unknown_ground():
    all_of_them = weighed([hypothesis(12), hypothesis(9), hypothesis(3)])
    odds = np.exp([one.log_odds for one in all_of_them])
    found = [one.probability for one in all_of_them]
    assert found == pytest.approx((odds / (1 + odds.sum())).tolist())
    assert sum(found) < 1
    assert weighed(()) == ()


def test_odds_beyond_all_numbers_are_certain():
    """Of a thousand walls met: their odds are no floating-point number any more."""
    found = [one.probability for one in weighed([hypothesis(2000), hypothesis(3)])]
    assert found == [1.0, 0.0]
    assert probability(hypothesis(0, 0.0, 1.0, 10_000)) == 0.0


def test_what_two_places_explain_alike_is_believed_of_neither():
    assert probability(hypothesis(30)) > PlacesConfig().min_probability
    assert probability(hypothesis(30), hypothesis(30)) == pytest.approx(0.5)


@pytest.mark.parametrize(
    "worse", [hypothesis(9), hypothesis(10, 0.5), hypothesis(10, 1, 0.1), hypothesis(10, 1, 0, 1)]
)
def test_each_part_of_the_evidence_counts(worse):
    assert probability(worse) < probability(hypothesis(10))
