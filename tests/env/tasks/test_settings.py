"""What an environment's settings may be."""

from __future__ import annotations

from typing import Any

import gymnasium
import pytest

from albot_core.errors import InputError
from albot_env.tasks.core.wayfinding import WayfindingConfig


def test_of_an_unknown_mapper_it_is_said_that_there_may_be_none() -> None:
    with pytest.raises(InputError, match=r"^mapper: expected none or one of albot0, albot0-paper"):
        gymnasium.make("Albot/Explore-v0", mapper="albot9")


def test_a_list_of_worlds_for_one_environment_is_a_set() -> None:
    pair = ["square-loop", "office-ring"]
    envs: Any = gymnasium.make_vec(
        "Albot/Explore-v0", num_envs=3, world=[pair, pair, "square-loop"], mapper="none"
    )
    infos = [envs.reset(seed=seed)[1]["world"] for seed in range(6)]
    assert {world for worlds in infos for world in worlds[:2]} == set(pair)
    assert {worlds[2] for worlds in infos} == {"square-loop"}
    envs.close()
    with pytest.raises(InputError, match=r"world of environment 1, .*found offic"):
        gymnasium.make_vec("Albot/Explore-v0", num_envs=2, world=["office-ring", ["offic"]])


def test_a_number_too_large_for_a_float_is_refused() -> None:
    env: Any = gymnasium.make("Albot/Explore-v0", world="square-loop", mapper="none").unwrapped
    env.reset(seed=0)
    with pytest.raises(InputError, match="action: expected 3 finite numbers"):
        env.step([10**400, 0, 0])
    with pytest.raises(InputError, match="found numbers that are too large"):
        env.step([10**5000, 0, 0])
    env.close()


@pytest.mark.parametrize(
    "values",
    [
        {"coverage": {"cell": 1e-12}},
        {"coverage": {"patch_cells": 10**6}},
        {"wayfinding": {"cell": 0.001}},
        {"wayfinding": {"reach": 1e308}},
        {"map_patch": {"cells": 10**6}},
        {"map_patch": {"trail_spacing": 1e-12}},
        {"map_patch": {"trail_length": 1e12}},
        {"place_graph": {"places": 10**10}},
        {"matches": 10**10},
    ],
)
def test_what_would_fill_all_memory_is_refused_by_name(values: dict[str, Any]) -> None:
    ((name, inner),) = values.items()
    place = ".".join(("config.observations", name, *(inner if isinstance(inner, dict) else ())))
    with pytest.raises(InputError, match=rf"{place}: expected a "):
        gymnasium.make("Albot/Explore-v0", config={"observations": values})


def test_cells_too_small_for_the_grid_are_refused() -> None:
    with pytest.raises(InputError, match=r"WayfindingConfig.cell: expected a side from 0.1 m"):
        WayfindingConfig(cell=0.01, reach=1000.0)
