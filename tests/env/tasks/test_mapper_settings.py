"""The mapper inside an environment: its thresholds, and the sensors that it needs."""

from __future__ import annotations

import gymnasium
import pytest

from albot_core.errors import InputError
from albot_core.mappers.mapper import MapperSpec
from albot_core.mappers.registry import MAPPERS, register_mapper
from tests.core.mappers import topological
from tests.env import quick

TOPOLOGICAL = "tests.core.mappers.topological:topological"


@pytest.mark.parametrize("make", [gymnasium.make, gymnasium.make_vec])
@pytest.mark.parametrize("task", quick.IDS)
def test_a_mapper_is_made_with_its_thresholds(make, task) -> None:
    settings = {"mapper": TOPOLOGICAL, "mapper_config": {"width": 1.5}}
    env = make(task, **settings)
    env.close()
    with pytest.raises(InputError, match=r"mapper topological, config, widht: .*mean width"):
        make(task, mapper=TOPOLOGICAL, mapper_config={"widht": 1.5})


def test_the_thresholds_come_to_the_mapper() -> None:
    counts = []
    for width in (0.25, 2.0):
        config = topological.TopologicalConfig(width=width)
        env = gymnasium.make("Albot/Explore-v0", mapper=TOPOLOGICAL, mapper_config=config)
        env.reset(seed=1)
        for _ in range(60):
            *_, info = env.step((1.0, 0.0, -1.0))
        counts.append(info["updates"])
        env.close()
    assert counts[0] > 2 * counts[1]


def test_without_a_mapper_there_are_no_thresholds() -> None:
    with pytest.raises(InputError, match="mapper_config: expected None"):
        gymnasium.make("Albot/Explore-v0", mapper="none", mapper_config={"width": 1.0})


def test_what_a_mappers_own_module_refuses_is_told_as_it_is(tmp_path, monkeypatch) -> None:
    text = "from albot_core.errors import InputError\nraise InputError('mapper odd', 'x', 'y')\n"
    (tmp_path / "odd_mapper.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match=r"^mapper odd: expected x, found y$"):
        gymnasium.make("Albot/Explore-v0", mapper="odd_mapper:odd")


@pytest.mark.parametrize("make", [gymnasium.make, gymnasium.make_vec])
def test_a_mapper_that_needs_a_sensor_which_is_missing_is_refused(make) -> None:
    if "seer" not in MAPPERS:
        register_mapper(
            MapperSpec(
                name="seer",
                summary="Needs a camera.",
                paper="none",
                sensors=frozenset({"scene"}),
                layers=("place_graph",),
                factory="tests.core.mappers.topological:TopologicalMapper",
                config="tests.core.mappers.topological:TopologicalConfig",
            )
        )
    with pytest.raises(InputError, match="found seer, which needs scene"):
        make("Albot/Explore-v0", mapper="seer")
    make("Albot/Explore-v0", mapper="seer", scenes="paper").close()
    MAPPERS.pop("seer")
