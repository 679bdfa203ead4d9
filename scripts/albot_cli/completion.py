"""Names that the shell completes: callbacks for click's `shell_complete`.

A shell calls the command at every press of Tab, so slow modules are not loaded: the names of
agents, sensors, robots and kinds of worlds stand here instead of being read from their registries.
Help texts show them, and `tests/cli/test_completion.py` compares them with the registries.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import TypeAlias

import click
from click.shell_completion import CompletionItem

Completer: TypeAlias = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]

AGENTS = (
    "albot0-homing", "albot1-homing", "association-explorer", "association-homing",
    "decision-stump", "explore-and-home", "exploring", "gap-explorer", "hint-follower",
    "home-vector", "homing", "homing-blind", "homing-by-map", "homing-lstm", "homing-mapless",
    "map-homing", "nearest-frontier",
    "onward-follower", "onward-round-trip", "oracle", "patch-homing", "path-integration",
    "place-judge", "place-recognition", "random", "ratslam-explorer", "ratslam-homing",
    "round-trip",
    "sahabot-homing",
)  # fmt: skip
ODOMETERS = (
    "ideal", "pioneer", "poor", "carpet", "stage", "albot1-disturbed", "bias-1.5", "bias-3",
    "bias-6",
)  # fmt: skip
LASERS = ("ideal", "lms-200", "lms-200-fine", "panoramic", "long", "short")
SONARS = ("ideal", "pioneer", "poor")
SCENES = ("ideal", "paper", "ambiguous")
COMPASSES = ("ideal", "polarised", "clouded")
ROBOTS = ("pioneer-3dx", "kobuki", "peoplebot")
FAULTS = (
    "laser-dropout", "stuck-beams", "blind-sector", "frozen-scan", "saturated-sonars",
    "odometer-jump", "frozen-odometer", "wheel-slip", "lost-readings", "doubled-readings",
    "swapped-readings", "late-readings", "kidnap", "turned", "door-shut", "furniture-moved",
    "person-in-exit",
)  # fmt: skip
KINDS = ("apartment", "hall", "maze", "office", "ring", "warehouse")
"""Kinds of random worlds."""
BENCHMARK_WORLDS = (
    "offices", "apartments", "mazes", "rings", "halls", "warehouses", "plans", "scene",
)  # fmt: skip
"""Kinds of worlds of the benchmark."""
BENCHMARK_ODOMETERS = ("pioneer", "ideal", "poor")
EXPORTS = (
    "tum", "kitti", "geojson", "graphml", "g2o", "carmen", "map_server", "ply", "csv", "ros2",
    "rerun", "minari",
)  # fmt: skip
"""Formats of `albot export`."""
POSES = ("true", "corrected", "believed")
"""Kinds of poses, the best first."""
NONE = "none"
"""No mapper, or no sensor of a sort."""


def listed(names: Iterable[str], *others: str) -> str:
    """Return names for a help text: `a, b or c`."""
    *most, last = (*names, *others)
    return f"{', '.join(most)} or {last}"


def complete(
    names: Callable[[], Iterable[str]], *, files: bool = False, comma: bool = False
) -> Completer:
    """Return a callback that completes names.

    Args:
        names: Returns the names; called when Tab is pressed.
        files: Whether it may be a file as well, which the shell completes if no name fits.
        comma: Whether it is a list with commas, of which the last entry is completed.
    """

    def completed(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
        begun, comma_itself, last = incomplete.rpartition(",") if comma else ("", "", incomplete)
        fitting = sorted(name for name in names() if name.startswith(last))
        if files and not fitting:
            return [CompletionItem(incomplete, type="file")]
        return [CompletionItem(f"{begun}{comma_itself}{name}") for name in fitting]

    return completed


def _mappers() -> Iterable[str]:
    from albot_core.mappers.registry import mapper_names

    return mapper_names()


def _tasks() -> Iterable[str]:
    from albot_agents.task import short_name, task_names

    return [name for task in task_names() for name in (short_name(task), task)]


def _experiments() -> Iterable[str]:
    from albot_experiments.registry import EXPERIMENTS

    return (*EXPERIMENTS, "all")


def _catalogue() -> Iterable[str]:
    spec = find_spec("albot_maps")  # Found, but not loaded.
    assert spec is not None
    folders = spec.submodule_search_locations or ()
    return (path.stem for folder in folders for path in Path(folder, "catalogue").glob("*.yaml"))


def _worlds() -> Iterable[str]:
    return (*_catalogue(), *(f"random:{kind}" for kind in KINDS))


mapper_names = complete(_mappers)
mapper_list = complete(_mappers, comma=True)
robots_mapper_names = complete(lambda: (*_mappers(), NONE))
compared_mapper_names = complete(lambda: (*_mappers(), NONE, "all"))
agent_names = complete(lambda: AGENTS, files=True)
played_agent_names = complete(lambda: (*AGENTS, "keyboard"), files=True)
task_names = complete(_tasks)
tasks_or_files = complete(_tasks, files=True)
experiment_names = complete(_experiments)
world_names = complete(_worlds, files=True)
kind_names = complete(lambda: KINDS)
odometer_names = complete(lambda: ODOMETERS)
benchmark_worlds = complete(lambda: BENCHMARK_WORLDS)
benchmark_odometers = complete(lambda: BENCHMARK_ODOMETERS)
laser_names = complete(lambda: (*LASERS, NONE))
sonar_names = complete(lambda: (*SONARS, NONE))
scene_names = complete(lambda: (*SCENES, NONE))
compass_names = complete(lambda: (*COMPASSES, NONE))
robot_names = complete(lambda: ROBOTS)
fault_names = complete(lambda: FAULTS)
