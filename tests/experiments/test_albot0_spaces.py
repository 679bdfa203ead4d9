"""Albot0's seven local spaces: the floor, the measures, and verdicts that turn red."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.mappers.albot0.config import Albot0Config
from albot_core.mappers.registry import make_mapper
from albot_experiments import albot0_runs, albot0_spaces
from albot_experiments.albot0_spaces import BORDERS, SPACES, drive, report, way_out, world

SEEDS = range(8, 11)


def test_the_ways_lead_through_all_spaces_in_their_order() -> None:
    floor = world()
    for seed in range(10):
        way = way_out(np.random.default_rng(seed))
        inside = [
            [k for k, (x0, y0, x1, y1) in enumerate(SPACES) if x0 <= x <= x1 and y0 <= y <= y1]
            for x, y in way.tolist()
        ]
        assert all(inside)
        assert inside[0] == [0] and inside[-1] == [6]
        assert [here for here in inside if len(here) == 2] == [[k, k + 1] for k in range(6)]
        assert all(floor.free_space.clearance(point) > 0.9 for point in way)


def test_the_letter_finds_the_seven_spaces_and_its_verdict_is_green() -> None:
    runs = [drive(world(), seed)["albot0-paper"] for seed in SEEDS]
    green = report(world(), {"albot0-paper": runs, "albot0": runs}, SEEDS)
    assert green.verdicts["albot0-paper"] and green.holds
    assert set(green.pictures) == {"spaces-albot0-paper", "spaces-albot0"}
    assert all(run.found == len(BORDERS) for run in runs)
    assert all(run.difference < 0.1 for run in runs)


def test_the_verdict_is_red_where_no_space_is_parted(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a threshold that no two widths exceed, the whole way is one local space."""
    config = Albot0Config.paper()
    regions = replace(config.regions, threshold=50.0)

    def whole(name: str) -> object:
        return make_mapper(name, config=replace(config, regions=regions))

    monkeypatch.setattr(albot0_runs, "make_mapper", whole)
    monkeypatch.setattr(albot0_spaces, "MAPPERS", {"albot0-paper": "paper"})
    runs = [drive(world(), seed)["albot0-paper"] for seed in range(1)]
    red = report(world(), {"albot0-paper": runs, "albot0": runs}, range(1))
    assert not red.holds and not red.verdicts["albot0-paper"]
    assert runs[0].maps[0].regions.count == 1
    assert runs[0].found == 0
