"""The systematic search: loops through the nest that grow, in all directions alike."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.planning.systematic_search import SearchConfig, SystematicSearch


def walk(config: SearchConfig, seed: int, step: float = 0.1) -> np.ndarray:
    """The path of a robot that goes straight to each point, from the nest's expected place."""
    search = SystematicSearch(config)
    search.begin(np.random.default_rng(seed))
    path = [np.zeros(2)]
    while not search.is_over:
        to = search.target(path[-1]) - path[-1]
        path.append(path[-1] + to * min(1.0, step / max(np.hypot(*to), 1e-9)))
    return np.array(path)


def test_each_loop_leads_through_the_nest_and_farther_than_the_last() -> None:
    config = SearchConfig(first=1.0, growth=0.5, largest=3.0, loops=6, reached=0.01)
    distances = np.hypot(*walk(config, 1).T)
    at_nest = np.flatnonzero(distances < 0.02)
    visits = np.split(distances, at_nest[np.flatnonzero(np.diff(at_nest, prepend=-9) > 3)][1:])
    farthest = [visit.max() for visit in visits if visit.max() > 0.5]
    assert farthest == pytest.approx((1.0, 1.5, 2.0, 2.5, 3.0, 3.0), abs=0.02)


def test_the_search_has_no_azimuthal_bias_and_is_densest_at_the_nest() -> None:
    paths = np.concatenate([walk(SearchConfig(), seed, step=0.2) for seed in range(8)])
    distances = np.hypot(*paths.T)
    away = paths[distances > 0.5]
    assert np.hypot(*paths.mean(axis=0)) < 0.03 * distances.mean()
    mean_direction = (away / np.hypot(*away.T)[:, None]).mean(axis=0)
    assert np.hypot(*mean_direction) < 0.03
    edges = np.arange(0.0, 7.0)
    density = np.histogram(distances, edges)[0] / np.diff(edges**2)
    assert (np.diff(density) < 0).all()


def test_a_search_ends_at_the_expected_place() -> None:
    search = SystematicSearch(SearchConfig(loops=1))
    for _ in range(8):
        assert not search.is_over
        search.skip()
    assert search.is_over
    assert search.target(np.array((3.0, 4.0))).tolist() == [0.0, 0.0]


def test_two_searches_differ_and_one_seed_gives_one_search() -> None:
    config = SearchConfig(loops=2)
    assert (walk(config, 1) == walk(config, 1)).all()
    assert not np.array_equal(walk(config, 1)[:20], walk(config, 2)[:20])


@pytest.mark.parametrize("field", ["first", "growth", "largest", "reached", "loops"])
def test_wrong_parameters_are_refused(field: str) -> None:
    with pytest.raises(InputError, match=f"SearchConfig.{field}"):
        SearchConfig(**{field: 0 if field == "loops" else 0.0})
