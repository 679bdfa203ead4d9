"""What the shell completes, asked as a shell asks, and the names that stand beside registries."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterable

import pytest
from click.shell_completion import CompletionItem, ShellComplete

from albot_agents import registry
from albot_agents.benchmark.protocol import find_protocol
from albot_agents.task import short_name, task_names
from albot_cli import completion
from albot_cli.group import albot
from albot_core.mappers.registry import MAPPERS
from albot_core.robot import ROBOTS
from albot_env.faults.registry import FAULTS
from albot_env.sim.compass import COMPASSES
from albot_env.sim.laser import LASERS
from albot_env.sim.odometer import ODOMETERS
from albot_env.sim.scenes import SCENES
from albot_env.sim.sonar import SONARS
from albot_experiments.registry import EXPERIMENTS
from albot_maps import catalogue_names
from albot_maps.generators.spec import KINDS

TASKS = [name for task in task_names() for name in (short_name(task), task)]
WORLDS = [*catalogue_names(), *(f"random:{kind}" for kind in KINDS)]
SENSORS = {"--laser": LASERS, "--sonar": SONARS, "--scenes": SCENES, "--compass": COMPASSES}
WITH_NONE: tuple[str, ...] = ()
"""Stands for all mappers, and none."""
SLOW = ("numba", "pymunk", "matplotlib", "pygame", "torch", "scipy", "shapely")


def _items(line: str, last: str = "") -> list[CompletionItem]:
    """What a shell offers for the last word of a command line."""
    return ShellComplete(albot, {}, "albot", "_ALBOT_COMPLETE").get_completions(line.split(), last)


def _completed(line: str, last: str = "") -> list[str]:
    return [item.value for item in _items(line, last)]


@pytest.mark.parametrize(
    ("ours", "registered"),
    [
        (completion.AGENTS, registry.agent_names()),
        (completion.ODOMETERS, ODOMETERS),
        (completion.ROBOTS, ROBOTS),
        (completion.FAULTS, FAULTS),
        (completion.KINDS, KINDS),
        (completion.BENCHMARK_WORLDS, find_protocol().worlds),
        (completion.BENCHMARK_ODOMETERS, find_protocol().odometers),
        (completion.LASERS, LASERS),
        (completion.SONARS, SONARS),
        (completion.SCENES, SCENES),
    ],
)
def test_the_names_are_those_of_the_registries(
    ours: tuple[str, ...], registered: Iterable[str]
) -> None:
    assert sorted(ours) == sorted(name for name in registered if name != "none")


@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("play", TASKS),
        ("config", TASKS),
        ("train", TASKS),
        ("evaluate", TASKS),
        ("results --task", TASKS),
        ("results --worlds", completion.BENCHMARK_WORLDS),
        ("results --odometer", completion.BENCHMARK_ODOMETERS),
        ("mappers", MAPPERS),
        ("map LOG --mapper", MAPPERS),
        ("compare LOG --mappers", MAPPERS),
        ("compare", WORLDS),
        ("play --world", WORLDS),
        ("worlds show", WORLDS),
        ("worlds make", KINDS),
        ("experiment run", [*EXPERIMENTS, "all"]),
        ("play --agent", [*completion.AGENTS, "keyboard"]),
        ("evaluate homing --against", completion.AGENTS),
        ("experiment run ID --agent", completion.AGENTS),
        *((f"{command} --worlds", WORLDS) for command in ("evaluate homing", "stress")),
        *((f"play {option}", {*names, "none"}) for option, names in SENSORS.items()),
        *((f"compare LOG {option}", {*names, "none"}) for option, names in SENSORS.items()),
        *(
            (f"{command} --mapper", WITH_NONE)
            for command in ("play", "evaluate homing", "stress", "experiment run")
        ),
        *(
            (f"{command} --odometer", ODOMETERS)
            for command in ("play", "evaluate homing", "compare LOG", "experiment run")
        ),
        *(
            (f"{command} --agent", completion.AGENTS)
            for command in ("evaluate homing", "stress", "compare LOG", "results")
        ),
        *((f"{command} --robot", ROBOTS) for command in ("play", "train homing")),
    ],
)
def test_names_are_completed(line: str, names: Iterable[str]) -> None:
    if names is WITH_NONE:  # Other tests register mappers after this table was made.
        names = [*MAPPERS, "none"]
    assert _completed(line) == sorted(names)
    begun = min(names)[:3]
    assert _completed(line, begun) == sorted(name for name in names if name.startswith(begun))


def test_the_last_of_a_list_is_completed() -> None:
    assert _completed("compare LOG --mappers", "albot1,gm") == ["albot1,gmapping"]


def test_files_are_completed_where_no_name_fits() -> None:
    for line in ("play", "train", "evaluate homing --agent", "worlds show"):
        (item,) = _items(line, "runs/mi")
        assert (item.type, item.value) == ("file", "runs/mi")
    assert _items("config", "runs/mi") == []


@pytest.mark.parametrize("kind", ["agent", "world", "mapper", "task", "experiment", "odometer"])
def test_completing_loads_nothing_slow(kind: str) -> None:
    """In a process of its own, because this one has everything loaded."""
    code = (
        "import sys; from albot_cli import completion; "
        f"assert completion.{kind}_names(None, None, ''); "
        f"print([name for name in {SLOW} if name in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_a_shell_that_asks_is_answered() -> None:
    """As bash does, through the command itself."""
    asked = {"COMP_WORDS": "albot evaluate homing --agent albot1", "COMP_CWORD": "4"}
    code = "import sys; sys.argv[0] = 'albot'; from albot_cli.main import main; main()"
    run = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **asked, "_ALBOT_COMPLETE": "bash_complete"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (run.stdout, run.stderr) == ("plain,albot1-homing\n", "")


def test_names_in_a_help_text() -> None:
    assert completion.listed(("a", "b"), "none") == "a, b or none"
