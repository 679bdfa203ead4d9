"""Probes as experiments: right answers, chance, verdicts, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from albot_agents.evaluation.plan import Trial as Episode
from albot_agents.evaluation.trial import Outcome
from albot_core.errors import InputError
from albot_env.tasks.probe.task import PROBES
from albot_experiments import probes
from albot_experiments.registry import EXPERIMENTS
from albot_experiments.report import Report
from tests.inline_engine import InlineEngine

DETOUR, RECTANGLE = "Albot/Probe-Detour-v0", "Albot/Probe-Rectangle-v0"
POOL = "Albot/Probe-HiddenGoal-v0"


def outcome(task: str, trial: str, choice: str = "none", *, home: bool = False) -> Outcome:
    """An episode that ended so, 5 m from home."""
    info = {"trial": trial, "choice": choice, "is_success": home, "spl": 0.5, "distance_home": 2.0}
    return Outcome(
        trial=Episode(task=task, agent="x", world=PROBES[task].scene.world, seed=1),
        info=info,
        start=np.zeros(3),
        begin=np.array((5.0, 0.0, 0.0)),
        path=np.array([(5.0, 0.0), (0.0, 0.0)]),
        collisions=0,
    )


def test_what_is_right_and_how_probable_it_is_by_chance() -> None:
    scene = PROBES[RECTANGLE].scene
    opposite = [
        outcome(RECTANGLE, trial, "opposite corner")
        for trial in ("column as it was", "no column", "column moved")
    ]
    assert [probes.is_right(scene, each) for each in opposite] == [False, True, True]
    assert [probes.chance_of(scene, each) for each in opposite] == [1 / 4, 1 / 2, 1 / 2]
    pool = PROBES[POOL].scene
    at_home = outcome(POOL, "from the east", home=True)
    assert probes.is_right(pool, at_home)
    # Of the circle of radius 5 m around the robot, an arc lies within 1 m of home.
    angles = np.linspace(0, 2 * math.pi, 100_001)
    circle = np.stack((5 * np.cos(angles), 5 * np.sin(angles)), axis=1)
    inside = np.hypot(*(circle - (5.0, 0.0)).T) <= 1.0
    assert probes.chance_of(pool, at_home) == pytest.approx(inside.mean(), rel=1e-3)


@pytest.mark.parametrize(("right", "verdict"), [(10, False), (16, True)])
def test_the_whole_interval_must_lie_above_chance(right: int, verdict: bool) -> None:
    """Wilson: 10 of 20 may be chance, 16 of 20 are not."""
    scene = PROBES[DETOUR].scene
    choices = ["short way"] * right + ["long way"] * (20 - right)
    some = [outcome(DETOUR, "doorway shut", choice) for choice in choices]
    assert probes.is_above_chance(scene, some) == verdict


@pytest.fixture(scope="module")
def detour() -> Report:
    return probes.run(DETOUR, range(3, 6), agent="albot1-homing", engine=InlineEngine())


def test_albot1_finds_the_detour_and_the_report_says_so(detour: Report, tmp_path: Path) -> None:
    """Its known way leads through the door that is shut now; see `Navigator`."""
    for agent in ("oracle", "albot1-homing"):
        figures = detour.measured[agent]
        assert isinstance(figures, dict)
        assert (figures["short way"], figures["long way"], figures["home"]) == (1.0, 0.0, 1.0)
    assert detour.measured["right"] == 1.0
    assert detour.measured["chance"] == 0.5
    detour.write(tmp_path)
    assert (tmp_path / "paths.png").exists()


def test_an_agent_that_knows_nothing_does_not_reach_it() -> None:
    report = probes.run(
        RECTANGLE, range(3, 9), agent="random", mapper="none", engine=InlineEngine()
    )
    assert not report.holds
    assert report.verdicts == {"oracle": True, "random": False}


def test_what_is_no_agent_for_a_probe_is_refused() -> None:
    with pytest.raises(InputError, match=r"one for Albot/Probe-Detour-v0.*found gap-explorer"):
        probes.run(DETOUR, range(1), agent="gap-explorer")
    with pytest.raises(InputError, match="albot2"):
        probes.run(DETOUR, range(1), agent="map-homing", mapper="albot2")
    with pytest.raises(InputError, match="at least one seed"):
        probes.run(DETOUR, range(0))
    with pytest.raises(InputError, match="--agent: expected a probe of agents: probe-tri"):
        EXPERIMENTS["albot1-e1"].run(range(1), lambda done: None, agent="oracle")
