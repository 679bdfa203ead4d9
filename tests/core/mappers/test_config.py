"""A mapper's thresholds from plain data, in maps that are saved, and the sensors that it needs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.map_file import load_map, save_map
from albot_core.mappers.mapper import MapperSpec
from albot_core.mappers.registry import check_sensors, make_mapper, mapper_spec
from albot_core.plain_data import changed_fields


def test_a_mapping_says_what_differs_from_the_default() -> None:
    mapper = make_mapper("albot1", config={"margin": 0.5, "view": {"max_range": 8.0}})
    default = Albot1Config()
    expected = replace(default, margin=0.5, view=replace(default.view, max_range=8.0))
    assert mapper.config == expected
    assert changed_fields(expected, default) == {"margin": 0.5, "view": {"max_range": 8.0}}
    thesis = make_mapper("albot1-thesis", config={"margin": 0.5})
    assert thesis.config == replace(Albot1Config.thesis(), margin=0.5)


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"margn": 0.5}, r"mapper albot1, config, margn: .*did you mean margin"),
        ({"margin": "wide"}, r"config, margin: expected a number, found wide"),
        ({"margin": float("nan")}, r"config, margin: expected"),
        ({"view": {"max_range": -1.0}}, r"config, view.max_range: expected"),
        ([], r"expected a mapping or Albot1Config"),
    ],
)
def test_a_config_that_is_none_says_where(config: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make_mapper("albot1", config=config)


def test_a_saved_map_knows_its_config(tmp_path: Path) -> None:
    config = {"places": {"match": {"max_shift": float("inf")}}, "min_landmarks": 2}
    mapper = make_mapper("albot1", config=config)
    save_map(mapper, tmp_path / "a.albot")
    assert load_map(tmp_path / "a.albot").config == mapper.config
    assert mapper.config.places.match.max_shift == float("inf")


def test_a_sensor_that_is_missing_is_named() -> None:
    check_sensors(mapper_spec("albot1"), {"laser", "sonar"}, "a log")
    with pytest.raises(InputError, match=r"a log, mapper: .* no more than sonar, found albot1"):
        check_sensors(mapper_spec("albot1"), {"sonar"}, "a log")
    seer = MapperSpec(
        name="seer",
        summary="",
        paper="",
        sensors=frozenset({"laser", "scene"}),
        layers=(),
        factory="",
        config="",
    )
    with pytest.raises(InputError, match="found seer, which needs scene"):
        check_sensors(seer, {"laser"}, "a log")


def test_a_generator_is_part_of_the_state() -> None:
    one = make_mapper("tests.core.mappers.grid:grid", rng=np.random.default_rng(5))
    other = make_mapper("tests.core.mappers.grid:grid")
    one._rng.random(3)
    other.restore(one.state())
    assert other._rng.random() == one._rng.random()
