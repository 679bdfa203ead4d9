"""Episodes in a table, and differences between agents in the same ones."""

from __future__ import annotations

import csv
import io
import shlex
from typing import Any

import numpy as np
import pytest

from albot_agents.evaluation.paired import (
    check_same_episodes,
    episodes_csv,
    paired_differences,
    watch_command,
)
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.trial import HORIZON, Outcome, run_trial
from albot_agents.registry import find_agent
from albot_cli.play import command as play
from albot_core.errors import InputError
from albot_core.evaluation.intervals import bootstrap_clusters
from albot_env.tasks.core.coverage import CoverageConfig
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing.reward import HomingWeights
from albot_env.tasks.homing.task import HomingConfig
from tests.env.quick import STROLL

HOMING = "Albot/Homing-v0"


def _outcome(agent: str, world: str, seed: int, spl: float, **facts: Any) -> Outcome:
    info = {"is_success": np.bool_(spl > 0), "spl": np.float64(spl), "soft_spl": spl / 2}
    return Outcome(
        trial=Trial(task=HOMING, agent=agent, world=world, seed=seed),
        info={**info, "distance_home": 0.5, "room": "hall, west", **facts},
        start=np.array((5.0, 5.0, 0.0)),
        begin=np.array((1.0, 1.0, 0.5)),
        path=np.array(((1.0, 1.0), (4.0, 5.0))),
        collisions=1,
    )


PLACES = [("a", 1), ("a", 2), ("b", 1), ("c", 1)]
GOOD = [_outcome("x", *place, spl) for place, spl in zip(PLACES, (0.9, 0.5, 1.0, 0.7), strict=True)]
BAD = [_outcome("y", *place, spl) for place, spl in zip(PLACES, (0.4, 0.5, 0.0, 0.8), strict=True)]


def test_differences_by_hand() -> None:
    found = paired_differences(GOOD, BAD)
    spl = found["spl"]
    assert spl["mean"] == pytest.approx((0.5 + 0 + 1.0 - 0.1) / 4)
    assert (spl["larger"], spl["smaller"], spl["equal"]) == (2, 1, 1)
    assert spl["ci95"][0] < spl["mean"] < spl["ci95"][1]
    assert found["success"]["mean"] == pytest.approx(0.25)
    assert found["collisions"]["mean"] == 0.0
    assert "coverage_auc" not in found  # Homing's ground is covered before it begins.
    opposite = paired_differences(BAD, GOOD)["spl"]
    assert opposite["mean"] == -spl["mean"]
    assert (opposite["larger"], opposite["smaller"]) == (1, 2)


def test_no_episodes_have_no_differences() -> None:
    assert paired_differences([], []) == {}


def test_other_episodes_are_not_compared() -> None:
    moved = _outcome("y", "c", 1, 0.8)
    moved = Outcome(**{**vars(moved), "begin": np.nextafter(moved.begin, 9)})
    for others in ([*BAD[:3], moved], BAD[::-1]):
        with pytest.raises(RuntimeError, match="x and y met different episodes"):
            paired_differences(GOOD, others)


def test_an_interval_by_worlds_is_wider_where_their_episodes_are_alike() -> None:
    """Ten episodes in each of four worlds say no more than four, if each world's are the same."""
    values = np.repeat((0.0, 1.0, 2.0, 3.0), 10)
    rng = np.random.default_rng(1)
    low, high = bootstrap_clusters(values, [k // 10 for k in range(40)], rng)
    alone = bootstrap_clusters(values[::10], range(4), np.random.default_rng(1))
    apart = bootstrap_clusters(values, range(40), rng)
    assert (low, high) == alone
    assert high - low > 2 * (apart[1] - apart[0])
    with pytest.raises(InputError, match="at least one value"):
        bootstrap_clusters(np.empty(0), [], rng)


def test_a_table_has_a_row_an_episode_and_says_how_to_see_it() -> None:
    longer = _outcome("y", "b", 1, 0.2, extra=3, pose=np.zeros(3))
    curve = {"coverage_curve": np.full(HORIZON + 1, 0.25), "rooms": 0}
    longer = Outcome(**{**vars(longer), **curve})
    rows = list(csv.DictReader(io.StringIO(episodes_csv([*GOOD, longer]))))
    assert [(row["agent"], row["world"], row["seed"]) for row in rows] == [
        ("x", "a", "1"), ("x", "a", "2"), ("x", "b", "1"), ("x", "c", "1"), ("y", "b", "1"),
    ]  # fmt: skip
    assert [float(row["spl"]) for row in rows] == [0.9, 0.5, 1.0, 0.7, 0.2]
    assert rows[0]["success"] == "1.0"
    assert not {"is_success", "way_driven"} & set(rows[0])
    assert (rows[0]["room"], rows[0]["begin"], rows[0]["steps"]) == (
        "hall, west",
        "1.0 1.0 0.5",
        "1",
    )
    assert float(rows[0]["driven"]) == 5.0
    assert (rows[0]["extra"], rows[4]["extra"]) == ("", "3")
    assert (rows[0]["coverage_auc"], rows[4]["coverage_auc"]) == ("", "0.25")
    assert "pose" not in rows[4]
    assert list(rows[0])[-1] == "command"


def test_the_command_shows_the_same_episode() -> None:
    config = HomingConfig(outing=OutwardJourneyConfig(shortest=1.0, longest=2.0))
    settings = {"mapper": "none", "odometer": "poor", "config": config, "max_episode_steps": 7}
    settings = find_agent("path-integration").environment(HOMING, settings)
    world = "random:office:3?people=2"
    trial = Trial(task=HOMING, agent="path-integration", world=world, seed=5, settings=settings)
    words = shlex.split(watch_command(trial, ["--mapper-config", "my file.yaml"]))
    assert words[:3] == ["albot", "play", "homing"]
    given = play.make_context("play", words[2:-2]).params
    assert {name: given[name] for name in ("world", "seed", "steps", "mapper", "odometer")} == {
        "world": world, "seed": 5, "steps": 7, "mapper": "none", "odometer": "poor",
    }  # fmt: skip
    assert (given["agent"], given["outward"]) == ("path-integration", "1..2")
    assert words[-2:] == ["--mapper-config", "my file.yaml"]


def _trials(**settings: Any) -> dict[str, Trial]:
    """Trials of two agents of which the second has these settings."""
    trial = {"task": HOMING, "world": "square-loop", "seed": 1}
    return {
        "x": Trial(agent="x", settings={"odometer": "pioneer"}, **trial),
        "y": Trial(agent="y", settings=settings, **trial),
    }


@pytest.mark.parametrize(
    "settings",
    [
        {"mapper": "albot1", "odometer": "poor", "laser": "none"},
        {"config": HomingConfig(observations=ObservationConfig(laser_range=6.0))},
        {"config": HomingConfig(weights=HomingWeights(success=1.0))},
        {"config": HomingConfig(), "action": "discrete"},
    ],
)
def test_agents_may_differ_in_what_they_carry_and_see(settings: dict[str, Any]) -> None:
    check_same_episodes(_trials(**settings))


def test_agents_may_differ_in_the_hints_that_they_see() -> None:
    """Of the agents that attempt a probe some are used to hints."""
    probe: dict[str, Any] = {"task": "Albot/Probe-Detour-v0", "world": "probe-detour", "seed": 1}
    check_same_episodes(
        {
            name: Trial(
                agent=name, settings=find_agent(name).environment(probe["task"], {}), **probe
            )
            for name in ("albot1-homing", "patch-homing")
        }
    )


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"max_episode_steps": 9}, "max_episode_steps"),
        ({"movables": False}, "movables"),
        ({"journeys": 4}, "journeys"),
        ({"config": STROLL}, "outing"),
        ({"config": HomingConfig(radius=0.5)}, "radius"),
        (
            {
                "config": HomingConfig(
                    observations=ObservationConfig(coverage=CoverageConfig(radius=3.0))
                )
            },
            "coverage",
        ),
    ],
)
def test_agents_that_would_meet_other_episodes_are_refused(
    settings: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=f"agent y: expected the episodes of x, .*{message}"):
        check_same_episodes(_trials(**settings))


def test_a_run_tells_where_its_episode_began() -> None:
    settings = find_agent("random").environment(HOMING, {"config": STROLL, "max_episode_steps": 3})
    trial = Trial(task=HOMING, agent="random", world="square-loop", seed=2, settings=settings)
    outcome = run_trial(trial)
    assert (outcome.begin[:2] == outcome.path[0]).all()
    assert outcome.begin.shape == (3,)


def test_lengths_of_a_journey_are_told_whole_and_others_not_at_all() -> None:
    def shown(**outing: float) -> str:
        config = HomingConfig(outing=OutwardJourneyConfig(**outing))
        settings = {"mapper": "none", "config": config}
        return watch_command(Trial(task=HOMING, agent="x", world="w", seed=1, settings=settings))

    assert "--outward 0.00001..30.12345678 " in shown(shortest=0.00001, longest=30.12345678)
    assert "--outward" not in shown()
    assert shown(away=1.0) == ""
