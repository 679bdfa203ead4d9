"""Which episodes an evaluation consists of."""

from __future__ import annotations

from pathlib import Path

import pytest

from albot_agents.evaluation.plan import parse_seeds, plan_trials
from albot_agents.task import check_task
from albot_core.errors import InputError
from albot_maps import catalogue_names
from albot_maps.generators.spec import seeded


@pytest.mark.parametrize(
    ("text", "seeds"), [("3..5", [3, 4, 5]), ("7", [7]), ("2..2", [2]), (" 1..2 ", [1, 2])]
)
def test_both_ends_of_seeds_are_included(text: str, seeds: list[int]) -> None:
    assert list(parse_seeds(text)) == seeds


NONE = ["", "a..b", "5..3", "1-3", "1..", "-1..3", "1...3", "1.5", "0..1000000", "9" * 5000]


@pytest.mark.parametrize("text", NONE)
def test_seeds_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="--seeds: expected"):
        parse_seeds(text)


def test_a_task_that_is_none_is_refused_with_a_hint() -> None:
    check_task("Albot/Homing-v0")
    with pytest.raises(InputError, match=r"task: .*did you mean Albot/Homing-v0"):
        check_task("Albot/homing")
    with pytest.raises(InputError, match="found nothing"):
        check_task("")


@pytest.mark.parametrize(
    ("spec", "world"),
    [
        ("random:office", "random:office:7"),
        ("random:office?rooms=4", "random:office:7?rooms=4"),
        ("random:office:3", "random:office:3"),
        ("random:office:3?rooms=4", "random:office:3?rooms=4"),
        ("office-ring", "office-ring"),
    ],
)
def test_a_seed_makes_a_world_where_it_lacks_one(spec: str, world: str) -> None:
    assert seeded(spec, 7) == world


def test_each_seed_is_a_world_or_is_run_in_each(tmp_path: Path) -> None:
    from importlib import resources

    for name in catalogue_names()[:2]:
        text = (resources.files("albot_maps") / "catalogue" / f"{name}.yaml").read_text()
        (tmp_path / f"{name}.yaml").write_text(text)
    worlds = ("random:maze", f"{tmp_path}/*.yaml")
    trials = plan_trials("Albot/Homing-v0", "random", worlds, range(4, 6), {"mapper": "none"})
    files = sorted(str(path) for path in tmp_path.iterdir())
    assert [(trial.world, trial.seed) for trial in trials] == [
        ("random:maze:4", 4), ("random:maze:5", 5),
        *((file, seed) for file in files for seed in (4, 5)),
    ]  # fmt: skip


@pytest.mark.parametrize("worlds", ["random:offic", "nowhere/*.yaml", "offfice-ring"])
def test_worlds_that_are_none_are_refused(worlds: str) -> None:
    with pytest.raises(InputError):
        plan_trials("Albot/Homing-v0", "random", (worlds,), range(2), {})
