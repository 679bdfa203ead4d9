"""Which episodes a spec stands for, and the commands that show them again."""

from __future__ import annotations

import shlex

import pytest

from albot_agents.stress.plan import Episode, Violation, plan_episodes
from albot_core.errors import InputError
from albot_maps.generators.spec import KINDS


def plan(spec: str, count: int = 3, first: int = 0, agents: tuple[str, ...] = ("random",)):
    return plan_episodes(spec, agents, count=count, first=first, mapper="none", steps=20)


def test_a_kind_stands_for_worlds_whose_seeds_count_up():
    episodes = plan("random:maze", first=7)
    assert [(each.world, each.seed) for each in episodes] == [
        ("random:maze:7", 7),
        ("random:maze:8", 8),
        ("random:maze:9", 9),
    ]


def test_parameters_come_after_the_seed():
    worlds = [each.world for each in plan("random:office?rooms=8&clutter=0", count=2)]
    assert worlds == ["random:office:0?rooms=8&clutter=0", "random:office:1?rooms=8&clutter=0"]


def test_random_alone_stands_for_all_kinds_in_turn():
    worlds = [each.world for each in plan("random", count=8, first=5)]
    assert worlds == [f"random:{kind}:5" for kind in KINDS] + [
        f"random:{kind}:6" for kind in KINDS[:2]
    ]


@pytest.mark.parametrize("spec", ["square-loop", "random:office:42?rooms=6"])
def test_one_world_is_run_with_several_seeds(spec: str):
    assert [(each.world, each.seed) for each in plan(spec, first=2)] == [
        (spec, 2),
        (spec, 3),
        (spec, 4),
    ]


def test_every_agent_drives_in_every_world():
    episodes = plan("square-loop", count=2, agents=("gap-explorer", "random"))
    assert [(each.seed, each.agent) for each in episodes] == [
        (0, "gap-explorer"),
        (0, "random"),
        (1, "gap-explorer"),
        (1, "random"),
    ]


@pytest.mark.parametrize(
    ("spec", "found"),
    [
        ("random:ofice", "did you mean office"),
        ("random:office?room=8", "did you mean rooms"),
        ("random:office?rooms=200&width=8", "random:office:0"),
        ("random?rooms=8", "after a kind"),
        ("random:", "one of the kinds"),
        ("office-rong", "did you mean office-ring"),
    ],
)
def test_worlds_that_are_none(spec: str, found: str):
    with pytest.raises(InputError, match=found):
        plan(spec)


def test_seeds_beyond_the_last_are_refused():
    with pytest.raises(InputError, match="seed"):
        plan("random:office", first=2**64 - 2)


def test_a_violation_names_the_command_that_shows_it():
    episode = Episode(
        world="random:office:3?rooms=8&clutter=0", agent="random", mapper="none", seed=3, steps=20
    )
    command = Violation(episode=episode, step=7, what="").command
    assert shlex.split(command) == [
        "albot", "play", "--world", "random:office:3?rooms=8&clutter=0", "--agent", "random",
        "--mapper", "none", "--seed", "3", "--steps", "7",
    ]  # fmt: skip
    at_reset = Violation(episode=episode, step=0, what="").command
    assert at_reset.endswith("--steps 1")
